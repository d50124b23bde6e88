"""What the two algorithms need of a classifier, a reasoner, a planner, a domain and a world.

Anything that has these methods can take part: `decision` knows nothing else of the other rooms.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from lcorpp.values import Belief, Distribution, Instance, Label


class Classifier(Protocol):
    """rho of Algorithm 2: from a trajectory to a class."""

    def classify(self, instance: Instance) -> Label | None:
        """The class of the person seen, or the likelihood of each; None where the robot does not classify."""


class Reasoner(Protocol):
    """theta of Algorithm 2: from evidence to the marginal of an attribute."""

    def posterior(self, attribute: str, evidence: Mapping[str, Label]) -> Distribution | None:
        """The marginal of `attribute` given the evidence (attribute -> value), or None without an opinion.

        A likelihood in place of a value is soft evidence: it weighs the values of its attribute.

        Raises:
            UndefinedError: the evidence is impossible.
        """


class Planner(Protocol):
    """pi of Algorithm 2, and the model it was computed from."""

    @property
    def start(self) -> Belief:
        """(S,) the belief to start from when nothing is known."""

    def action(self, belief: Belief) -> str:
        """The action of the policy at a belief (S,)."""

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """(S,) the belief after an action and an observation, by Bayes' rule.

        Raises:
            ObservationError: the observation is impossible.
        """


class World(Protocol):
    """Where actions are taken and observations made: simulated people, a console, a robot."""

    def act(self, action: str) -> str:
        """Do `action` and return what is observed."""

    def report(self, action: str) -> None:
        """Do the report action that ends the decision."""


class Vocabulary(Protocol):
    """What the words of one part mean to the next; a domain has it."""

    @property
    def target(self) -> str:
        """The attribute shared by reasoner and planner."""

    @property
    def values(self) -> tuple[str, ...]:
        """The values of the target."""

    def evidence(self, context: Mapping[str, str], label: Label | None) -> Mapping[str, Label]:
        """The observed facts and, where there is one, the classifier's label, for the reasoner."""

    def claim(self, evidence: Mapping[str, Label]) -> Label | None:
        """What the label in the evidence says of the target's values, None without a label."""

    def prior(self, marginal: Distribution) -> Belief:
        """(S,) the planner's belief that carries the reasoner's marginal."""

    def marginal(self, belief: Belief) -> Distribution:
        """What a planner's belief says of the target."""

    def report(self, action: str) -> str | None:
        """The value of the target that `action` reports, or None when it is no report."""

    def report_action(self, value: str) -> str:
        """The action that reports `value`."""

    def finished(self, belief: Belief) -> bool:
        """Whether the belief is certain that the terminal state is reached."""
