"""The six strategies of the paper's experiments: a table of the parts that each one uses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from lcorpp.decision.dt_control import Robot
from lcorpp.errors import DecisionError, expected_one_of
from lcorpp.protocols import DomainInterface, Planner
from lcorpp.values import Belief, Distribution, Instance, Label, Likelihood


@dataclass(frozen=True)
class Strategy:
    """One row of the table: a name, and whether the robot learns, reasons and plans."""

    name: str
    learns: bool
    reasons: bool
    plans: bool

    def robot(self, full: Robot) -> Robot:
        """The robot `full` with each unused part replaced by its trivial substitute."""
        return Robot(
            classifier=full.classifier if self.learns else NullClassifier(),
            reasoner=full.reasoner if self.reasons else LabelOnlyReasoner(full.domain),
            planner=full.planner if self.plans else ImmediateReport(full.planner, full.domain),
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
"""The strategies of section "Experimental Results" of the paper, in its order."""


def strategies(names: Iterable[str]) -> tuple[Strategy, ...]:
    """The rows with the given names, in the order of the table; all rows if no name is given.

    Raises:
        DecisionError: an unknown name.
    """
    selected = [name.upper() for name in names]
    known = [row.name for row in STRATEGIES]
    for name in selected:
        if name not in known:
            raise DecisionError(f"unknown strategy {name!r}; {expected_one_of(known)}")
    return tuple(row for row in STRATEGIES if not selected or row.name in selected)


class NullClassifier:
    """A classifier that never returns a label."""

    def classify(self, instance: Instance) -> str | None:
        return None


@dataclass(frozen=True, eq=False)
class LabelOnlyReasoner:
    """A reasoner without knowledge: its posterior is the classifier's label.

    A hard label gets probability 1; a likelihood is normalised, i.e. combined with a uniform prior. Without a
    label there is no posterior, and the planner starts from its model's initial belief (strategy P).
    """

    domain: DomainInterface

    def posterior(self, attribute: str, evidence: Mapping[str, Label]) -> Distribution | None:
        label = self.domain.target_of_label(evidence)
        if isinstance(label, Likelihood):
            return Distribution(label.values, label.weights / label.weights.sum())
        return None if label is None else Distribution.certain(label, self.domain.values)


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
