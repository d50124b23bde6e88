"""Frames of people as messages, and bags of ROS4HRI that rosbags writes."""

from dataclasses import dataclass, field
from math import cos, sin

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

OPTICAL = "camera_optical_frame"
LEVEL = (0.5, 0.5, -0.5, 0.5)
"""Quaternion of a face in an optical frame that looks straight along the camera's axis, to the camera."""
TO_GAZE = (-0.5, 0.5, -0.5, 0.5)
"""Quaternion of a gaze in its face: z is where x of the face is."""
STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def transform(child, parent="map", rotation=STRAIGHT, time=5.0, **translation):
    """Return a geometry_msgs/TransformStamped."""
    header = {"stamp": {"sec": int(time), "nanosec": round(time % 1 * 1e9)}, "frame_id": parent}
    at = {"x": 1.0, "y": 2.0, "z": 0.5} | translation
    own = {"translation": at, "rotation": dict(zip("xyzw", rotation, strict=True))}
    return {"header": header, "child_frame_id": child, "transform": own}


def multiply(a, b):
    """Return the product of two quaternions."""
    (x, y, z, w), (p, q, r, s) = a, b
    return (
        w * p + x * s + y * r - z * q,
        w * q - x * r + y * s + z * p,
        w * r + x * q - y * p + z * s,
        w * s - x * p - y * q - z * r,
    )


def turn_face(left):
    """Return the quaternion of a face that is turned to its left by an angle, in an optical frame."""
    return multiply(LEVEL, (0.0, 0.0, sin(left / 2), cos(left / 2)))


@dataclass
class HumansBag:
    """A ROS 2 bag of one person before the camera, thirty frames a second.

    turn: the angle of the face by time. faces: pairs (first time, id of the face from then on).
    distance: metres ahead by time. named_from: when the person's face is named first; None never.
    links: further frames that do not move. messages: (topic, seconds, message) instead of all these.
    """

    path: object
    seconds: float = 4.0
    turn: object = lambda t: 0.3 * sin(t)
    distance: object = lambda t: 2.0 - 0.1 * t
    faces: tuple = ((0.0, "f1"),)
    person: str = "ann"
    named_from: float | None = 0.0
    gaze: bool = True
    links: tuple = ()
    plugin: StoragePlugin = StoragePlugin.SQLITE3
    messages: list = field(default_factory=list)

    def write(self):
        store = get_typestore(Stores.ROS2_HUMBLE)
        store.register(get_types_from_msg("std_msgs/Header header\nstring[] ids\n", "hri_msgs/msg/IdsList"))
        store.register(
            get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", "tf2_msgs/msg/TFMessage")
        )
        kinds = {"/tf": "tf2_msgs/msg/TFMessage", "/tf_static": "tf2_msgs/msg/TFMessage"}
        messages = self.messages or self.list_messages()
        for topic, *_ in messages:
            kind = "hri_msgs/msg/IdsList" if topic.endswith("/tracked") else "std_msgs/msg/String"
            kinds.setdefault(topic, kind)
        with Writer(self.path, version=9, storage_plugin=self.plugin) as writer:
            own = {t: writer.add_connection(t, kind, typestore=store) for t, kind in kinds.items()}
            for topic, time, message in messages:
                made = _make(store, kinds[topic], message)
                writer.write(own[topic], round((1000 + time) * 1e9), store.serialize_cdr(made, kinds[topic]))
        return self.path

    def list_messages(self):
        """Return (topic, seconds, message) in the order of time."""
        found = []
        if self.links:
            found.append(("/tf_static", 0.0, {"transforms": list(self.links)}))
        for k in range(round(self.seconds * 30)):
            time = k / 30
            face = [id for begin, id in self.faces if begin <= time][-1]
            if self.named_from is not None and time >= self.named_from and k % 3 == 0:
                listed = {"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}, "ids": [self.person]}
                found.append(("/humans/persons/tracked", time, listed))
                found.append((f"/humans/persons/{self.person}/face_id", time + 0.001, {"data": face}))
            at = {"x": 0.1, "y": -0.2, "z": self.distance(time)}
            own = transform(f"face_{face}", OPTICAL, turn_face(self.turn(time)), 1000 + time, **at)
            found.append(("/tf", time + 0.002, {"transforms": [own]}))
            if self.gaze:
                zero = {"x": 0.0, "y": 0.0, "z": 0.0}
                gaze = transform(f"gaze_{face}", f"face_{face}", TO_GAZE, 1000 + time + 1e-4, **zero)
                found.append(("/tf", time + 0.003, {"transforms": [gaze]}))
        return found


def show(*transforms, time):
    """Return a message with frames."""
    return "/tf", time, {"transforms": list(transforms)}


def named(person, face, time):
    """Return the message that names the face of a person."""
    return f"/humans/persons/{person}/face_id", time, {"data": face}


def see(face, time, **at):
    """Return the frame of a face that looks straight along the axis of the camera."""
    return transform(f"face_{face}", OPTICAL, LEVEL, 1000 + time, **({"x": 0.0, "y": 0.0, "z": 2.0} | at))


def _make(store, kind, fields):
    """Return a message of the types of rosbags, of dictionaries."""
    made = store.types[kind]
    parts = dict(store.fielddefs[kind][1])
    own = {}
    for name, (node, detail) in parts.items():
        value = fields[name]
        if node.name == "NAME":
            own[name] = _make(store, detail, value)
        elif node.name in ("ARRAY", "SEQUENCE") and detail[0][0].name == "NAME":
            own[name] = [_make(store, detail[0][1], each) for each in value]
        else:
            own[name] = value
    return made(**own)
