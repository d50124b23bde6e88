"""A robot that watches the faces of a replayed bag decides as on the samples of the bag."""

import json
from math import sin
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from lcorpp.assembly import TrainingOptions
from lcorpp.assembly.track_robot import set_up_track_robot
from lcorpp.camera.bags import open_bag
from lcorpp.decision.strategies import LCORPP
from lcorpp.domains import load_domain
from lcorpp.errors import ActionFailedError, DomainError, PersonLeftError
from lcorpp.robot import tracking
from lcorpp.robot.connecting import connect
from lcorpp.robot.loop import RobotLoop
from lcorpp.robot.reading import read_robot_config
from lcorpp.robot.recorded import RecordedLoop, RecordedPeople, read_samples
from lcorpp.robot.tracking import PeopleTracks
from lcorpp.worlds.ros.people.people_bag import _iterate
from lcorpp.worlds.ros.sensor_messages import Sample
from lcorpp.worlds.ros.skills import Body, Watch
from tests.worlds.ros.humans_bag import OPTICAL, HumansBag, transform
from tests.worlds.ros.stand_in import EXAMPLES, bridge
from tests.worlds.ros.test_rosbridge import WAIT

BASE = """domain = "engagement"
[connection]
url = "{url}"
timeout = 5.0
[robot]
frame = "{frame}"
[people]
topic = "/tf"
type = "tf2_msgs/TFMessage"
decide_after = {seconds}
training_heading = 0.0
max_silence = 60.0
[facts]
place = "{place}"
time = "quiet"
company = "alone"
[actions.watch]
skill = "watch"
sense = "gaze"
seconds = 2.0
timeout = 120.0
"""
LINK = transform(OPTICAL, "base_link", (-0.5, 0.5, -0.5, 0.5), x=0.0, y=0.0, z=1.2)
ENGAGEMENT = Path(__file__).parents[3] / "shared" / "data" / "engagement"
SECONDS = 2.0
LABEL_OF = {"engaged": "rests", "not_engaged": "wanders"}


class Player:
    """A bag that is published message by message over a rosbridge server."""

    def __init__(self, messages):
        self.server, self._messages = bridge.BridgeServer(), iter(messages)
        self.published = 0

    def publish_next(self):
        """Publish the next message; return its topic, None after the last."""
        found = next(self._messages, None)
        if found is None:
            return None
        topic, _, message = found
        self.server.publish(topic, message)
        self.published += 1
        return topic


@pytest.fixture(scope="module")
def parts():
    """The robot of the domain, with classifiers of simulated people that are trained fast."""
    options = {
        "gaze": TrainingOptions("summaries", tracks=200),
        "motion": TrainingOptions("summaries", tracks=60),
    }
    domain = load_domain("engagement")
    return set_up_track_robot(domain, options, domain.planning.solver)


def read_messages(path):
    """Return topic, seconds and message of what a robot publishes about people."""
    with open_bag(path) as reader:
        topics = {c.topic for c in reader.connections if c.topic.startswith(("/tf", "/humans/persons"))}
        return list(_iterate(reader, topics, path))


def make_config(folder, url="ws://localhost:1", *, place="entrance", frame="base_link"):
    file = folder / "robot.toml"
    file.write_text(BASE.format(url=url, place=place, frame=frame, seconds=SECONDS))
    return read_robot_config(file)[0]


def decide_online(parts, messages, folder, monkeypatch, *, place, frame, person):
    """Return the decision of a robot that receives the messages; each one arrives before the next is sent."""
    player = Player(messages)
    config = make_config(folder, player.server.url, place=place, frame=frame)
    connection = connect(config.connection)
    try:
        loop = RobotLoop(config, *parts, LCORPP, connection)
        update, processed, is_processed = loop._perception.update, [None], Event()

        def note_and_update(timeout):
            if processed[0] != loop._perception.last_message:  # whose samples are in the tracks now
                processed[0] = loop._perception.last_message
                is_processed.set()
            return update(timeout)

        monkeypatch.setattr(loop._perception, "update", note_and_update)

        def receive_next(_):
            is_processed.clear()
            topic = player.publish_next()
            assert topic is not None, "the bag has ended"
            if topic == "/tf":
                assert is_processed.wait(WAIT)

        def receive_start(_):
            if loop._people.list_people().get(person, 0.0) < SECONDS:
                receive_next(None)

        monkeypatch.setattr(tracking, "sleep", receive_next)
        monkeypatch.setattr("lcorpp.robot.loop.sleep", receive_start)
        (decision,) = loop.run(1)
    finally:
        connection.close()
        player.server.close()
    if decision.error is not None:
        raise decision.error
    return decision.episode


def record(samples, parts):
    windows = {sense.name: sense.seconds for sense in parts[0].domain.senses}
    return RecordedPeople(samples, parts[1], max_silence=60.0, windows=windows)


