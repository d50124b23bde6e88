"""Strategies: the table, with the parts that each one uses, and changes of a robot."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from lcorpp.decision.dt_control import Robot
from lcorpp.errors import DecisionError, LcorppError, NoReportError, expected_one_of
from lcorpp.protocols import DomainInterface, Planner, Reasoner
from lcorpp.user_code import UserFunction
from lcorpp.values import BASELINE_SIGN, Array, Belief, Distribution, Label, Step

Rates = Mapping[str, Mapping[str, Array]]
"""Attribute of a sense -> its label -> (V,) P(label | shared value)."""

NO_RATES: Rates = {}
"""Of a robot whose program has the rates of all senses."""


class Session(Protocol):
    """What learns from the decisions about one person after another, across trainings and interruptions."""

    @property
    def n_people(self) -> int:
        """Number of people that it has learnt from."""

    def robot(self, full: Robot, person: str | None = None) -> Robot:
        """Return the robot for the next person.

        Args:
            full: whose classifiers perceive that person.
            person: permanent id of the person; None without.
        """

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step], person: str | None = None) -> None:
        """Learn from the decision about that person, as of an `Episode`."""

    def retrain(self, full: Robot, rates: Rates) -> None:
        """Use a robot whose classifiers were trained again; arguments as of `Strategy.start`."""

    def state(self) -> dict[str, Any]:
        """Return what it has learnt as JSON."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state, before the first person; other classifiers may have been trained since.

        Raises:
            DecisionError: the state is damaged.
        """

    def describe(self) -> Mapping[str, Any]:
        """Return numbers and texts for a table, by column, since the last call."""


@dataclass(frozen=True)
class Strategy:
    """One row of the table: a name, and whether the robot learns, reasons and plans.

    without: senses that the robot does not use although it learns.
    change: returns another robot in place of that with these parts, e.g. with a planner of its own; None
        changes nothing. It is called for each decision, so that its parts may have state within a decision.
    own: the user's function that `change` calls; None for a strategy from elsewhere.
    draws: whether `change` takes a random generator, too, and the robot's actions are random.
    start: starts a session of a strategy that learns from earlier people; from the full robot, and the rates
        of senses with soft evidence, which its program lacks. None for a strategy that decides about each
        person alone.

    Examples:
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import Strategy
        >>> silent = Strategy("L+R", learns=True, reasons=True, plans=False)
        >>> silent.robot(load_robot("intention").robot).planner.action([0.9, 0.1, 0, 0, 0])
        'report_interested'
    """

    name: str
    learns: bool
    reasons: bool
    plans: bool
    without: tuple[str, ...] = ()
    change: Callable[..., object] | None = None
    own: UserFunction | None = None
    draws: bool = False
    start: Callable[[Robot, Rates], Session] | None = None

    def uses(self, sense: str) -> bool:
        """Whether the robot uses the classifier of a sense; of a baseline, only the strategy of its name."""
        if BASELINE_SIGN in sense:
            return sense == self.name
        return self.learns and sense not in self.without

    def select(self, full: Robot) -> Robot:
        """Return the robot with the classifiers of those senses that it uses."""
        used = {name: part for name, part in full.classifiers.items() if self.uses(name)}
        return full if len(used) == len(full.classifiers) else replace(full, classifiers=used)

    def robot(self, full: Robot, rng: np.random.Generator | None = None, *, rates: Rates = NO_RATES) -> Robot:
        """The robot `full` with each unused part left out or replaced by its trivial substitute, and changed.

        That of a strategy that learns from earlier people is for the first person of a session.

        Args:
            rng: draws the actions of a strategy that draws; required by these only.
            rates: as of `start`.

        Raises:
            DecisionError: `change` fails or returns no robot; or `rng` is missing.
        """
        if self.start is not None:
            return self.start(self.select(full), rates).robot(self.select(full))
        robot = Robot(
            classifiers=self.select(full).classifiers,
            reasoner=self._choose_reasoner(full),
            planner=full.planner if self.plans else ImmediateReport(full.planner, full.domain),
            domain=full.domain,
        )
        if self.change is None:
            return robot
        if self.draws and rng is None:
            raise DecisionError(f"the strategy {self.name!r} draws its actions; expected a random generator")
        changed = self.change(robot, rng) if self.draws else self.change(robot)
        if not isinstance(changed, Robot):
            raise DecisionError(f"{self.location} returned {reprlib.repr(changed)}; expected a Robot")
        return changed

    def _choose_reasoner(self, full: Robot) -> Reasoner:
        if self.reasons:
            return full.reasoner
        if self.learns and self.plans:
            return LabelRatesReasoner(full.reasoner, full.domain)
        return LabelOnlyReasoner(full.domain)

    @property
    def location(self) -> str:
        """Where an own strategy is defined, ``FILE:LINE: strategy 'NAME'``, for messages."""
        return f"{self.own.location}: strategy {self.name!r}" if self.own else f"strategy {self.name!r}"

    @contextmanager
    def locate_failures(self) -> Iterator[None]:
        """Return a context that names this strategy in the errors of its robot's decisions.

        A strategy that changes nothing leaves all errors but a missing report as they are.

        Raises:
            DecisionError: an own strategy's part fails, or the decision cannot be completed.
        """
        try:
            yield
        except DecisionError as error:
            is_named = self.own is not None and str(error).startswith(str(self.own.path))
            if is_named or (self.change is None and not isinstance(error, NoReportError)):
                raise
            raise type(error)(f"{self.location}: {error}") from error
        except LcorppError:
            raise
        except Exception:
            if self.own is None:
                raise
            with self.own.locate_failures(f"strategy {self.name!r}"):
                raise


LCORPP = Strategy("LCORPP", learns=True, reasons=True, plans=True)
"""The strategy with all parts."""

STRATEGIES = (
    Strategy("L", learns=True, reasons=False, plans=False),
    Strategy("R", learns=False, reasons=True, plans=False),
    Strategy("P", learns=False, reasons=False, plans=True),
    Strategy("L+R", learns=True, reasons=True, plans=False),
    Strategy("R+P", learns=False, reasons=True, plans=True),
    Strategy("L+P", learns=True, reasons=False, plans=True),
    LCORPP,
)
"""The strategies of section "Experimental Results" of the paper, in its order; and L+P."""


ALIASES = {"L+R+P": LCORPP.name}
"""Other names of rows."""


def list_strategies(senses: Sequence[str]) -> tuple[Strategy, ...]:
    """Return the strategies of a domain with these senses.

    Without senses no strategy learns. With several, a row for each shows LCORPP without it, e.g.
    "LCORPP-gaze". A baseline, with `BASELINE_SIGN` in its name, is a strategy first: it reports its label.
    """
    baselines = [name for name in senses if BASELINE_SIGN in name]
    senses = [name for name in senses if name not in baselines]
    rows = (
        *[Strategy(name, True, False, False, without=tuple(senses)) for name in baselines],
        *[row for row in STRATEGIES if senses or not row.learns],
    )
    if len(senses) < 2:
        return rows
    return (*rows, *[replace(LCORPP, name=f"{LCORPP.name}-{sense}", without=(sense,)) for sense in senses])


def strategies(
    names: Iterable[str], senses: Sequence[str] = ("",), *, more: Sequence[Strategy] = ()
) -> tuple[Strategy, ...]:
    """Return the rows with the given names, or one name, in the order of the table; all rows without names.

    Args:
        senses: of the domain, see `list_strategies`; by default one.
        more: rows below the table that are found by their names only.

    Raises:
        DecisionError: an unknown name.

    Examples:
        >>> from lcorpp.decision import strategies
        >>> [strategy.name for strategy in strategies(["r+p", "LCORPP"])]
        ['R+P', 'LCORPP']
    """
    given, table = [names] if isinstance(names, str) else list(names), list_strategies(senses)
    selected = [ALIASES.get(name.upper(), name.upper()) for name in given]
    rows = (*table, *more) if selected else table
    known = [row.name.upper() for row in rows]
    for name, upper in zip(given, selected, strict=True):
        if upper not in known:
            needs = ""
            if upper in [row.name for row in STRATEGIES]:
                needs = " in a domain without classifiers"
            raise DecisionError(
                f"unknown strategy {name!r}{needs}; {expected_one_of([r.name for r in rows])}"
            )
    return tuple(row for row in rows if not selected or row.name.upper() in selected)


@dataclass(frozen=True, eq=False)
class LabelOnlyReasoner:
    """A reasoner without knowledge: its posterior comes from the labels of the senses alone.

    Without a label there is no posterior, and the planner starts from its model's initial belief (strategy
    P). See `DomainInterface.label_marginal`.
    """

    domain: DomainInterface

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution | None:
        return self.domain.label_marginal(evidence)


@dataclass(frozen=True, eq=False)
class LabelRatesReasoner:
    """A reasoner that knows the error rates of the classifiers, and nothing else (strategy L+P).

    Its posterior of the shared values is proportional to P(labels | value), as if all values were equally
    probable before. Labels of other variables are left out: what they mean for the shared ones is knowledge.
    Without a label there is no posterior, as in `LabelOnlyReasoner`.

    reasoner: whose program has the rates.
    """

    reasoner: Reasoner
    domain: DomainInterface

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution | None:
        used = self.domain.shared_label_attributes
        labels = {name: evidence[name] for name in used if name in evidence}
        return infer_from_rates(self.reasoner, attribute, labels) if labels else None


def infer_from_rates(
    reasoner: Reasoner, attribute: str | Sequence[str], labels: Mapping[str, Label]
) -> Distribution:
    """Return the distribution that is proportional to P(labels | value) under a program."""
    given, prior = reasoner.posterior(attribute, labels), reasoner.posterior(attribute, {})
    assert given is not None
    assert prior is not None
    ratio = np.zeros(len(prior.values))
    np.divide(given.probabilities, prior.probabilities, out=ratio, where=prior.probabilities > 0)
    return Distribution(prior.values, ratio / ratio.sum())


@dataclass(frozen=True, eq=False)
class ImmediateReport:
    """A planner that reports the most likely value without asking."""

    planner: Planner
    domain: DomainInterface

    @property
    def start(self) -> Belief:
        return self.planner.start

    def action(self, belief: Belief) -> str:
        return self.domain.report_action(self.domain.marginal(belief).most_likely())

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        return self.planner.update(belief, action, observation)


def make_generator(*seed: int) -> np.random.Generator:
    """Return the generator of a strategy that draws its actions, independent of the world's answers."""
    return np.random.default_rng([*seed, 1])
