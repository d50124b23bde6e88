"""Points of decisions: the robot's action after each sequence of observations, once for all people."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from lcorpp.decision import Robot, Strategy
from lcorpp.decision.dt_control import act_until_report
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, expected_one_of
from lcorpp.planning import Planner
from lcorpp.scoring.part_state import DIGITS, NoKeyError, make_state_key
from lcorpp.simulation.simulated_classifier import NoisyChannel
from lcorpp.values import Array, Instance, Label, Step
from lcorpp.worlds.scripted import EndOfStepsError, RepeatedWorld

MAX_ACTIONS = 100_000
"""Maximum number of actions in all histories of an own strategy; each history is decided anew."""


class DecisionNodes(Protocol):
    """The points of decisions at which a robot acts; equal nodes are merged.

    n_numbers: numbers that are multiplied to find an action, those in alpha vectors.
    """

    n_numbers: int

    def root(self, context: Mapping[str, str], labels: Mapping[str, Any]) -> Hashable:
        """Return the node before the first action, given the facts and the output of each sense."""

    def find_actions(self, nodes: Sequence[Any], /) -> list[str | None]:
        """Return the robot's action at each node; None where the decision has ended without a report."""

    def extend(
        self, nodes: Sequence[Any], actions: Sequence[str], observations: Sequence[str], /
    ) -> Sequence[Hashable]:
        """Return the node after an action at each of n nodes, and the observation there."""

    def describe(self, node: Any, /) -> str:
        """Return a node before the first action in words, for messages."""


class BeliefNodes:
    """The nodes of a robot whose action depends on the belief alone: beliefs (S,), as bytes."""

    def __init__(self, domain: Domain, robot: Robot) -> None:
        self._domain, self._robot = domain, robot
        planner = robot.planner
        sets = planner.policy.vector_sets if isinstance(planner, Planner) else ()
        self.n_numbers = sum(part.vectors.size for part in sets)

    def root(self, context: Mapping[str, str], labels: Mapping[str, Label]) -> bytes:
        marginal = self._robot.reasoner.posterior(self._domain.shared, self._domain.evidence(context, labels))
        return (self._robot.planner.start if marginal is None else self._domain.prior(marginal)).tobytes()

    def describe(self, node: bytes) -> str:
        return f"the prior {self._domain.marginal(np.frombuffer(node))}"

    def find_actions(self, nodes: Sequence[bytes]) -> list[str | None]:
        is_terminal, act = self._domain.is_terminal, self._robot.planner.action
        return [None if is_terminal(belief) else act(belief) for belief in map(np.frombuffer, nodes)]

    def extend(
        self, nodes: Sequence[bytes], actions: Sequence[str], observations: Sequence[str]
    ) -> list[bytes]:
        after = map(self._robot.planner.update, map(np.frombuffer, nodes), actions, observations)
        return [belief.tobytes() for belief in after]


class RoundedBeliefNodes(BeliefNodes):
    """The same with beliefs rounded after each observation, which merges those that different paths reach.

    A planner with a policy acts at all beliefs at once.
    """

    def find_actions(self, nodes: Sequence[bytes]) -> list[str | None]:
        planner = self._robot.planner
        if not isinstance(planner, Planner):
            return super().find_actions(nodes)
        beliefs = _stack(nodes)
        actions = zip(beliefs, planner.actions_at(beliefs), strict=True)
        return [None if self._domain.is_terminal(belief) else action for belief, action in actions]

    def extend(
        self, nodes: Sequence[bytes], actions: Sequence[str], observations: Sequence[str]
    ) -> list[bytes]:
        planner = self._robot.planner
        if isinstance(planner, Planner):
            after = planner.update_many(_stack(nodes), actions, observations)
        else:
            after = _stack(super().extend(nodes, actions, observations))
        return [belief.tobytes() for belief in np.round(after, DIGITS)]


def _stack(nodes: Sequence[bytes]) -> Array:
    """Return the beliefs (n, S) of n nodes."""
    return np.frombuffer(b"".join(nodes)).reshape(len(nodes), -1)