def compare(parts, path, folder, monkeypatch, *, place, frame):
    """Check that both decide the same; return the decision."""
    config = make_config(folder, place=place, frame=frame)
    samples = read_samples(config, path)
    people = record(samples, parts)
    (decision,) = RecordedLoop(config, parts[0], LCORPP, people).run()
    offline = decision.episode
    online = decide_online(
        parts,
        read_messages(path),
        folder,
        monkeypatch,
        place=place,
        frame=frame,
        person=samples[0].person,
    )
    assert decision.person == samples[0].person
    assert online.report == offline.report
    assert online.evidence == offline.evidence
    assert [(s.action, s.observation) for s in online.steps] == [
        (s.action, s.observation) for s in offline.steps
    ]
    for one, other in zip(online.steps, offline.steps, strict=True):
        np.testing.assert_allclose(one.belief, other.belief, atol=1e-12)
    return offline


@pytest.mark.parametrize(
    ("size", "place", "report"),
    [(0.002, "corridor", "engaged"), (0.5, "desk", "not_engaged")],
)
def test_a_replayed_bag_is_decided_as_its_samples(tmp_path, parts, monkeypatch, size, place, report):
    """Somebody in the corridor whose gaze rests on the robot, and somebody at the desk who looks around."""
    path = HumansBag(
        tmp_path / "bag", seconds=20.0, turn=lambda t: 0.35 + size * sin(5 * t), links=(LINK,)
    ).write()
    episode = compare(parts, path, tmp_path, monkeypatch, place=place, frame="base_link")
    assert episode.report == report
    assert len(episode.steps) > 1  # it watches first, as place and gaze disagree


@pytest.mark.skipif(not ENGAGEMENT.is_dir(), reason="the recordings are not here (shared/data/engagement)")
@pytest.mark.parametrize("name", ["1p_AA_eng_1", "1p_FV_dis_1"])
def test_a_recorded_bag_is_decided_as_its_samples(tmp_path, parts, monkeypatch, name):
    compare(parts, ENGAGEMENT / name, tmp_path, monkeypatch, place="entrance", frame="camera_link")


def test_the_command_decides_about_the_people_of_a_bag(tmp_path, lcorpp):
    """From a bag to the belief in one command; the classifiers are trained on simulated people."""
    path = HumansBag(tmp_path / "bag", seconds=7.0, turn=lambda t: 0.35, links=(LINK,)).write()
    make_config(tmp_path)
    log = tmp_path / "robot.jsonl"
    ended = lcorpp("robot", "--config", tmp_path / "robot.toml", "--bag", path, "--log", log)
    assert ended.code == 0, ended.err
    *_, decision, last = ended.out.splitlines()
    assert decision.startswith("  person ann: greet, the decision; engaged 0.9")
    assert last == "person ann: engaged"
    assert lcorpp("replay", log).code == 0


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (1.5, "no track of a person lasts 2 s"),
        (3.0, "gaze has no label of ann, who was watched for 1.0 s of 2 s, and the recording ends"),
    ],
)
def test_a_recording_that_is_too_short_is_named(tmp_path, lcorpp, seconds, words):
    path = HumansBag(
        tmp_path / "bag", seconds=seconds, turn=lambda t: 0.35 + 0.5 * sin(5 * t), links=(LINK,)
    ).write()
    make_config(tmp_path, place="desk")
    ended = lcorpp("robot", "--config", tmp_path / "robot.toml", "--bag", path)
    assert (ended.code, words in ended.out + ended.err) == (0, True), ended


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('place = "desk"', 'place = { topic = "/place" }'), "[facts] place is not known from a bag"),
        (('domain = "engagement"', 'domain = "engagement"\nstrategy = "random"'), "random draws its actions"),
        (("[facts]", 'head_frame = "head"\n[facts]'), "no face is connected to the head_frame 'head'"),
    ],
)
def test_what_a_bag_does_not_have_is_named(tmp_path, lcorpp, change, words):
    path = HumansBag(tmp_path / "bag", links=(LINK,)).write()
    file = tmp_path / "robot.toml"
    text = BASE.format(url="ws://localhost:1", place="desk", frame="base_link", seconds=2)
    file.write_text(text.replace(*change))
    ended = lcorpp("robot", "--config", file, "--bag", path)
    assert (ended.code, words in ended.err) == (2, True), ended.err


def test_a_time_out_counts_by_the_samples(tmp_path, parts):
    """The face is turned away after 2.5 s, and comes back after 15 s; a slow computer changes nothing."""
    gaze = {"gaze_angle": 0.5, "robot_angle": 0.1, "face_distance": 1.2}
    samples = [Sample(k / 30, "ann", 1.0, 0.0, {} if 75 <= k < 450 else gaze) for k in range(600)]
    people = record(samples, parts)
    while people.now < 2.4:
        people.wait()
    words = r"gaze has no label of ann, who was watched for 5\.\d s of 2 s, within 5 s"
    with pytest.raises(ActionFailedError, match=words):
        Watch("gaze", 2.0, LABEL_OF).observe(people, "ann", timeout=5.0)
    assert people.now == pytest.approx(7.5, abs=0.1)


