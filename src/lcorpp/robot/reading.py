"""Read `robot.toml` and check it against its domain, before anything moves."""

from __future__ import annotations

import reprlib
from collections.abc import Collection, Mapping
from math import isfinite, pi
from pathlib import Path
from urllib.parse import urlsplit

from lcorpp.assembly.strategies.baselines import find_strategies
from lcorpp.assembly.strategies.limits import keeps_limits, require_limits
from lcorpp.assembly.strategies.trust import check_dialogue
from lcorpp.domains import Domain, load_domain
from lcorpp.domains.toml import TomlTable, read_toml
from lcorpp.errors import DomainError, LcorppError, WorldError, expected_one_of
from lcorpp.robot.behaviours import read_behaviours, read_type
from lcorpp.robot.config import (
    CONNECTIONS,
    AnswersConfig,
    ConnectionConfig,
    PeopleConfig,
    RobotConfig,
    Topic,
    TrackerConfig,
)
from lcorpp.robot.facts import ClockFact, Fact, FixedFact, PlaceFact, Polygon, TopicFact, measure_area
from lcorpp.values import GAZE_CHANNELS, SharedValue
from lcorpp.worlds.ros.belief_messages import BeliefTopics
from lcorpp.worlds.ros.initial_pose import LOCALISATIONS, InitialPose
from lcorpp.worlds.ros.people.laser_scan import LASER
from lcorpp.worlds.ros.perception import Frames
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.ros_world import Behaviour
from lcorpp.worlds.ros.sensor_messages import PEOPLE, POSES, TEXTS
from lcorpp.worlds.ros.skills import Watch
from lcorpp.worlds.ros.transforms import TRANSFORMS

MAX_SECONDS = 3600.0
"""Maximum of time-outs and durations."""

MIN_SILENCE = 1.0
"""Minimum of `max_silence`: shorter gaps are those of a tracker."""

MAX_ACTIONS = 20
"""Default of `max_actions`."""


def read_robot_config(
    file: Path, *, initial_pose: tuple[float, float, float] | None = None
) -> tuple[RobotConfig, Domain]:
    """Read a `robot.toml` and its domain.

    A relative folder of a domain, or file of a classifier, is relative to the file.

    Args:
        initial_pose: x, y and heading, instead of that of the file.

    Raises:
        FileError, ParseError: a file cannot be read or is not TOML.
        DomainError: a value is wrong or does not fit the domain; the message names line and key.
    """
    table = read_toml(file)
    name = table.text("domain", "intention")
    folder = file.parent / name
    preset = table.text("preset") if "preset" in table else None
    domain = load_domain(folder if (folder / "domain.toml").is_file() else name, preset=preset)
    strategy, value = _read_strategy(table, domain), _read_value(table, domain)
    max_actions = table.count("max_actions", 1, MAX_ACTIONS)
    classifiers = _read_classifiers(table.section("classifiers"), domain, file.parent)
    connection = _read_connection(table.section("connection"))
    robot = table.section("robot")
    people_table = table.section("people", required=True)
    frames = Frames(
        robot.text("fixed_frame", Frames.fixed),
        robot.text("frame", Frames.robot),
        people_table.number("training_heading", -2 * pi, 2 * pi, Frames.training_heading),
    )
    pose = _read_pose(robot)
    start = _read_initial_pose(robot, pose, initial_pose)
    cmd_vel = robot.text("cmd_vel", "/cmd_vel")
    robot.reject_unknown_keys()
    people = _read_people(people_table, domain)
    answers = _read_answers(table.section("answers"), domain)
    facts = _read_facts(table.section("facts"), domain)
    behaviours = read_behaviours(table, domain, answers.silence, connection.version)
    _check_watched(behaviours, people, people_table, domain)
    beliefs = _read_beliefs(table.section("beliefs"), value) if "beliefs" in table else None
    table.reject_unknown_keys()
    return (
        RobotConfig(
            file=file,
            domain=domain.name,
            preset=domain.preset,
            strategy=strategy,
            classifiers=classifiers,
            value=value,
            max_actions=max_actions,
            connection=connection,
            frames=frames,
            pose=pose,
            initial_pose=start,
            cmd_vel=cmd_vel,
            people=people,
            answers=answers,
            facts=facts,
            behaviours=behaviours,
            beliefs=beliefs,
        ),
        domain,
    )


