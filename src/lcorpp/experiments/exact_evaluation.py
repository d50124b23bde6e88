"""The exact scores of the strategies: people and answers enumerated, not drawn.

This is the reference that simulation is held against. It needs a classifier that is a channel and reactions
that the domain gives as probabilities.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.experiments.metrics import Scores, exact_scores
from lcorpp.simulation.population import Channel, Population
from lcorpp.values import Belief

LOST = 1e-12
"""Branches of an episode less likely than this are dropped; what is dropped is part of the total checked."""


def exact(domain: Domain, robot: Robot, channel: Channel, rows: tuple[Strategy, ...]) -> list[Scores]:
    """The exact scores of some strategies.

    Args:
        robot: the full robot; its classifier is not asked, the channel stands for it.
        rows: the strategies, in the order of the result.

    Raises:
        DomainError: the domain's `people.py` draws reactions, whose probabilities are not known.
    """
    if domain.simulation.reaction is not None:
        raise DomainError(f"{domain.folder}: people.py draws its reactions, so only simulation can score it")
    cells = Population(domain).cells((*domain.observed, domain.target))
    return [_strategy(domain, row.robot(robot), row, channel, cells) for row in rows]


def _strategy(
    domain: Domain, robot: Robot, row: Strategy, channel: Channel, cells: Mapping[tuple[str, ...], float]
) -> Scores:
    starts = _starts(domain, robot, row, channel, cells)
    tree = _Tree(domain, robot)
    joint = np.zeros((len(domain.values), len(domain.values) + 1))
    cost = square = earned = 0.0
    for (key, v), mass in starts.items():
        for end in tree.ends(np.frombuffer(key), v):
            p = mass * end.probability
            joint[v, end.reported] += p
            cost += p * end.cost
            square += p * end.cost**2
            earned += p * (end.reward - end.cost)
    sd = float(np.sqrt(max(square - cost**2, 0.0)))
    return exact_scores(row.name, joint, cost, earned, sd, values=domain.values, positive=domain.positive)


def _starts(
    domain: Domain, robot: Robot, row: Strategy, channel: Channel, cells: Mapping[tuple[str, ...], float]
) -> dict[tuple[bytes, int], float]:
    """How likely each (prior belief, true value) is."""
    starts: dict[tuple[bytes, int], float] = defaultdict(float)
    for (*context, value), mass in cells.items():
        v = domain.values.index(value)
        labels = (
            dict(zip(channel.classes, channel.rates[v].tolist(), strict=True)) if row.learns else {None: 1.0}
        )
        for label, rate in labels.items():
            if mass * rate == 0:
                continue
            evidence = domain.evidence(dict(zip(domain.observed, context, strict=True)), label)
            marginal = robot.reasoner.posterior(domain.target, evidence)
            prior = robot.planner.start if marginal is None else domain.prior(marginal)
            starts[prior.tobytes(), v] += mass * rate
    return starts


@dataclass(frozen=True)
class _End:
    """One way an episode may end."""

    probability: float
    reported: int
    cost: float
    reward: float


class _Tree:
    """The episodes that may follow a belief; what the robot does at a belief is asked once."""

    def __init__(self, domain: Domain, robot: Robot) -> None:
        self._domain, self._robot = domain, robot
        self._actions: dict[bytes, str] = {}
        self._followed: dict[tuple[int, int], list[tuple[int, str, float]]] = {}
        self._updates: dict[tuple[bytes, str, str], Belief] = {}

    def ends(self, prior: Belief, v: int) -> list[_End]:
        """How an episode about somebody of true value v ends, from a prior belief (S,)."""
        domain, pomdp = self._domain, self._domain.pomdp
        ends: list[_End] = []
        frontier: dict[tuple[bytes, int, float], float] = {}
        beliefs = {prior.tobytes(): prior}
        for first in np.flatnonzero(domain.entry[v]):
            frontier[prior.tobytes(), int(first), 0.0] = float(domain.entry[v, first])
        while frontier:
            following: dict[tuple[bytes, int, float], float] = defaultdict(float)
            for (key, s, cost), mass in frontier.items():
                belief = beliefs[key]
                if domain.finished(belief):
                    ends.append(_End(mass, len(domain.values), cost, 0.0))
                    continue
                action = self._action(key, belief)
                a = pomdp.actions.index(action)
                reward = float(pomdp.reward[a, s])
                value = domain.report(action)
                if value is not None:
                    ends.append(_End(mass, domain.values.index(value), cost, reward))
                    continue
                paid = round(cost - reward, 9)
                for s_next, heard, chance in self._moves(a, s):
                    p = mass * chance
                    if p < LOST:
                        continue
                    belief_next = self._update(key, belief, action, heard)
                    key_next = belief_next.tobytes()
                    beliefs[key_next] = belief_next
                    following[key_next, s_next, paid] += p
            frontier = following
        return ends

    def _moves(self, action: int, state: int) -> list[tuple[int, str, float]]:
        """What may come of an action in a state: the next state, what is observed then, the probability."""
        if (action, state) not in self._followed:
            pomdp, reactions = self._domain.pomdp, self._domain.simulation.reactions
            states, chances = pomdp.transition.row(action, state)
            self._followed[action, state] = [
                (s, pomdp.observations[o], p * float(reactions[action, s, o]))
                for s, p in zip(states.tolist(), chances.tolist(), strict=True)
                for o in np.flatnonzero(reactions[action, s])
            ]
        return self._followed[action, state]

    def _action(self, key: bytes, belief: Belief) -> str:
        if key not in self._actions:
            self._actions[key] = self._robot.planner.action(belief)
        return self._actions[key]

    def _update(self, key: bytes, belief: Belief, action: str, observation: str) -> Belief:
        step = (key, action, observation)
        if step not in self._updates:
            # rounded, so that one belief reached on two ways is one belief
            self._updates[step] = np.round(self._robot.planner.update(belief, action, observation), 12)
        return self._updates[step]