def test_a_bag_is_for_models_that_watch(tmp_path, lcorpp):
    corridor = EXAMPLES / "robot.toml"
    ended = lcorpp("robot", "--config", corridor, "--bag", tmp_path)
    assert ended.code == 2
    words = "[actions.move_forward] is not of the skill watch; a bag has no answers to others"
    assert words in ended.err
    make_config(tmp_path)
    ended = lcorpp("robot", "--config", tmp_path / "robot.toml", "--bag", tmp_path / "none")
    assert (ended.code, "none" in ended.err) == (2, True)


class FakePeople:
    """People whose tracks grow by .5 s a look."""

    def __init__(self, label="engaged", restarts=False, leaves=False, hidden_until=0.0):
        self.seconds, self.label, self.restarts, self.leaves = 3.0, label, restarts, leaves
        self.hidden_until, self.now = hidden_until, 0.0

    def wait(self):
        self.now += 0.1
        return True

    def list_people(self):
        self.seconds += 0.5
        if self.restarts and self.seconds == 4.0:
            self.seconds = 0.0
        return {} if self.leaves and self.seconds > 4 else {"ann": self.seconds}

    def classify(self, person, sense):
        assert (person, sense) == ("ann", "gaze")
        return self.label if self.seconds >= self.hidden_until else None


def watch(people, timeout=10.0):
    return Watch("gaze", 2.0, LABEL_OF).run(Body(None, None, "ann", people=people), timeout)


def test_watching_ends_with_the_label_of_the_sense():
    people = FakePeople()
    assert watch(people) == "rests"
    assert people.seconds == 5.5  # two seconds after the first look
    people = FakePeople("not_engaged", restarts=True)
    assert watch(people) == "wanders"
    assert people.seconds == 2.0  # of the track that began anew
    people = FakePeople(hidden_until=9.0)
    assert watch(people) == "rests"
    assert people.seconds == 9.0  # the first label after a face was turned away


def test_watching_fails_if_the_person_leaves_or_nothing_comes():
    with pytest.raises(PersonLeftError, match="the person ann is no longer detected"):
        watch(FakePeople(leaves=True))
    words = r"gaze has no label of ann, who was watched for 0\.0 s of 2 s, within 0 s"
    with pytest.raises(ActionFailedError, match=words):
        watch(type("Still", (FakePeople,), {"list_people": lambda self: {"ann": 3.0}})(), timeout=0)
    with pytest.raises(ActionFailedError, match="there are no classifiers"):
        watch(None)


def test_a_label_of_a_face_that_is_no_longer_seen_does_not_count(parts):
    """After a second without the face, of a person whom the tracker still sees."""
    _, classifiers = parts
    tracks = PeopleTracks(classifiers, windows={"motion": 2.0, "gaze": 2.0}, max_silence=60.0)
    gaze = {"gaze_angle": 0.3, "robot_angle": 0.1, "face_distance": 1.2}
    for k in range(150):
        tracks.add([Sample(k / 30, "ann", 1.0, 0.0, gaze if k < 90 else {})])
        known = tracks.classify("ann", "gaze") is not None
        assert known == (2.0 <= k / 30 < 4.0)
    assert tracks.classify("ann", "motion") is not None


def test_a_tracker_without_faces_cannot_be_watched(tmp_path):
    file = tmp_path / "robot.toml"
    text = BASE.format(url="ws://localhost:1", place="desk", frame="base_link", seconds=2)
    file.write_text(text.replace("tf2_msgs/TFMessage", "people_msgs/People"))
    words = "people_msgs/People has no faces, which the sense gaze needs; expected tf2_msgs/TFMessage"
    with pytest.raises(DomainError, match=words):
        read_robot_config(file)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('sense = "gaze"', 'sense = "voice"'), "no sense 'voice'; expected one of motion, gaze"),
        (('sense = "gaze"', 'sense = "motion"'), "'keeps_still' is a label of motion, and no observation"),
        (("seconds = 2.0", "seconds = 0"), "seconds: expected a number from 0.1 to 3600.0, not 0"),
    ],
)
def test_what_cannot_be_watched_is_refused(tmp_path, change, words):
    file = tmp_path / "robot.toml"
    text = BASE.format(url="ws://localhost:1", place="desk", frame="base_link", seconds=2)
    file.write_text(text.replace(*change))
    with pytest.raises(DomainError) as error:
        read_robot_config(file)
    assert words in str(error.value), json.dumps(str(error.value))