def read_topic(table: TomlTable, kinds: Collection[str]) -> Topic:
    """Read `topic` and `type`; the type is one of `kinds`, written as in ROS 1 or 2.

    Raises:
        DomainError: a key is missing, or the type is unknown.
    """
    topic, kind = table.text("topic"), read_type(table, "msg")
    if kind not in kinds:
        raise DomainError(f"{table.location('type')}: {table.text('type')!r}; {expected_one_of(kinds)}")
    return topic, kind


def _read_strategy(table: TomlTable, domain: Domain) -> str:
    name = table.text("strategy", "LCORPP")
    try:
        (found,) = find_strategies([name], [sense.name for sense in domain.senses])
    except (LcorppError, ValueError) as error:
        raise DomainError(f"{table.location('strategy')}: {error}") from None
    if found.draws and not keeps_limits(found):
        raise DomainError(
            f"{table.location('strategy')}: {name} draws its actions; expected one that decides"
        )
    try:
        check_dialogue(domain, [found])
        require_limits(domain, [found])
    except DomainError as error:
        raise DomainError(f"{table.location('strategy')}: {name}: {error}") from None
    return found.name if found.own is None else name


def _read_classifiers(table: TomlTable, domain: Domain, folder: Path) -> dict[str, Path]:
    files = {}
    for name in table:
        try:
            domain.find_sense(name)
        except DomainError:
            known = [sense.name for sense in domain.senses]
            raise DomainError(f"{table.location(name)}: no sense; {expected_one_of(known)}") from None
        files[name] = folder / table.text(name)
    return files


def _read_connection(table: TomlTable) -> ConnectionConfig:
    default = ConnectionConfig()
    kind = table.text("kind", default.kind)
    if kind not in CONNECTIONS:
        raise DomainError(f"{table.location('kind')}: {kind!r}; {expected_one_of(CONNECTIONS)}")
    own = {"rospy": 1, "rclpy": 2}.get(kind)
    version = table.count("version", 1, own or default.version)
    if version > 2 or (own is not None and version != own):
        expected = f"{own} for {kind}" if own else "1 or 2"
        raise DomainError(f"{table.location('version')}: ROS {version}; expected {expected}")
    url = table.text("url", default.url)
    if not _is_address(url):
        raise DomainError(f"{table.location('url')}: {url!r}; expected ws://HOST:PORT")
    config = ConnectionConfig(
        kind,
        version,
        url,
        table.number("timeout", 0.1, MAX_SECONDS, default.timeout),
        table.number("max_outage", 0, MAX_SECONDS, default.max_outage),
    )
    table.reject_unknown_keys()
    return config


def _is_address(url: str) -> bool:
    try:
        parts = urlsplit(url)
        return parts.scheme in ("ws", "wss") and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:  # e.g. a port above 65535
        return False


def _read_pose(robot: TomlTable) -> Topic | Pose:
    """Read `pose`: three numbers, or a table with topic and type."""
    value = robot.value("pose") if "pose" in robot else [0.0, 0.0, 0.0]
    if isinstance(value, dict):
        table = robot.section("pose")
        topic = read_topic(table, POSES)
        table.reject_unknown_keys()
        return topic
    return _read_numbers(robot, "pose", value, ", or { topic = ..., type = ... } of the localisation")


def _read_initial_pose(
    robot: TomlTable, pose: Topic | Pose, given: tuple[float, float, float] | None
) -> InitialPose | None:
    """Read `initial_pose`, three numbers, unless it is given, and `initial_pose_topic`."""
    topic = robot.text("initial_pose_topic", InitialPose.topic)
    value = robot.value("initial_pose") if "initial_pose" in robot else None
    value = value if given is None else list(given)
    if value is None:
        return None
    location = robot.location("initial_pose") if given is None else "--pose"
    if isinstance(pose, Pose) or pose[1] not in LOCALISATIONS:
        found = "a robot that stays" if isinstance(pose, Pose) else pose[1]
        raise DomainError(
            f"{location}: is for a localisation, and `pose` is that of {found};"
            f" {expected_one_of(LOCALISATIONS)}"
        )
    return InitialPose(_read_numbers(robot, "initial_pose", value), topic)


