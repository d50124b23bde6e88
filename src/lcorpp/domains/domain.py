"""A domain: translates between the names of classifier, reasoner and planner."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement
from math import comb
from pathlib import Path

import numpy as np

from lcorpp.domains.sections.learning import LearningSection
from lcorpp.domains.sections.planning import PlanningSection
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.sections.simulation import SimulationSection
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.planning import Pomdp
from lcorpp.reasoning import Program, with_classifier
from lcorpp.values import JEFFREYS, Array, Belief, ConfusionMatrix, Distribution, Label, Likelihood

MAX_GRID_STEPS, MAX_PRIORS = 10, 36
"""Limits of the grid of priors in `Domain.start_beliefs`: grid steps from 0 to 1, and number of priors."""

TERMINAL_TOLERANCE = 1e-9
"""Rounding error of the probability 1 of the terminal state."""


@dataclass(frozen=True, eq=False, repr=False)
class Domain:
    """Contents of a domain folder, checked as a whole by `load_domain`.

    name, description: for reports. folder: its path.
    preset: name of the chosen preset, None without one.
    reasoning, learning, planning, simulation: the sections of its `domain.toml`.
    """

    name: str
    description: str
    folder: Path
    preset: str | None
    reasoning: ReasoningSection
    learning: LearningSection
    planning: PlanningSection
    simulation: SimulationSection

    def __repr__(self) -> str:
        preset = f", preset {self.preset!r}" if self.preset else ""
        pomdp = self.pomdp
        return (
            f"Domain({self.name!r}{preset}: observes {', '.join(self.observed) or 'nothing'}; target"
            f" {self.target} ({', '.join(self.values)}); POMDP with {len(pomdp.states)} states,"
            f" {len(pomdp.actions)} actions, {len(pomdp.observations)} observations)"
        )

    @property
    def program(self) -> Program:
        """The P-log program of what the robot knows: theta."""
        return self.reasoning.program

    @property
    def observed(self) -> tuple[str, ...]:
        """The attributes that the robot observes as facts."""
        return self.reasoning.observed

    @property
    def target(self) -> str:
        """The attribute shared by reasoner and planner."""
        return self.reasoning.target

    @property
    def values(self) -> tuple[str, ...]:
        """The values of the target, in the order of their declaration."""
        return self.reasoning.values

    @property
    def pomdp(self) -> Pomdp:
        """The planner's model: M."""
        return self.planning.pomdp

    def evidence(self, context: Mapping[str, str], predicted: Label | None) -> Mapping[str, Label]:
        """The reasoner's evidence: the observed facts and the label of the predicted class.

        Args:
            context: observed attribute -> value.
            predicted: the classifier's output: a class, or a likelihood over all classes, which becomes a
                likelihood over their labels, as `soft_program` expects; None adds no label.

        Returns:
            Attribute -> value; the classifier's attribute -> label, or -> likelihood over its labels.

        Raises:
            DomainError: an unknown fact or class, or a likelihood over other classes.
        """
        for name, value in context.items():
            if name not in self.observed:
                raise DomainError(
                    f"{name!r} is not observed in {self.name}; {expected_one_of(self.observed)}"
                )
            known = self.program.attributes[name].values
            if value not in known:
                raise DomainError(f"{name} cannot be {value!r}; {expected_one_of(known)}")
        if predicted is None:
            return dict(context)
        attribute, label_of_class = self.learning.attribute, self.learning.label_of
        if isinstance(predicted, Likelihood):
            if set(predicted.values) != set(label_of_class):
                raise DomainError(
                    f"a likelihood over {', '.join(predicted.values)}; expected the classes"
                    f" {', '.join(label_of_class)}"
                )
            return {**context, attribute: predicted.rename(label_of_class)}
        if predicted not in label_of_class:
            raise DomainError(f"unknown class {predicted!r}; {expected_one_of(label_of_class)}")
        return {**context, attribute: label_of_class[predicted]}

    def target_of_label(self, evidence: Mapping[str, Label]) -> Label | None:
        """The target value of the label in the evidence, None without a label: the inverse of `evidence`.

        A likelihood over labels becomes a likelihood over the target values, in their order.
        """
        label, label_of_class = evidence.get(self.learning.attribute), self.learning.label_of
        if isinstance(label, Likelihood):
            weight_of_label = dict(label)
            weights = [weight_of_label[label_of_class[value]] for value in self.values]
            return Likelihood(self.values, np.array(weights))
        return next((value for value, name in label_of_class.items() if name == label), None)

    def prior(self, marginal: Distribution) -> Belief:
        """(S,) the planner's belief with the reasoner's marginal; other variables at their initial values.

        Args:
            marginal: over the values of the target, in their order.
        """
        return marginal.probabilities @ self.planning.initial_states

    def start_beliefs(self) -> Array:
        """(N, S) beliefs to solve the model for: its own initial belief, and a grid of priors.

        The prior differs from person to person, and a policy is only good near the beliefs it was computed
        for. The grid covers the simplex of priors, hence every marginal that a reasoner may return.
        """
        n = len(self.values)
        # the finest grid of at most MAX_PRIORS priors; one step gives a prior for each value, however many
        steps = max(m for m in range(1, MAX_GRID_STEPS + 1) if m == 1 or comb(m + n - 1, m) <= MAX_PRIORS)
        grid = [
            np.bincount(values, minlength=n) / steps
            for values in combinations_with_replacement(range(n), steps)
        ]
        return np.vstack([self.pomdp.start, np.array(grid) @ self.planning.initial_states])

    def marginal(self, belief: Belief) -> Distribution:
        """The target's distribution under a belief (S,), given that the state is not terminal.

        The distribution is uniform if the terminal state has probability 1.
        """
        mass = belief @ self.planning.state_values
        total = mass.sum()
        return Distribution(self.values, mass / total if total > 0 else np.full(len(mass), 1 / len(mass)))

    def reported_value(self, action: str) -> str | None:
        """The target value that an action reports, None if it is no report."""
        return self.planning.reports.get(action)

    def report_action(self, value: str) -> str:
        """The first action that reports `value`.

        Raises:
            DomainError: no action reports it.
        """
        for action, reported in self.planning.reports.items():
            if reported == value:
                return action
        raise DomainError(f"no action reports {value!r}; {expected_one_of(self.planning.reports.values())}")

    def is_terminal(self, belief: Belief) -> bool:
        """Whether the terminal state has probability 1 under a belief (S,)."""
        terminal = self.planning.terminal
        return terminal is not None and bool(belief[terminal] > 1 - TERMINAL_TOLERANCE)

    def program_for(self, confusion: ConfusionMatrix, smoothing: Fraction = JEFFREYS) -> Program:
        """The P-log program with the classifier's rules replaced by a confusion matrix.

        Args:
            confusion: its classes are the values of the target.
            smoothing: pseudo-count, see `ConfusionMatrix.rates`.
        """
        attribute, label_of = self.learning.attribute, self.learning.label_of
        return with_classifier(self.program, attribute, self.target, confusion, label_of, smoothing=smoothing)

    @property
    def soft_program(self) -> Program:
        """The P-log program for soft evidence: the label equals the target value.

        The likelihood in each person's evidence then expresses the classifier's uncertainty.
        """
        never_wrong = ConfusionMatrix(self.values, np.eye(len(self.values)))
        return self.program_for(never_wrong, smoothing=Fraction(0))