class _History(NamedTuple):
    """A case, and the actions and observations since."""

    context: tuple[tuple[str, str], ...]
    labels: tuple[tuple[str, str], ...]
    steps: tuple[tuple[str, str], ...] = ()


class HistoryNodes:
    """The nodes of an own strategy, whose parts may have state: histories, decided anew each time.

    Histories are merged if they end with the same belief and action, and with equal states of all parts.

    Raises:
        DecisionError: the strategy acts differently after equal histories, chooses an unknown action or has
            histories of more than `MAX_ACTIONS` actions.
    """

    def __init__(
        self, domain: Domain, full: Robot, strategy: Strategy, channels: Mapping[str, NoisyChannel]
    ) -> None:
        self._domain, self._strategy, self._channels = domain, strategy, channels
        self._full = replace(full, classifiers=channels)
        parts = (full.reasoner, full.planner, full.domain, strategy.change, *channels.values())
        self._shared = {id(part) for part in parts}
        self._count, self.n_numbers = 0, 0
        self._first: dict[Hashable, _History] = {}  # key of the point of a decision -> its first history
        self._actions: dict[_History, str | None] = {}
        self._merge = cache(self._find_first)

    def root(self, context: Mapping[str, str], labels: Mapping[str, str]) -> Hashable:
        return self._merge(_History(tuple(context.items()), tuple(labels.items())))

    def find_actions(self, nodes: Sequence[_History]) -> list[str | None]:
        return [self._actions[node] for node in nodes]

    def extend(
        self, nodes: Sequence[_History], actions: Sequence[str], observations: Sequence[str]
    ) -> list[Hashable]:
        steps = zip(actions, observations, strict=True)
        return [self._merge(n._replace(steps=(*n.steps, step))) for n, step in zip(nodes, steps, strict=True)]

    def describe(self, node: _History) -> str:
        given = ", ".join(f"{name}={value}" for name, value in (*node.context, *node.labels))
        return f"the prior given {given or 'nothing'}"

    def _find_first(self, node: _History) -> _History:
        """Decide as in a history, and return the first one that ends at the same point."""
        action, key = self._replay(node)
        first = self._first.setdefault(key, node)
        self._actions[first] = action
        return first

    def _replay(self, node: _History) -> tuple[str | None, Hashable]:
        """Return the action after a history, and the key of the point that is reached."""
        self._count += 1 + len(node.steps)
        if self._count > MAX_ACTIONS:
            raise DecisionError(
                f"{self._strategy.location}: more than {MAX_ACTIONS} actions in all histories of"
                " observations; its scores need simulated trials"
            )
        signals = {
            sense: np.array([[float(self._channels[sense].classes.index(label))]])
            for sense, label in node.labels
        }
        world = RepeatedWorld(node.steps)
        with self._strategy.locate_failures():
            robot = self._strategy.robot(self._full)
            evidence = robot.domain.evidence(
                dict(node.context), robot.classify(Instance(signals, dict(node.context)))
            )
            marginal = robot.reasoner.posterior(robot.domain.shared, evidence)
            belief = robot.planner.start if marginal is None else robot.domain.prior(marginal)
            steps = list[Step]()
            try:
                act_until_report(robot, belief, world, listener=steps.append)
            except EndOfStepsError:
                known = self._domain.pomdp.actions
                if world.action not in known:
                    raise DecisionError(
                        f"the robot chose the action {world.action!r}; {expected_one_of(known)}"
                    ) from None
            if world.expected is not None:
                raise DecisionError(
                    f"chose {world.action!r} after a history in which it chose {world.expected!r} before; a"
                    " strategy that draws has a second parameter, the random generator"
                )
        belief = steps[-1].belief if steps else belief
        try:
            state = make_state_key((robot.classifiers, robot.reasoner, robot.planner), self._shared)
        except NoKeyError:
            return world.action, node
        return world.action, (world.action, np.round(belief, DIGITS).tobytes(), state)
