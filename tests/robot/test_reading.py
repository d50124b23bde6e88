"""A robot.toml is read as values; each mistake is an error that names line, key and what was expected."""

import pytest

from lcorpp.errors import DomainError, FileError, ParseError
from lcorpp.robot.config import AFTER
from lcorpp.robot.facts import ClockFact, FixedFact
from lcorpp.robot.reading import read_robot_config
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.skills import CallAction, CallService, Drive, Navigate, Say, Turn
from tests.worlds.ros.stand_in import EXAMPLES, robot_toml

URL = "ws://127.0.0.1:9"


def read(folder, **changes):
    file = folder / "robot.toml"
    file.write_text(robot_toml(URL, **changes))
    return read_robot_config(file)


def test_the_configuration_of_the_stand_in(folder):
    config, domain = read(folder)
    assert (config.domain, config.strategy, config.value) == ("intention", "LCORPP", "interested")
    assert config.connection.url == URL
    assert config.pose == ("/pose", "geometry_msgs/PoseStamped")
    assert config.people.tracker.topic == ("/people", "people_msgs/People")
    assert config.answers.utterances["neg"] == ("no thank you",)
    assert config.facts["location"] == FixedFact("classroom")
    behaviours = config.behaviours
    assert behaviours["move_forward"].skill == Navigate("/navigate_to_pose", "nav2_msgs/NavigateToPose")
    assert behaviours["greet"].skill == Say("Hello!", "/say", "std_msgs/String", 0.1)
    assert behaviours["turn"].skill == Turn()
    assert behaviours["turn"].timeout == 3.0
    assert domain.folder == folder / "heard"


def test_every_skill(folder):
    skills = {
        'skill = "drive"\nlinear = -0.2\nseconds = 1.5': Drive(-0.2, 0.0, 1.5),
        'skill = "action"\nname = "/a"\ntype = "x/A"\ngoal = {{ order = 3 }}': CallAction(
            "/a", "x/A", {"order": 3}
        ),
        'skill = "service"\nname = "/s"\ntype = "x/S"': CallService("/s", "x/S", {}),
        'skill = "navigate"\nname = "/n"\ntype = "nav2_msgs/NavigateToPose"\nto = "home"': Navigate(
            "/n", "nav2_msgs/NavigateToPose", home=True
        ),
        'skill = "listen"\nlisten = 2.0': None,
    }
    for text, skill in skills.items():
        config, _ = read(folder, turn=f"[actions.turn]\n{text}")
        assert config.behaviours["turn"].skill == skill


def test_a_fixed_pose_and_what_follows_a_decision(folder):
    after = '[after]\nskill = "navigate"\nname = "/n"\ntype = "nav2_msgs/NavigateToPose"\nto = "home"'
    config, _ = read(folder, robot="[robot]\npose = [1, 2.5, 0]", after=after)
    assert config.pose == Pose(1.0, 2.5, 0.0)
    assert config.behaviours[AFTER].skill.home


def test_the_time_of_day():
    clock = ClockFact({"morning": 6, "afternoon": 12, "evening": 18})
    hours = {5.9: "evening", 6: "morning", 11.99: "morning", 12: "afternoon", 23.9: "evening", 0: "evening"}
    assert {hour: clock.at(hour) for hour in hours} == hours


