"""Protocols of the classifier, reasoner, planner, domain and world that the two algorithms combine.

`decision` imports nothing else of the other packages: any object with these methods can take part.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from lcorpp.values import Belief, Distribution, Instance, Label


class Classifier(Protocol):
    """rho of Algorithm 2: predicts the class of a trajectory."""

    def classify(self, instance: Instance) -> Label | None:
        """Return the person's class or the likelihood of each class; None if the robot does not classify."""


class Reasoner(Protocol):
    """theta of Algorithm 2: computes the marginal of an attribute from evidence."""

    def posterior(self, attribute: str, evidence: Mapping[str, Label]) -> Distribution | None:
        """Return the marginal of `attribute` given the evidence; None if the robot does not reason.

        Args:
            evidence: attribute -> value, or -> likelihood of its values (soft evidence).

        Raises:
            UndefinedError: the evidence is impossible.
        """


class Planner(Protocol):
    """pi of Algorithm 2, and the model it was computed from."""

    @property
    def start(self) -> Belief:
        """(S,) the model's initial belief, used without a prior."""

    def action(self, belief: Belief) -> str:
        """Return the policy's action at a belief (S,)."""

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief (S,) after an action and an observation, by Bayes' rule.

        Raises:
            ObservationError: the observation is impossible.
        """


class World(Protocol):
    """Executes actions and returns observations: simulated people, a console, a robot."""

    def act(self, action: str) -> str:
        """Execute `action` and return the observation."""

    def report(self, action: str) -> None:
        """Execute the report action that ends the decision."""


class DomainInterface(Protocol):
    """Translates between the names of classifier, reasoner and planner; `domains.Domain` implements it."""

    @property
    def target(self) -> str:
        """The attribute shared by reasoner and planner."""

    @property
    def values(self) -> tuple[str, ...]:
        """The values of the target."""

    def evidence(self, context: Mapping[str, str], predicted: Label | None) -> Mapping[str, Label]:
        """Return the reasoner's evidence: the observed facts and, if there is one, the predicted class."""

    def target_of_label(self, evidence: Mapping[str, Label]) -> Label | None:
        """Return the target value (or likelihood of the values) of the label in the evidence, if any."""

    def prior(self, marginal: Distribution) -> Belief:
        """Return the planner's belief (S,) with the reasoner's marginal over the target."""

    def marginal(self, belief: Belief) -> Distribution:
        """Return the target's distribution under a planner's belief (S,)."""

    def reported_value(self, action: str) -> str | None:
        """Return the target value that `action` reports, None if `action` is no report."""

    def report_action(self, value: str) -> str:
        """Return the action that reports `value`."""

    def is_terminal(self, belief: Belief) -> bool:
        """Return whether the terminal state has probability 1."""
