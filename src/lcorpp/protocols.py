"""Protocols of the classifier, reasoner, planner, domain and world that the two algorithms combine.

`decision` imports nothing else of the other packages: any object with these methods can take part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from lcorpp.values import Array, Belief, Distribution, Label, SharedValue

Memory = tuple[int, ...]
"""What a form of answers remembers of a person's questions and answers so far; () for nothing."""

Starts = Sequence[tuple[Memory | None, Array]]
"""Possible memories at the start of a conversation, None for that before the first question, each with (W,)
its joint probability with each pair of a class of people and a value."""


class Classifier(Protocol):
    """rho of Algorithm 2, for one sense: predicts the class of a signal, e.g. of a trajectory."""

    def classify(self, signal: Array) -> Label | None:
        """Return the person's class or the likelihood of each class; None if the robot does not classify.

        Args:
            signal: (channels, time points) or (features,), see `values.Instance`.
        """


class Reasoner(Protocol):
    """theta of Algorithm 2: computes the marginal of the shared variables from evidence."""

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution | None:
        """Return the marginal of an attribute, or the joint marginal of several, given the evidence.

        Args:
            attribute: `DomainInterface.shared`.
            evidence: attribute -> value, or -> likelihood of its values (soft evidence).

        Returns:
            The marginal; its values are tuples for several attributes. None if the robot does not reason.

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
    """Translates between the names of classifiers, reasoner and planner; `domains.Domain` implements it."""

    @property
    def shared(self) -> str | tuple[str, ...]:
        """The attribute, or the attributes, shared by reasoner and planner."""

    @property
    def values(self) -> tuple[SharedValue, ...]:
        """The values of the shared attribute; of several, all tuples of their values."""

    def evidence(self, context: Mapping[str, str], labels: Mapping[str, Label]) -> Mapping[str, Label]:
        """Return the reasoner's evidence: the observed facts and the predicted class of each sense."""

    @property
    def label_attributes(self) -> tuple[str, ...]:
        """The attributes of the evidence that are outputs of classifiers; the others are observed facts."""

    @property
    def shared_label_attributes(self) -> tuple[str, ...]:
        """Those of classifiers of a shared variable."""

    def label_marginal(self, evidence: Mapping[str, Label]) -> Distribution | None:
        """Return the marginal of the shared variables by the labels alone; None if none is about them."""

    def class_of(self, sense: str, value: SharedValue) -> str:
        """Return the class that a sense should predict for a person of this shared value."""

    def prior(self, marginal: Distribution) -> Belief:
        """Return the planner's belief (S,) with the reasoner's marginal over the shared variables."""

    def marginal(self, belief: Belief) -> Distribution:
        """Return the distribution of the shared variables under a planner's belief (S,)."""

    def reported_value(self, action: str) -> SharedValue | None:
        """Return the shared value that `action` reports, None if `action` is not a report."""

    def report_action(self, value: SharedValue) -> str:
        """Return the action that reports `value`."""

    def is_terminal(self, belief: Belief) -> bool:
        """Return whether the terminal state has probability 1."""


class Dialogue(Protocol):
    """The planner's model as questions about the shared variables, for `lcorpp.trust`.

    A kind of question is an action in a situation of the planner's own variables. Kinds whose observations
    do not depend on the shared value are left out.
    """

    @property
    def tables(self) -> Array:
        """(K, V, O) the stated P(observation | value) of K kinds of questions and V shared values."""

    def find_answers(self, history: Sequence[tuple[str, str]], memory: Memory | None = None) -> Sequence[int]:
        """Return k * O + o for each action and observation that are a question of kind k and an answer o.

        Args:
            memory: of an earlier conversation with the person, of `find_memory`; None without.
        """

    def find_memory(self, history: Sequence[tuple[str, str]], memory: Memory | None = None) -> Memory | None:
        """Return what the next conversation with the person depends on; None for nothing.

        Args:
            memory: as of `find_answers`.
        """

    def start_known(
        self,
        planner: Planner,
        find_starts: Callable[[], Starts],
    ) -> Planner:
        """Return a planner of `make_planner` for a person whose class or memory is known in part.

        Args:
            find_starts: is called after the prior is known.
        """

    def make_planner(self, tables: Array, shares: Array | None = None) -> Planner:
        """Return the planner for the next person, who answers by these tables (K, V, O), not the stated ones.

        It is called after each person, so it is cheap where the tables have not changed.

        Args:
            shares: (C,) of the classes of people, if answers depend on the class.
        """

    def state(self) -> dict[str, Any]:
        """Return the state of the planners as JSON."""

    def restore(self, state: Mapping[str, Any]) -> Planner:
        """Continue from the state of an equal dialogue; return the planner of the last call."""

    @property
    def question(self) -> str | None:
        """The action to ask in order to learn, None if there is none."""

    @property
    def question_cost(self) -> float:
        """The mean cost of that action, in reward units; 0 if there is none."""