MISTAKES = [
    ({"domain": 'domain = "nowhere"'}, "nowhere: no folder with a domain.toml"),
    ({"domain": 'domain = "heard"\nstrategy = "X"'}, r"robot.toml:2: strategy: unknown strategy 'X'"),
    ({"domain": 'domain = "heard"\nvalue = "x"'}, r"value: 'x'; expected one of interested, not_interested"),
    ({"domain": 'domain = "heard"\nspeed = 3'}, r"robot.toml:2: speed: unknown key; expected one of"),
    ({"domain": 'domain = "heard"\nmax_actions = 0'}, r"max_actions: expected a whole number of at least 1"),
    (
        {"classifiers": '[classifiers]\ngaze = "x.npz"'},
        r"\[classifiers\] gaze: no sense; expected one of motion",
    ),
    ({"connection": '[connection]\nkind = "ros"'}, "kind: 'ros'; expected one of rosbridge, rospy, rclpy"),
    ({"connection": '[connection]\nkind = "rospy"\nversion = 2'}, "version: ROS 2; expected 1 for rospy"),
    ({"connection": "[connection]\nversion = 3"}, "version: ROS 3; expected 1 or 2"),
    ({"connection": '[connection]\nurl = "http://a"'}, "url: 'http://a'; expected ws://HOST:PORT"),
    ({"connection": "[connection]\ntimeout = 0"}, "timeout: expected a number from 0.1"),
    ({"robot": "[robot]\npose = [1, 2]"}, r"pose: \[1, 2\]; expected \[x, y, heading\]"),
    (
        {"robot": '[robot]\npose = {{ topic = "/a", type = "x/Y" }}'},
        "'x/Y'; expected one of nav_msgs/Odometry",
    ),
    ({"robot": "[robot]\nspeed = 1"}, r"\[robot\] speed: unknown key"),
    ({"people": ""}, "people is missing"),
    (
        {"people": '[people]\ntopic = "/p"\ntype = "x/People"'},
        "'x/People'; expected one of people_msgs/People",
    ),
    ({"answers": '[answers]\ntopic = "/s"\ntype = "x/S"'}, "'x/S'; expected one of std_msgs/String"),
    ({"people": '[people]\ntopic = "/p"\ntype = "People"'}, "type: the type 'People'; expected PACKAGE/NAME"),
    (
        {"turn": '[actions.turn]\nskill = "service"\nname = "/s"\ntype = "Say"'},
        "the type 'Say'; expected PACK",
    ),
    ({"facts": "[facts]\ntime = {{}}"}, "time: expected different hours from 0 to 24"),
    ({"facts": "[facts]\ntime = {{ morning = 6, evening = 6 }}"}, "time: expected different hours"),
    ({"robot": "[robot]\npose = [1" + 400 * "0" + ", 0, 0]"}, "an integer of 1329 bits; TOML has 64"),
    ({"connection": '[connection]\nurl = "ws://a:99999"'}, "url: 'ws://a:99999'; expected ws://HOST:PORT"),
    (
        {"connection": "[connection]\nversion = 1"},
        "type: nav2_msgs/NavigateToPose is of ROS 2; the connection",
    ),
    ({"answers": "[answers]\nmicrophone = 1"}, "microphone: expected true or false, not 1"),
    (
        {"answers": '[answers]\ntopic = "/s"\ntype = "std_msgs/String"\nmicrophone = true'},
        "expected a microphone or a topic, not both",
    ),
    (
        {"turn": '[actions.turn]\nskill = "speak"\ntext = "Hi"\nvoice = "bell"'},
        "voice: the voice 'bell': expected",
    ),
    ({"answers": '[answers]\nsilence = "nothing"'}, "silence: 'nothing'; expected one of pos, neg, none"),
    (
        {"utterances": '[answers.utterances]\nmaybe = ["well"]'},
        r"\[answers.utterances\] maybe: expected one of",
    ),
    (
        {"facts": '[facts]\nweather = "fine"'},
        r"\[facts\] weather: not observed; expected one of time, location",
    ),
    ({"facts": '[facts]\nlocation = "moon"'}, "location: 'moon'; expected one of library, classroom"),
    ({"facts": "[facts]\ntime = {{ noon = 12 }}"}, "time: 'noon'; expected one of morning"),
    ({"facts": "[facts]\ntime = {{ morning = 25 }}"}, "morning: expected a number from 0 to 24"),
    ({"turn": ""}, r"\[actions\] turn: missing; expected how to execute it"),
    ({"turn": '[actions.jump]\nskill = "turn"'}, r"\[actions\] jump: .*interaction.pomdp has no such action"),
    ({"turn": '[actions.turn]\nskill = "spin"'}, "skill: 'spin'; expected one of navigate, turn, drive"),
    (
        {"turn": '[actions.turn]\nskill = "turn"\nfailure = "x"'},
        "failure: 'x'; expected one of pos, neg, none",
    ),
    ({"turn": '[actions.turn]\nskill = "turn"\nspeed = 100'}, "speed: expected a number from 0.01 to 6.3"),
    ({"turn": '[actions.turn]\nskill = "turn"\nlinear = 1'}, r"\[actions.turn\] linear: unknown key"),
    (
        {"turn": '[actions.turn]\nskill = "action"\nname = "/a"\ntype = "x/A"\ngoal = 3'},
        "goal: 3; expected a",
    ),
    (
        {"turn": '[actions.turn]\nskill = "action"\nname = "/a"\ntype = "x/A"\ngoal = {{ t = 2026-01-01 }}'},
        "goal: Object of type date is not JSON serializable; expected numbers",
    ),
    ({"beliefs": '[beliefs]\nengagement = "/e"'}, r"engagement: '/e'; expected a topic with \{person\}"),
    (
        {"beliefs": "[beliefs]\nmin_engaging = 0.9\nmin_engaged = 0.5"},
        "min_engaged: expected a number from 0.9",
    ),
]


@pytest.mark.parametrize(("changes", "message"), MISTAKES, ids=[message[:40] for _, message in MISTAKES])
def test_a_mistake_is_located(folder, changes, message):
    with pytest.raises(DomainError, match=message):
        read(folder, **changes)


def test_silence_must_be_possible_in_the_model(folder):
    with pytest.raises(
        DomainError, match=r"silence gives the observation 'none', which is impossible after mov"
    ):
        read(folder, domain='domain = "intention"')


@pytest.mark.parametrize("name", ["robot.toml", "robot_ros1.toml"])
def test_the_examples_are_right(name):
    config, domain = read_robot_config(EXAMPLES / name)
    assert domain.preset == "heard"
    assert set(config.behaviours) == {"move_forward", "greet", "turn", AFTER}


def test_a_file_that_is_missing_or_no_toml(tmp_path):
    with pytest.raises(FileError, match=r"robot.toml: cannot be read: No such file"):
        read_robot_config(tmp_path / "robot.toml")
    (tmp_path / "robot.toml").write_text("domain = ")
    with pytest.raises(ParseError, match=r"robot.toml:1:10"):
        read_robot_config(tmp_path / "robot.toml")


def test_a_robot_keeps_the_limits_of_its_domain(folder):
    """Its draws have recorded seeds, so that it may draw; a domain without limits has nothing to keep."""
    with pytest.raises(DomainError, match=r"strategy: LCORPP\+limits: .*needs one"):
        read(folder, domain='domain = "heard"\nstrategy = "LCORPP+limits"')
    with pytest.raises(DomainError, match="random draws its actions"):
        read(folder, domain='domain = "heard"\nstrategy = "random"')
