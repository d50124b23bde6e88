"""Strategies by name: baselines beside the table of the paper, and the user's own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from lcorpp.assembly.strategies.own import load_strategy
from lcorpp.assembly.strategies.strategy_table import BASELINE_TABLE
from lcorpp.assembly.strategies.trust import WITH_TRUST, with_ask_budget
from lcorpp.decision import STRATEGIES, Robot, Strategy
from lcorpp.decision.strategies import ImmediateReport, list_strategies, strategies
from lcorpp.domains import Domain
from lcorpp.domains.information import compute_information
from lcorpp.errors import DecisionError, check_type, expected_one_of
from lcorpp.protocols import Planner
from lcorpp.user_code import split_function
from lcorpp.values import Belief

QUESTIONS = 2
"""Number of questions of the strategy `ask-twice`."""

MIN_INFORMATION = 1e-9
"""In nats: an action that is less informative is not a question."""


def find_strategies(names: Iterable[str], senses: Sequence[str] = ("",)) -> tuple[Strategy, ...]:
    """Return the strategies of these names: rows of the table, baselines, then own ones.

    Args:
        names: of rows, of `BASELINES`, `WITH_TRUST` and `WITH_LIMITS`, or ``FILE.py:NAME``, see
            `load_strategy`; none for the whole table.
        senses: of the domain, see `lcorpp.decision.strategies.list_strategies`; by default one.

    Raises:
        DecisionError: an unknown name, two strategies of one name, or an own strategy that cannot be loaded.

    Examples:
        >>> from lcorpp.assembly import find_strategies
        >>> [strategy.name for strategy in find_strategies(["LCORPP", "ask-twice"])]
        ['LCORPP', 'ask-twice']
    """
    from lcorpp.assembly.strategies.limits import WITH_LIMITS  # decisions of LCORPP do without

    rows, own = list[str](), list[Strategy]()
    for name in names:
        parts = split_function(name)
        if parts is None:
            rows.append(name)
        else:
            own.append(load_strategy(*parts))
    found = (
        *(strategies(rows, senses, more=(*BASELINES, *WITH_TRUST, WITH_LIMITS)) if rows or not own else ()),
        *own,
    )
    for k, strategy in enumerate(found):
        if strategy.name in [other.name for other in found[:k]]:
            raise DecisionError(f"{strategy.location}: another strategy has this name; expected another name")
    return found


def read_strategy(description: Mapping[str, Any], domain: Domain) -> Strategy:
    """Return a logged strategy.

    Raises:
        DecisionError: there is none of this name, or the user's file is missing or wrong.
        LookupError, TypeError, ValueError: `description` has another form.
    """
    from lcorpp.assembly.strategies.limits import WITH_LIMITS

    name, source = description["name"], description.get("source")
    if source is not None:
        return find_strategies([source])[0]
    senses = [sense.name for sense in domain.all_senses]
    rows = {
        row.name: row for row in (*STRATEGIES, *list_strategies(senses), *BASELINES, *WITH_TRUST, WITH_LIMITS)
    }
    if name not in rows:
        raise DecisionError(f"unknown strategy {name!r}; {expected_one_of(rows)}")
    budget = description.get("ask_budget")
    return rows[name] if budget is None else with_ask_budget(rows[name], float(budget))


def ask_twice(robot: Robot) -> Robot:
    """Return a robot that asks two questions, then reports the most likely value.

    A question is the action whose observation is most informative about the shared variables at the current
    belief: that of the largest mutual information of both, the first of equal ones. An action without
    information is not a question, so the robot may report earlier.

    Raises:
        DecisionError: the robot's domain is not a `Domain`, which has a model.
    """
    check_type(robot.domain, Domain, "the domain of the strategy 'ask-twice'", DecisionError)
    assert isinstance(robot.domain, Domain)
    return replace(robot, planner=_AskTwice(robot.planner, robot.domain))


def act_at_random(robot: Robot, rng: np.random.Generator) -> Robot:
    """Return a robot that draws each action, all with the same probability, until it draws a report.

    Raises:
        DecisionError: the robot's domain is not a `Domain`, which has a model.
    """
    check_type(robot.domain, Domain, "the domain of the strategy 'random'", DecisionError)
    assert isinstance(robot.domain, Domain)
    return replace(robot, planner=_RandomPlanner(robot.planner, robot.domain.model.actions, rng))


@dataclass(eq=False)
class _AskTwice:
    """The planner of one decision of `ask_twice`."""

    planner: Planner
    domain: Domain
    asked: int = 0

    @property
    def start(self) -> Belief:
        return self.planner.start

    @cached_property
    def _report(self) -> ImmediateReport:
        return ImmediateReport(self.planner, self.domain)

    def action(self, belief: Belief) -> str:
        information = compute_information(self.domain, belief)
        best = int(np.argmax(np.round(information, 9)))  # rounding: equal ones differ by rounding errors
        if self.asked == QUESTIONS or information[best] < MIN_INFORMATION:
            return self._report.action(belief)
        self.asked += 1
        return self.domain.pomdp.actions[best]

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        return self.planner.update(belief, action, observation)


@dataclass(frozen=True, eq=False)
class _RandomPlanner:
    """The planner of one decision of `act_at_random`."""

    planner: Planner
    actions: tuple[str, ...]
    rng: np.random.Generator

    @property
    def start(self) -> Belief:
        return self.planner.start

    def action(self, belief: Belief) -> str:
        return self.actions[int(self.rng.integers(len(self.actions)))]

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        return self.planner.update(belief, action, observation)


def make_baseline(name: str) -> Strategy:
    """Return the strategy of a row of `BASELINE_TABLE`."""
    row = BASELINE_TABLE[name]
    change = None if row.change is None else globals()[row.change]
    return Strategy(name, row.learns, row.reasons, row.plans, change=change, draws=row.draws)


BASELINES = tuple(map(make_baseline, BASELINE_TABLE))
"""Strategies that are found by their names, beside the table of the paper."""
