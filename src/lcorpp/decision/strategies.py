"""The six strategies of the paper's experiments: a table of which parts are on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from lcorpp.decision.dt_control import Robot
from lcorpp.errors import DecisionError, expected
from lcorpp.protocols import Planner, Vocabulary
from lcorpp.values import Belief, Distribution, Instance, Label, Likelihood


@dataclass(frozen=True)
class Strategy:
    """A row of the table: a name and which of the three parts it uses."""

    name: str
    learns: bool
    reasons: bool
    plans: bool

    def robot(self, full: Robot) -> Robot:
        """`full` with the parts that are off replaced by what stands in for them."""
        return Robot(
            classifier=full.classifier if self.learns else NoClassifier(),
            reasoner=full.reasoner if self.reasons else NoKnowledge(full.domain),
            planner=full.planner if self.plans else ReportAtOnce(full.planner, full.domain),
            domain=full.domain,
        )


STRATEGIES = (
    Strategy("L", learns=True, reasons=False, plans=False),
    Strategy("R", learns=False, reasons=True, plans=False),
    Strategy("P", learns=False, reasons=False, plans=True),
    Strategy("L+R", learns=True, reasons=True, plans=False),
    Strategy("R+P", learns=False, reasons=True, plans=True),
    Strategy("LCORPP", learns=True, reasons=True, plans=True),
)
"""Section "Experimental Results" of the paper, in its order."""


def strategies(names: Iterable[str]) -> tuple[Strategy, ...]:
    """The rows of the table with these names, in the order of the table; all of them for no names.

    Raises:
        DecisionError: a name that is not in the table.
    """
    wanted = [name.upper() for name in names]
    known = [row.name for row in STRATEGIES]
    for name in wanted:
        if name not in known:
            raise DecisionError(f"unknown strategy {name!r}; {expected(known)}")
    return tuple(row for row in STRATEGIES if not wanted or row.name in wanted)


class NoClassifier:
    """In place of a classifier: says nothing."""

    def classify(self, instance: Instance) -> str | None:
        return None


@dataclass(frozen=True, eq=False)
class NoKnowledge:
    """In place of a reasoner: takes a label at its word and has no opinion without one.

    A likelihood it takes for a distribution, as if all values were equally common.

    Without an opinion the planner starts from the start belief of its own model (strategy P).
    """

    domain: Vocabulary

    def posterior(self, attribute: str, evidence: Mapping[str, Label]) -> Distribution | None:
        claim = self.domain.claim(evidence)
        if isinstance(claim, Likelihood):
            return Distribution(claim.values, claim.weights / claim.weights.sum())
        return None if claim is None else Distribution.certain(claim, self.domain.values)


@dataclass(frozen=True, eq=False)
class ReportAtOnce:
    """In place of a policy: reports the most likely value without asking."""

    planner: Planner
    domain: Vocabulary

    @property
    def start(self) -> Belief:
        return self.planner.start

    def action(self, belief: Belief) -> str:
        return self.domain.report_action(self.domain.marginal(belief).most_likely())

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        return self.planner.update(belief, action, observation)
