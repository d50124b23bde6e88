"""Replay of logged decisions: whether the same parts decide the same, step by step."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.assembly.logged_parts import (
    list_changed_files,
    list_changed_policy,
    list_changed_sources,
    load_logged_domain,
    read_parts,
)
from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.assembly.strategies.baselines import read_strategy
from lcorpp.decision import Robot, Strategy
from lcorpp.decision.dt_control import act_until_report, infer_prior
from lcorpp.decision.strategies import Session, make_generator
from lcorpp.domains import Domain
from lcorpp.errors import DataError, DecisionError, LcorppError
from lcorpp.logs.decision_log import DAMAGE, LoggedDecision, describe_damage, read_log
from lcorpp.simulation.simulated_classifier import PrecomputedLabel
from lcorpp.values import Array, Distribution, Episode, Label, Likelihood, Step, format_value
from lcorpp.worlds.scripted import EndOfStepsError, RepeatedWorld

TOLERANCE = 1e-9
"""Largest difference of two probabilities that count as equal: another processor may round otherwise."""


@dataclass(frozen=True)
class ChangedPart:
    """A part that is no longer the one of the log.

    line: the first one of the log with the earlier part. what: the part and its file.
    """

    line: int
    what: str


@dataclass(frozen=True, eq=False)
class ReplayedDecision:
    """A logged decision that was made again.

    line: in the log, counted from 1. strategy: its name. episode: the decision in the log.
    differences: what differs, () if the same parts decide the same.
    """

    line: int
    strategy: str
    episode: Episode
    differences: tuple[str, ...]


def replay_log(
    path: Path, folder: Path | None = None, *, cache: Path | None = None
) -> Iterator[ReplayedDecision | ChangedPart | DataError]:
    """Make each decision of a log again; a line that cannot be replayed becomes an error with its place.

    Parts that have changed come before the first decision that they concern. The robot gets the facts and
    labels of the log, and after each of its actions the observation of the log. A strategy that
    learns from earlier people learns from the decisions as they are in the log, in their order.

    Args:
        path: of the log. folder: of the domain, if it is not the one of the log.
        cache: a folder that keeps policies.

    Raises:
        FileError: the log cannot be read.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import LCORPP
        >>> from lcorpp.logs import DecisionLog, replay_log
        >>> robot = load_robot("intention", cache=False)
        >>> with DecisionLog(Path("replayed.jsonl")) as log:
        ...     log.append(robot.parts, LCORPP, {}, robot.decide({}, label="zero", world=3 * ["pos"]))
        >>> [(again.episode.report, again.differences) for again in replay_log(Path("replayed.jsonl"))]
        [('interested', ())]
    """
    known = KnownParts(folder, cache)
    for line in read_log(path):
        if isinstance(line, DataError):
            yield line
            continue
        result: ReplayedDecision | DataError
        try:
            parts = known.find(line.content["parts"])
            episode = line.read_episode(parts.domain)
            strategy = known.find_strategy(line.strategy, parts.domain)
            with strategy.locate_failures():
                session = known.find_session(parts, strategy, line.strategy.get("person"))
                who = line.strategy.get("person_id")
                seed = line.strategy.get("seed")
                robot = make_logged_robot(parts, strategy, episode.labels, seed, session=session, person=who)
                differences = compare(episode, robot, line)
                if session is not None:
                    session.learn(episode.evidence, episode.steps, who)
            result = ReplayedDecision(line.line, strategy.name, episode, tuple(differences))
        except DAMAGE as error:
            result = DataError(f"{path}:{line.line}: cannot be replayed: {describe_damage(error)}")
        for what in known.take_changes():
            yield ChangedPart(line.line, what)
        yield result


class KnownParts:
    """Parts and strategies that were set up for earlier lines, and what has changed since the log."""

    def __init__(self, folder: Path | None, cache: Path | None) -> None:
        """folder: of the domain, None for the one of the log. cache: a folder that keeps policies."""
        self._folder, self._cache = folder, cache
        self._parts: dict[str, RobotParts | Exception] = {}
        self._strategies: dict[str, Strategy] = {}
        # the latest session of each strategy that learns from earlier people, and its parts
        self._sessions: dict[str, tuple[Session, RobotParts]] = {}
        self._known_changes: set[str] = set()
        self._new_changes: list[str] = []  # those that `take_changes` has not returned yet

    def find(self, description: Any) -> RobotParts:
        """Return the parts of a description.

        Raises:
            DAMAGE: as `read_parts`, each time.
        """
        key = json.dumps(description)
        if key not in self._parts:
            self._parts[key] = self._read(description)
        known = self._parts[key]
        if isinstance(known, Exception):
            raise known.with_traceback(None)
        return known

    def _read(self, description: Any) -> RobotParts | Exception:
        try:
            domain = load_logged_domain(description, self._folder)
            files = list_changed_files(domain, description)
            classifiers = {f"classifier of {n}": own for n, own in description["classifiers"].items()}
            self._note([*files, *list_changed_sources(classifiers)])
            parts = read_parts(description, domain, cache=self._cache)
            if not files:  # otherwise the policy changes with them
                self._note(list_changed_policy(parts, description))
        except DAMAGE as error:
            return error
        return parts

    def _note(self, changes: list[str]) -> None:
        self._new_changes += [what for what in changes if what not in self._known_changes]
        self._known_changes.update(changes)

    def take_changes(self) -> list[str]:
        """Return the changes that were not returned before."""
        new, self._new_changes = self._new_changes, []
        return new

    def find_strategy(self, description: Any, domain: Domain) -> Strategy:
        """Return a strategy.

        Raises:
            DAMAGE: as `read_strategy`.
        """
        own = [description.get("source"), description["name"], description.get("ask_budget")]
        key = json.dumps([*own, str(domain.folder)])
        if key not in self._strategies:
            self._note(list_changed_sources({f"strategy {description['name']}": description}))
            self._strategies[key] = read_strategy(description, domain)
        return self._strategies[key]

    def find_session(self, parts: RobotParts, strategy: Strategy, person: Any) -> Session | None:
        """Return the session of a strategy that learns from earlier people; None for another strategy.

        If the parts changed since the person before, the classifiers were trained again.

        Args:
            person: number of people before this one; 0 starts a session.

        Raises:
            DAMAGE: an earlier person of the session is missing.
        """
        if strategy.start is None:
            return None
        if person == 0:
            self._sessions[strategy.name] = strategy.start(parts.robot, parts.rates), parts
        session, former = self._sessions.get(strategy.name, (None, parts))
        before = 0 if session is None else session.n_people
        if session is None or person != before:
            raise DecisionError(
                f"{strategy.location} has learnt from {before} people, and the line is after {person!r}:"
                " decisions before it are missing"
            )
        if parts is not former:
            session.retrain(parts.robot, parts.rates)
            self._sessions[strategy.name] = session, parts
        return session


def make_logged_robot(
    parts: RobotParts,
    strategy: Strategy,
    labels: Mapping[str, Label],
    seed: Sequence[int] | None,
    *,
    session: Session | None = None,
    person: str | None = None,
) -> Robot:
    """Return the robot of one decision, whose classifiers return the labels of the log.

    Args:
        person: id of the person, see `Session.robot`.
    """
    classifiers = {name: PrecomputedLabel(label) for name, label in labels.items()}
    if session is not None:
        return session.robot(replace(parts.robot, classifiers=classifiers), person)
    rng = make_generator(*seed) if strategy.draws and seed is not None else None
    return strategy.robot(replace(parts.robot, classifiers=classifiers), rng)


def compare(logged: Episode, robot: Robot, decision: LoggedDecision) -> list[str]:
    """Decide again and return what differs from the log.

    Args:
        logged: the episode of `decision`. robot: the robot with the logged labels.
    """
    steps, other = list[Step](), None
    try:
        evidence, marginal, prior = infer_prior(robot, decision.context, logged.labels)
    except LcorppError as error:
        return [f"evidence: {error}"]
    differences = _compare_evidence(logged.evidence, evidence)
    differences += _compare_marginals(logged.marginal, marginal)
    differences += _compare_beliefs("prior", logged.prior, prior)
    report = None
    world = RepeatedWorld((step.action, step.observation) for step in logged.steps)
    try:
        _, report, _ = act_until_report(robot, prior, world, listener=steps.append)
    except EndOfStepsError:
        other = world.action
    except LcorppError as error:
        return [*differences, f"action {len(steps) + 1}: {error}"]
    for number, (old, new) in enumerate(zip(logged.steps, steps, strict=False), 1):
        if old.action != new.action:
            differences.append(f"action {number}: {old.action} in the log, {new.action} now")
        differences += _compare_beliefs(f"belief {number}", old.belief, new.belief)
    if other is not None:
        old_action = logged.steps[len(steps)].action if len(steps) < len(logged.steps) else "none"
        return [*differences, f"action {len(steps) + 1}: {old_action} in the log, {other} now"]
    if len(steps) < len(logged.steps):
        differences.append(f"actions: {len(logged.steps)} in the log, {len(steps)} now")
    if report != logged.report:
        old_report, new_report = ("none" if r is None else format_value(r) for r in (logged.report, report))
        differences.append(f"report: {old_report} in the log, {new_report} now")
    return differences


def _compare_evidence(logged: Mapping[str, Label], now: Mapping[str, Label]) -> list[str]:
    names = dict.fromkeys([*logged, *now])
    return [
        f"evidence {name}: {logged.get(name, 'none')} in the log, {now.get(name, 'none')} now"
        for name in names
        if not _are_equal(logged.get(name), now.get(name))
    ]


def _are_equal(one: Label | None, other: Label | None) -> bool:
    if isinstance(one, Likelihood) and isinstance(other, Likelihood):
        first, second = dict(one), dict(other)
        return first.keys() == second.keys() and all(abs(first[v] - second[v]) <= TOLERANCE for v in first)
    return not isinstance(one, Likelihood) and one == other


def _compare_marginals(logged: Distribution | None, now: Distribution | None) -> list[str]:
    if logged is None or now is None:
        return [] if logged is now else [f"marginal: {logged or 'none'} in the log, {now or 'none'} now"]
    old, new = dict(logged), dict(now)
    return [
        f"marginal of {format_value(value)}: {old.get(value, 0):.6g} in the log, {new.get(value, 0):.6g} now"
        for value in dict.fromkeys([*old, *new])
        if not abs(old.get(value, 0) - new.get(value, 0)) <= TOLERANCE
    ]


def _compare_beliefs(what: str, logged: Array, now: Array) -> list[str]:
    """Return the largest difference of two beliefs (S,), if it counts."""
    gap = np.abs(logged - now)
    state = int(np.argmax(gap))
    if gap[state] <= TOLERANCE:
        return []
    return [f"{what}: differs by {gap[state]:.3g} ({logged[state]:.6g} in the log, {now[state]:.6g} now)"]
