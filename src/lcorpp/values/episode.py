"""Input and record of one decision: the instance, the steps, the episode."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from lcorpp.errors import DataError
from lcorpp.notebook import html_table, join_some
from lcorpp.values.arrays import Array, Belief, freeze
from lcorpp.values.distribution import Distribution, Label


@dataclass(frozen=True, eq=False, repr=False)
class Instance:
    """What the robot perceives of one person before it acts: I of Algorithm 1.

    trajectory: (channels, time points) the motion, the classifier's input.
    context: the observed facts, P-log attribute -> value; beta of Algorithm 2.

    Raises:
        DataError: the trajectory is no array of that shape, or the context is no mapping.
    """

    trajectory: Array
    context: Mapping[str, str]

    def __post_init__(self) -> None:
        try:
            trajectory = freeze(self.trajectory)
        except (TypeError, ValueError):
            trajectory = freeze(())
        if trajectory.ndim != 2:
            raise DataError(
                f"the trajectory of an instance is {reprlib.repr(self.trajectory)}; expected numbers of shape"
                " (channels, time points)"
            )
        if not isinstance(self.context, Mapping):
            raise DataError(
                f"the context of an instance is {reprlib.repr(self.context)}; expected attribute -> value"
            )
        object.__setattr__(self, "trajectory", trajectory)
        object.__setattr__(self, "context", MappingProxyType(dict(self.context)))

    def __repr__(self) -> str:
        context = join_some([f"{name}={value}" for name, value in self.context.items()])
        return f"Instance(trajectory {self.trajectory.shape}, context: {context or 'empty'})"


@dataclass(frozen=True, eq=False, repr=False)
class Step:
    """One pass through the loop of Algorithm 2, lines 8 to 12.

    action: the robot's action. observation: the observation that follows, None after a report.
    belief: (S,) the belief after both; a report leaves it unchanged.
    """

    action: str
    observation: str | None
    belief: Belief

    def __repr__(self) -> str:
        return f"Step({self.action!r}, {self.observation!r}, belief {_describe_belief(self.belief)})"


@dataclass(frozen=True, eq=False, repr=False)
class Episode:
    """One decision from perception to report; it contains only what a robot can know.

    label: the classifier's output, None without a classifier.
    evidence: the reasoner's input, P-log attribute -> value or likelihood of each value.
    marginal: the reasoner's posterior over the target attribute, None without a reasoner's posterior.
    prior: (S,) the planner's initial belief.
    steps: the actions, observations and beliefs in order, the report last.
    report: the reported value of the target attribute, L of Algorithm 2; None if the terminal state was
        reached without a report.
    """

    label: Label | None
    evidence: Mapping[str, Label]
    marginal: Distribution | None
    prior: Belief
    steps: tuple[Step, ...]
    report: str | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "evidence", MappingProxyType(dict(self.evidence)))

    def __repr__(self) -> str:
        evidence = join_some([f"{name}={value}" for name, value in self.evidence.items()])
        actions = join_some([step.action for step in self.steps])
        return (
            f"Episode(label={self.label!r}, evidence: {evidence or 'none'}, marginal={self.marginal},"
            f" {len(self.steps)} steps: {actions or 'none'}, report={self.report!r})"
        )

    def _repr_html_(self) -> str:
        evidence = join_some([f"{name} = {value}" for name, value in self.evidence.items()])
        rows = [
            ("label", str(self.label), ""),
            ("evidence", evidence, ""),
            ("marginal", "" if self.marginal is None else repr(self.marginal), ""),
            ("prior", "", _describe_belief(self.prior)),
        ]
        for step in self.steps[:SHOWN_STEPS]:
            rows.append((step.action, step.observation or "", _describe_belief(step.belief)))
        if len(self.steps) > SHOWN_STEPS:
            rows.append(("...", f"{len(self.steps)} steps in all", ""))
        rows.append(("report", str(self.report), ""))
        return html_table(("part or action", "value or observation", "belief"), rows)


SHOWN_STEPS = 20
"""Maximum number of steps in the HTML table of an episode."""


def _describe_belief(belief: Belief) -> str:
    return f"[{join_some([f'{p:.3g}' for p in belief.tolist()])}]"
