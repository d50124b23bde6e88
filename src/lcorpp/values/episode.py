"""Input and record of one decision: the instance, the steps, the episode."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from lcorpp.errors import DataError
from lcorpp.notebook import html_table, join_some
from lcorpp.values.arrays import Array, Belief, freeze
from lcorpp.values.distribution import Distribution, Label, SharedValue, format_value
from lcorpp.values.padding import strip_padding


@dataclass(frozen=True, eq=False, repr=False)
class Instance:
    """What the robot perceives of one person before it acts: I of Algorithm 1.

    signals: sense -> what it perceived, the input of its classifier: a trajectory (channels, time points) or
        features (n,). The padding of a trajectory, see `Dataset`, is removed. A sense that perceived nothing
        is left out.
    context: the observed facts, P-log attribute -> value; beta of Algorithm 2.

    Raises:
        DataError: a signal is not an array of numbers of one or two dimensions, or a part is not a mapping.

    Examples:
        >>> from lcorpp import Instance
        >>> Instance({"motion": [[0.0, 0.5, 1.0], [2.0, 2.0, 2.0]]}, {"time": "morning"})
        Instance(signals: motion (2, 3), context: time=morning)
    """

    signals: Mapping[str, Array]
    context: Mapping[str, str]

    def __post_init__(self) -> None:
        signals = _copy_mapping("signals", self.signals, "sense -> numbers")
        for sense, signal in signals.items():
            signals[sense] = _freeze_signal(sense, signal)
        context = _copy_mapping("context", self.context, "attribute -> value")
        object.__setattr__(self, "signals", MappingProxyType(signals))
        object.__setattr__(self, "context", MappingProxyType(context))

    def __repr__(self) -> str:
        signals = join_some([f"{sense} {signal.shape}" for sense, signal in self.signals.items()])
        context = join_some([f"{name}={value}" for name, value in self.context.items()])
        return f"Instance(signals: {signals or 'none'}, context: {context or 'empty'})"


def _copy_mapping(part: str, value: Any, expected: str) -> dict[str, Any]:
    try:
        return {**value}  # in a third of the time of isinstance(value, Mapping)
    except TypeError:
        raise DataError(f"the {part} of an instance: {reprlib.repr(value)}; expected {expected}") from None


def _freeze_signal(sense: str, signal: Array) -> Array:
    try:
        array = strip_padding(freeze(signal))
    except (TypeError, ValueError):
        array = freeze(0)
    if array.ndim not in (1, 2):
        raise DataError(
            f"the signal of the sense {sense!r} is {reprlib.repr(signal)}; expected numbers of shape"
            " (channels, time points) or (features,)"
        )
    return array


@dataclass(frozen=True, eq=False, repr=False)
class Step:
    """One pass through the loop of Algorithm 2, lines 8 to 12.

    action: the robot's action. observation: the observation that follows, None after a report.
    belief: (S,) the belief after both; a report leaves it unchanged.

    Examples:
        >>> from lcorpp import Step
        >>> from lcorpp.values import freeze
        >>> Step("greet", "pos", freeze([0.9, 0.1]))
        Step('greet', 'pos', belief [0.9, 0.1])
    """

    action: str
    observation: str | None
    belief: Belief

    def __repr__(self) -> str:
        return f"Step({self.action!r}, {self.observation!r}, belief {_describe_belief(self.belief)})"


@dataclass(frozen=True, eq=False, repr=False)
class Episode:
    """One decision from perception to report; it contains only what a robot can know.

    labels: sense -> the output of its classifier, for the senses that perceived something.
    evidence: the reasoner's input, P-log attribute -> value or likelihood of each value.
    marginal: the reasoner's posterior over the shared variables, None without a reasoner's posterior.
    prior: (S,) the planner's initial belief.
    steps: the actions, observations and beliefs in order, the report last.
    report: the reported value of the shared variables, L of Algorithm 2; None if the terminal state was
        reached without a report.
    seconds: part -> wall-clock time: "classify", "reason", "plan"; empty if it was not measured.

    Examples:
        >>> import lcorpp
        >>> episode = lcorpp.decide("intention", {"time": "afternoon"}, label="one", world=["pos", "pos"])
        >>> episode.report, episode.answers
        ('interested', (('move_forward', 'pos'),))
    """

    labels: Mapping[str, Label]
    evidence: Mapping[str, Label]
    marginal: Distribution | None
    prior: Belief
    steps: tuple[Step, ...]
    report: SharedValue | None
    seconds: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", MappingProxyType(dict(self.labels)))
        object.__setattr__(self, "evidence", MappingProxyType(dict(self.evidence)))

    @property
    def answers(self) -> tuple[tuple[str, str], ...]:
        """The pairs (action, observation), without the report."""
        return tuple((step.action, step.observation) for step in self.steps if step.observation is not None)

    def __repr__(self) -> str:
        evidence = join_some([f"{name}={value}" for name, value in self.evidence.items()])
        labels = join_some([f"{sense} {label}" for sense, label in self.labels.items()])
        actions = join_some([step.action for step in self.steps])
        return (
            f"Episode(labels: {labels or 'none'}, evidence: {evidence or 'none'}, marginal={self.marginal},"
            f" {len(self.steps)} steps: {actions or 'none'}, report={self.report!r})"
        )

    def _repr_html_(self) -> str:
        evidence = join_some([f"{name} = {value}" for name, value in self.evidence.items()])
        rows = [
            *[(sense, str(label), "") for sense, label in self.labels.items()],
            ("evidence", evidence, ""),
            ("marginal", "" if self.marginal is None else str(self.marginal), ""),
            ("prior", "", _describe_belief(self.prior)),
        ]
        for step in self.steps[:SHOWN_STEPS]:
            rows.append((step.action, step.observation or "", _describe_belief(step.belief)))
        if len(self.steps) > SHOWN_STEPS:
            rows.append(("...", f"{len(self.steps)} steps in all", ""))
        report = "none" if self.report is None else format_value(self.report)
        header = ("part or action", "value or observation", "belief")
        return html_table(header, [*rows, ("report", report, "")], caption=f"Decision: {report}")


SHOWN_STEPS = 20
"""Maximum number of steps in the HTML table of an episode."""


def _describe_belief(belief: Belief) -> str:
    return f"[{join_some([f'{p:.3g}' for p in belief.tolist()])}]"