def _read_numbers(table: TomlTable, key: str, value: object, otherwise: str = "") -> Pose:
    """Return the pose of three numbers."""
    if not isinstance(value, list) or len(value) != 3 or not all(type(v) in (int, float) for v in value):
        expected = f"expected [x, y, heading] in metres and radians{otherwise}"
        raise DomainError(f"{table.location(key)}: {value!r}; {expected}")
    try:
        return Pose(*map(float, value))
    except (OverflowError, WorldError) as error:
        raise DomainError(f"{table.location(key)}: {error}") from None


def _read_people(table: TomlTable, domain: Domain) -> PeopleConfig:
    default = PeopleConfig(TrackerConfig(("", "")))
    config = PeopleConfig(
        _read_tracker(table),
        _read_own_trackers(table.section("senses"), domain),
        table.number("decide_after", 0.1, MAX_SECONDS, default.decide_after),
        table.number("max_silence", MIN_SILENCE, MAX_SECONDS, default.max_silence),
        table.flag("permanent_ids", default.permanent_ids),
    )
    table.reject_unknown_keys()
    return config


def _check_watched(
    behaviours: Mapping[str, Behaviour], people: PeopleConfig, table: TomlTable, domain: Domain
) -> None:
    """Check that the tracker of a sense that is watched measures its channels: only frames have faces."""
    for behaviour in behaviours.values():
        if isinstance(behaviour.skill, Watch):
            sense = domain.find_sense(behaviour.skill.sense)
            kind = people.senses.get(sense.name, people.tracker).topic[1]
            if kind != TRANSFORMS and set(sense.channels) & {*GAZE_CHANNELS}:
                raise DomainError(
                    f"{table.location('type')}: {kind} has no faces, which the sense {sense.name} needs;"
                    f" expected {TRANSFORMS}"
                )


def _read_tracker(table: TomlTable) -> TrackerConfig:
    """Read topic and type of a tracker or laser scanner, and what belongs to it."""
    topic, default = read_topic(table, (*PEOPLE, TRANSFORMS, LASER)), TrackerConfig(("", ""))
    classes, mounting, head_frame = default.classes, default.mounting, default.head_frame
    if "classes" in table:
        if topic[1] == LASER:
            raise DomainError(f"{table.location('classes')}: is for detections; {LASER} has none")
        classes = tuple(name.lower() for name in table.names("classes"))
    if "mounting" in table:
        if topic[1] != LASER:
            raise DomainError(f"{table.location('mounting')}: is for {LASER}; {topic[1]} has frames")
        mounting = _read_numbers(table, "mounting", table.value("mounting"))
    if "head_frame" in table:
        if topic[1] != TRANSFORMS:
            raise DomainError(f"{table.location('head_frame')}: is for {TRANSFORMS}; {topic[1]} has no faces")
        head_frame = table.text("head_frame")
    return TrackerConfig(topic, classes, mounting, head_frame)


def _read_own_trackers(table: TomlTable, domain: Domain) -> dict[str, TrackerConfig]:
    """Read `senses`: the sense of each table has a tracker of its own."""
    trackers = {}
    for name in table:
        if name not in (known := [sense.name for sense in domain.senses]):
            raise DomainError(f"{table.location(name)}: no sense; {expected_one_of(known)}")
        trackers[name] = _read_tracker(own := table.section(name))
        own.reject_unknown_keys()
    return trackers


