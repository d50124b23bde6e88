"""A domain: the one value that knows the words of all parts and translates between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement
from math import comb
from pathlib import Path

import numpy as np

from lcorpp.errors import DomainError, expected_one_of
from lcorpp.planning import Pomdp
from lcorpp.reasoning import Program, with_classifier
from lcorpp.values import JEFFREYS, Array, Belief, ConfusionMatrix, Distribution, Label, Likelihood

LATTICE, MOST_STARTS = 10, 36
"""Steps from one corner of the simplex of priors to the next, and priors in all, at most (corners always)."""


@dataclass(frozen=True, eq=False)
class Simulation:
    """How people are simulated where there are none.

    truth: the P-log program that people are drawn from.
    reactions: (A, S, O) P(o | a, s'), how people in fact answer.
    channel: target value -> label -> probability, the classifier as a noisy channel; None where only
        simulated motion or recorded data feed it.
    trajectories: from people (attribute -> value) and a generator to (people, channels, time points);
        None where the domain has no people.py.
    recordings: from the same, and the keyword `seconds` (shortest, longest), to a list of arrays (samples,
        columns), one for each person, as a tracker records them; None where people.py has none.
    columns: the names of those columns; () where there are no recordings.
    reaction: from a person, an action and a generator to an observation, in place of `reactions`; None
        where the domain has none.
    """

    truth: Program
    reactions: Array
    channel: Mapping[str, Mapping[str, float]] | None
    trajectories: Callable[[Sequence[Mapping[str, str]], np.random.Generator], Array] | None
    reaction: Callable[[Mapping[str, str], str, np.random.Generator], str] | None
    recordings: Callable[..., list[Array]] | None = None
    columns: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Domain:
    """Everything in a domain folder, checked as a whole by `load_domain`.

    name, description, folder, preset: what it is called and where it lies.
    program: the P-log knowledge. observed: attributes that are seen as facts.
    target: the attribute that reasoner and planner share; `values` are its values.
    attribute: the attribute that the classifier feeds; label_of: target value -> the label that claims it.
    positive: the target value that F1, precision and recall are about; None averages over all values.
    classifier: "lstm" or "channel", what feeds the attribute unless the user says otherwise.
    tracks, epochs: how many simulated tracks to train on, and how often.
    interval: seconds between two points of simulated tracks.
    data_labels: how recorded data writes the classes.
    pomdp: the planner's model. reports: report action -> target value.
    entry: (V, S) entry[v] the planner's states that carry target value v before any action.
    share: (S, V) 1 where a state has target value v; zeros for the terminal state.
    terminal: index of the terminal state, None without one.
    simulation: how people are simulated.
    """

    name: str
    description: str
    folder: Path
    preset: str | None
    program: Program
    observed: tuple[str, ...]
    target: str
    attribute: str
    label_of: Mapping[str, str]
    positive: str | None
    classifier: str
    tracks: int
    epochs: int
    interval: float
    data_labels: Mapping[str, str]
    pomdp: Pomdp
    reports: Mapping[str, str]
    entry: Array
    share: Array
    terminal: int | None
    simulation: Simulation

    @property
    def values(self) -> tuple[str, ...]:
        """The values of the target, in the order the knowledge declares them."""
        return self.program.attributes[self.target].values

    def evidence(self, context: Mapping[str, str], label: Label | None) -> Mapping[str, Label]:
        """What the reasoner is told: the observed facts and the label that claims class `label`.

        A likelihood of the classes becomes one of the labels that claim them; `soft_program` is the program
        in which that is right.

        Raises:
            DomainError: a fact or a class that this domain does not know.
        """
        for name, value in context.items():
            if name not in self.observed:
                raise DomainError(
                    f"{name!r} is not observed in {self.name}; {expected_one_of(self.observed)}"
                )
            known = self.program.attributes[name].values
            if value not in known:
                raise DomainError(f"{name} cannot be {value!r}; {expected_one_of(known)}")
        if label is None:
            return dict(context)
        if isinstance(label, Likelihood):
            if set(label.values) != set(self.label_of):
                classes = ", ".join(self.label_of)
                raise DomainError(f"a likelihood of {', '.join(label.values)}; expected one of {classes}")
            return {**context, self.attribute: label.rename(self.label_of)}
        if label not in self.label_of:
            raise DomainError(f"unknown class {label!r}; {expected_one_of(tuple(self.label_of))}")
        return {**context, self.attribute: self.label_of[label]}

    def target_of_label(self, evidence: Mapping[str, Label]) -> Label | None:
        """The target value that the label in the evidence stands for, None without a label.

        A likelihood comes back as one of the target's values, in their order.
        """
        label = evidence.get(self.attribute)
        if isinstance(label, Likelihood):
            weight_of = dict(label)
            return Likelihood(self.values, np.array([weight_of[self.label_of[v]] for v in self.values]))
        return next((value for value, word in self.label_of.items() if word == label), None)

    def prior(self, marginal: Distribution) -> Belief:
        """(S,) the marginal spread over the planner's states, its own variables where they start."""
        return marginal.probabilities @ self.entry

    def start_beliefs(self) -> Array:
        """(N, S) beliefs to solve the model for: its own start, and priors all over the target's simplex.

        Each person brings another prior, and a policy is only good where it was solved for; on a lattice of
        priors it is good wherever a reasoner, whatever its rules, may put the robot.
        """
        parts = len(self.values)
        steps = max(m for m in range(1, LATTICE + 1) if m == 1 or comb(m + parts - 1, m) <= MOST_STARTS)
        lattice = [
            np.bincount(chosen, minlength=parts) / steps
            for chosen in combinations_with_replacement(range(parts), steps)
        ]
        return np.vstack([self.pomdp.start, np.array(lattice) @ self.entry])

    def marginal(self, belief: Belief) -> Distribution:
        """What a belief (S,) says of the target; mass on the terminal state is left out."""
        mass = belief @ self.share
        total = mass.sum()
        return Distribution(self.values, mass / total if total > 0 else np.full(len(mass), 1 / len(mass)))

    def report(self, action: str) -> str | None:
        """The target value that an action reports, None when it is no report."""
        return self.reports.get(action)

    def report_action(self, value: str) -> str:
        """The first action that reports `value`."""
        for action, reported in self.reports.items():
            if reported == value:
                return action
        raise DomainError(f"no action reports {value!r}; {expected_one_of(tuple(self.reports.values()))}")

    def finished(self, belief: Belief) -> bool:
        """Whether a belief (S,) is certain of the terminal state."""
        return self.terminal is not None and bool(belief[self.terminal] > 1 - 1e-9)

    def program_for(self, confusion: ConfusionMatrix, smoothing: Fraction = JEFFREYS) -> Program:
        """The knowledge with a classifier's confusion matrix as its rules; the knowledge itself stays.

        Args:
            smoothing: of the matrix, see `ConfusionMatrix.rates`.
        """
        return with_classifier(
            self.program, self.attribute, self.target, confusion, self.label_of, smoothing=smoothing
        )

    @property
    def soft_program(self) -> Program:
        """The knowledge for soft evidence: the classifier's attribute stands for the truth itself.

        How far to trust a classifier is then said with each person, by the likelihood in the evidence.
        """
        never_wrong = ConfusionMatrix(self.values, np.eye(len(self.values)))
        return self.program_for(never_wrong, smoothing=Fraction(0))
