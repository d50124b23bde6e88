"""Read the behaviours of actions from `robot.toml`: skills with their time-outs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from lcorpp.domains import Domain
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, LcorppError, WorldError, expected_one_of
from lcorpp.planning import Pomdp
from lcorpp.robot.config import AFTER
from lcorpp.worlds.ros.connection import name_type
from lcorpp.worlds.ros.ros_world import Behaviour
from lcorpp.worlds.ros.skills import (
    MOVE_BASE,
    NAVIGATION,
    SPEECH_MESSAGES,
    CallAction,
    CallService,
    Drive,
    Navigate,
    Say,
    Skill,
    Speak,
    Turn,
    Watch,
)
from lcorpp.worlds.speech import parse_voice

MAX_SECONDS, MAX_DISTANCE, MAX_SPEED, MAX_RATE = 3600.0, 100.0, 3.0, 6.3
"""Limits of durations in s, distances in m, speeds in m/s and turn rates in rad/s."""


def read_behaviours(root: TomlTable, domain: Domain, silence: str, version: int) -> dict[str, Behaviour]:
    """Read `actions` and `after`: each action of the POMDP that is not a report needs a behaviour.

    Args:
        root: of the file. silence: the observation without an answer. version: of ROS.

    Raises:
        DomainError: a key or value is wrong, an action is missing, or an observation is impossible.
    """
    table, model, behaviours = root.section("actions", required=True), domain.model, dict[str, Behaviour]()
    for name in table:
        if name not in model.actions:
            raise DomainError(
                f"{table.location(name)}: {model.file} has no such action; {expected_one_of(model.actions)}"
            )
        own = read_behaviour(table.section(name), model.observations, version)
        if isinstance(own.skill, Watch):
            own = replace(own, skill=_complete_watch(table.section(name), own.skill, domain))
        behaviours[name] = own
    for action in model.actions:
        if domain.reported_value(action) is None and action not in behaviours:
            raise DomainError(f"{table.location(action)}: missing; expected how to execute it")
    _check_possible(table, domain, behaviours, silence)
    if "after" in root:
        behaviours[AFTER] = read_behaviour(root.section("after"), model.observations, version)
    return behaviours


def _complete_watch(table: TomlTable, skill: Watch, domain: Domain) -> Watch:
    """Return the skill with the labels of its sense, which have to be observations."""
    known = [sense.name for sense in domain.senses]
    if skill.sense not in known:
        raise DomainError(f"{table.location('sense')}: no sense {skill.sense!r}; {expected_one_of(known)}")
    label_of = domain.find_sense(skill.sense).label_of
    unknown = [label for label in label_of.values() if label not in domain.model.observations]
    if unknown:
        raise DomainError(
            f"{table.location('sense')}: {unknown[0]!r} is a label of {skill.sense}, and no observation of"
            f" {domain.model.file}; {expected_one_of(domain.model.observations)}"
        )
    return replace(skill, label_of=label_of)


def _check_possible(
    table: TomlTable, domain: Domain, behaviours: Mapping[str, Behaviour], silence: str
) -> None:
    """Check that silence and failures are possible observations in the planner's model.

    What a simulated model observes is not known before it is simulated.
    """
    pomdp = domain.model
    if not isinstance(pomdp, Pomdp):
        return
    live = [s for s in range(len(pomdp.states)) if s not in domain.planning.terminal]
    for action, behaviour in behaviours.items():
        if domain.reported_value(action) is not None:
            continue
        rows = pomdp.observation.dense[pomdp.actions.index(action)][live]
        is_watching = isinstance(behaviour.skill, Watch)  # nothing is said then
        for what, name in (("silence", None if is_watching else silence), ("a failure", behaviour.failure)):
            if name is not None and not rows[:, pomdp.observations.index(name)].any():
                raise DomainError(
                    f"{table.location(action)}: {what} gives the observation {name!r}, which is impossible"
                    f" after {action} in {pomdp.file}; expected a model in which it has a positive"
                    ' probability, e.g. preset = "heard" of the intention domain, or one of `lcorpp observe`'
                )


def read_behaviour(table: TomlTable, observations: Sequence[str], version: int) -> Behaviour:
    """Read a table such as ``{ skill = "say", topic = "/say", type = "std_msgs/String", text = "Hello" }``.

    Args:
        observations: of the POMDP. version: of ROS.

    Raises:
        DomainError: a key or value is wrong.
    """
    name = table.text("skill")
    if name not in READERS:
        raise DomainError(f"{table.location('skill')}: {name!r}; {expected_one_of(READERS)}")
    skill, default = READERS[name](table), Behaviour(None)
    if isinstance(skill, Navigate) and version != (own := 1 if skill.kind == MOVE_BASE else 2):
        raise DomainError(
            f"{table.location('type')}: {skill.kind} is of ROS {own}; the connection is to ROS {version}"
        )
    failure = table.text("failure") if "failure" in table else None
    if failure is not None and failure not in observations:
        raise DomainError(f"{table.location('failure')}: {failure!r}; {expected_one_of(observations)}")
    behaviour = Behaviour(
        skill,
        table.number("timeout", 0.1, MAX_SECONDS, default.timeout),
        table.number("listen", 0, MAX_SECONDS, default.listen),
        failure,
    )
    table.reject_unknown_keys()
    return behaviour


def _read_navigate(table: TomlTable) -> Skill:
    target = table.text("to", "person")
    if target not in ("person", "home"):
        raise DomainError(f"{table.location('to')}: {target!r}; expected one of person, home")
    kind = _read_kind(table, NAVIGATION, "action")
    if target == "home":
        return Navigate(table.text("name"), kind, home=True)
    return Navigate(
        table.text("name"),
        kind,
        table.number("distance", 0, MAX_DISTANCE, Navigate.distance),
        table.number("min_distance", 0, MAX_DISTANCE, Navigate.min_distance),
    )


def _read_turn(table: TomlTable) -> Skill:
    return Turn(table.number("speed", 0.01, MAX_RATE, Turn.speed))


def _read_drive(table: TomlTable) -> Skill:
    return Drive(
        table.number("linear", -MAX_SPEED, MAX_SPEED, 0.0),
        table.number("angular", -MAX_RATE, MAX_RATE, 0.0),
        table.number("seconds", 0, MAX_SECONDS),
    )


def _read_say(table: TomlTable) -> Skill:
    seconds = table.number("seconds", 0, MAX_SECONDS) if "seconds" in table else None
    kind = _read_kind(table, SPEECH_MESSAGES, "msg")
    return Say(table.text("text"), table.text("topic"), kind, seconds)


def _read_speak(table: TomlTable) -> Skill:
    try:
        return Speak(table.text("text"), parse_voice(table.text("voice")))
    except LcorppError as error:
        raise DomainError(f"{table.location('voice')}: {error}") from None


def _read_watch(table: TomlTable) -> Skill:
    return Watch(table.text("sense"), table.number("seconds", 0.1, MAX_SECONDS))


def _read_action(table: TomlTable) -> Skill:
    return CallAction(table.text("name"), read_type(table, "action"), _read_message(table, "goal"))


def _read_service(table: TomlTable) -> Skill:
    return CallService(table.text("name"), read_type(table, "srv"), _read_message(table, "request"))


def _read_nothing(table: TomlTable) -> None:
    """A robot that only listens."""


READERS: Mapping[str, Callable[[TomlTable], Skill | None]] = {
    "navigate": _read_navigate,
    "turn": _read_turn,
    "drive": _read_drive,
    "say": _read_say,
    "speak": _read_speak,
    "watch": _read_watch,
    "action": _read_action,
    "service": _read_service,
    "listen": _read_nothing,
}
"""Name of a skill -> its reader."""


def read_type(table: TomlTable, folder: str) -> str:
    """Read `type` as ROS 1 writes it. folder: "msg", "srv" or "action".

    Raises:
        DomainError: it is missing, or no name of a type.
    """
    try:
        return name_type(table.text("type"), 1, folder)
    except WorldError as error:
        raise DomainError(f"{table.location('type')}: {error}") from None


def _read_kind(table: TomlTable, kinds: Mapping[str, Any], folder: str) -> str:
    kind = read_type(table, folder)
    if kind not in kinds:
        raise DomainError(f"{table.location('type')}: {table.text('type')!r}; {expected_one_of(kinds)}")
    return kind


def _read_message(table: TomlTable, key: str) -> dict[str, Any]:
    """Read a message: a table of numbers, texts, lists and tables."""
    if key not in table:
        return {}
    value = table.value(key)
    if not isinstance(value, dict):
        raise DomainError(f"{table.location(key)}: {value!r}; expected a table of the fields")
    try:
        content: dict[str, Any] = json.loads(json.dumps(value, allow_nan=False))
    except (TypeError, ValueError) as error:  # TOML has dates, infinite numbers and NaN
        raise DomainError(
            f"{table.location(key)}: {error}; expected numbers, texts, lists and tables"
        ) from None
    return content