def _read_answers(table: TomlTable, domain: Domain) -> AnswersConfig:
    observations = domain.model.observations
    if not observations:
        raise DomainError(
            f"{domain.model.file}: observes numbers, and no answer of a person is one; expected observations"
            " with names"
        )
    silence = table.text("silence", "none")
    if silence not in observations:
        raise DomainError(f"{table.location('silence')}: {silence!r}; {expected_one_of(observations)}")
    topic = read_topic(table, TEXTS) if "topic" in table else None
    microphone = table.flag("microphone", False)
    if microphone and topic is not None:
        raise DomainError(f"{table.location('microphone')}: expected a microphone or a topic, not both")
    utterances = dict(domain.planning.utterances)
    if "utterances" in table:
        section = table.section("utterances")
        for name in section:
            if name not in observations:
                raise DomainError(f"{section.location(name)}: {expected_one_of(observations)}")
            utterances[name] = section.names(name)
    table.reject_unknown_keys()
    return AnswersConfig(topic, microphone, silence, utterances)


def _read_facts(table: TomlTable, domain: Domain) -> dict[str, Fact]:
    facts: dict[str, Fact] = {}
    for name in table:
        allowed = domain.reasoning.observed_values.get(name)
        if allowed is None:
            raise DomainError(f"{table.location(name)}: not observed; {expected_one_of(domain.observed)}")
        if table.is_text(name):
            facts[name] = FixedFact(table.text(name))
        else:
            part = table.section(name)
            if "topic" in part:
                facts[name] = TopicFact(part.text("topic"), tuple(allowed))
                part.reject_unknown_keys()
            elif tuple(part) and all(part.is_list(value) for value in part):
                facts[name] = PlaceFact({value: _read_polygons(part, value) for value in part})
            else:
                hours = {value: part.number(value, 0, 24) for value in part}
                if len(set(hours.values())) < max(1, len(hours)):
                    raise DomainError(f"{table.location(name)}: expected different hours from 0 to 24")
                facts[name] = ClockFact(hours)
        for value in facts[name].values:
            if value not in allowed:
                raise DomainError(f"{table.location(name)}: {value!r}; {expected_one_of(allowed)}")
    return facts


def _read_polygons(table: TomlTable, value: str) -> list[Polygon]:
    """Read the area of a value: a polygon, [[x, y], ...], or a list of several."""
    given, location = table.value(value), table.location(value)
    several = given if _depth(given) == 3 else [given]
    polygons = list[Polygon]()
    for corners in several:
        is_polygon = isinstance(corners, list) and len(corners) >= 3
        is_polygon = is_polygon and all(isinstance(c, list) and len(c) == 2 for c in corners)
        if not is_polygon or not all(type(n) in (int, float) and isfinite(n) for c in corners for n in c):
            raise DomainError(
                f"{location}: {reprlib.repr(given)}; expected a polygon [[x, y], [x, y], [x, y], ...] in"
                " metres of the fixed frame, or a list of polygons"
            )
        polygon = tuple((float(x), float(y)) for x, y in corners)
        if not measure_area(polygon):
            raise DomainError(
                f"{location}: {reprlib.repr(corners)}; expected three corners that are not in line"
            )
        polygons.append(polygon)
    return polygons


def _depth(value: object) -> int:
    """Return how deeply a list contains lists, by its first elements."""
    return 1 + _depth(value[0] if value else None) if isinstance(value, list) else 0


def _read_value(table: TomlTable, domain: Domain) -> SharedValue:
    """Read `value`, by default the domain's positive class."""
    names = {str(value): value for value in domain.values}
    value = table.text("value", domain.positive or next(iter(names)))
    if value not in names:
        raise DomainError(f"{table.location('value')}: {value!r}; {expected_one_of(names)}")
    return names[value]


def _read_beliefs(table: TomlTable, value: SharedValue) -> BeliefTopics:
    """Read `beliefs`: the topics to which the belief is published."""
    topics = {key: table.text(key) if key in table else None for key in ("intent", "engagement", "state")}
    engagement = topics["engagement"]
    if engagement is not None and "{person}" not in engagement:
        raise DomainError(
            f"{table.location('engagement')}: {engagement!r}; expected a topic with {{person}},"
            " e.g. /humans/persons/{person}/engagement_status"
        )
    low = table.number("min_engaging", 0, 1, BeliefTopics.min_engaging)
    high = table.number("min_engaged", low, 1, max(low, BeliefTopics.min_engaged))
    table.reject_unknown_keys()
    return BeliefTopics(value, **topics, min_engaging=low, min_engaged=high)
