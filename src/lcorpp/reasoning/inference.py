"""What can be asked of a program, whichever engine computes the answer.

Names are resolved, evidence is checked, and answers and errors are formed here. An engine finds the worlds
that satisfy the conditions of a query, and weighs, orders, counts and samples them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Protocol

from lcorpp.errors import ProgramError, check_type
from lcorpp.reasoning.answers import (
    PossibleWorld,
    QueryAnswer,
    Value,
    answer_query,
    compute_expectation,
    format_conditions,
    make_no_world_error,
    normalise_marginal,
    rank_values,
)
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.resolve import (
    check_count,
    check_rng,
    make_query,
    resolve_evidence,
    resolve_expectation,
    resolve_interventions,
    resolve_query,
    resolve_subject,
)

if TYPE_CHECKING:
    import numpy as np

    from lcorpp.values import Distribution, Label

Subject = str | Sequence[str]
Facts = Mapping[str, str]
NOTHING: Facts = {}
"""No evidence, no interventions."""


class Worlds(Protocol):
    """The possible worlds that satisfy the conditions of a query; facts (term -> value) are more evidence."""

    def compute_exact_weights(self, question: str, facts: Facts, /) -> Mapping[Value, Fraction]:
        """Sum the measures of the worlds by the value of a question; "" is for no value."""

    def compute_float_weights(self, question: str, facts: Facts, /) -> Mapping[Value, float]:
        """Sum as `compute_exact_weights` in floating point; only the ratios matter."""

    def most_probable(self, facts: Facts, count: int, /) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds, best first; none if the conditions are impossible."""

    def sample(self, count: int, rng: np.random.Generator, facts: Facts, /) -> list[dict[str, str]] | None:
        """Draw worlds with their probabilities; None if the conditions are impossible."""

    def count(self) -> int:
        """Count the worlds."""


class Inference(ABC):
    """Answers questions about a program from the worlds that an engine finds."""

    program: Program

    @abstractmethod
    def find_worlds(self, query: Query, terms: tuple[str, ...] = ()) -> Worlds:
        """Find the worlds that satisfy the conditions of a resolved query.

        Args:
            terms: the terms and joints that further questions and facts will name.
        """

    def posterior(
        self, attribute: Subject, evidence: Mapping[str, Label] = NOTHING, do: Facts = NOTHING
    ) -> Distribution:
        """Compute the marginal of an attribute, or of several jointly, given evidence and interventions.

        Args:
            attribute: an attribute or a term of one, such as ``roll(d1)``; or several, such as ``["item",
                "person"]``: the values are then tuples, ``("cup", "ann")``, of all combinations in order.
            evidence: term -> value. Integers and truth values may be given as such: 3 for ``3``, True for
                ``true``.
            do: term -> value.

        Raises:
            ProgramError: a name is unknown, `attribute` may have no value under the evidence, or a world
                violates a condition of the language.
            UndefinedError: no possible world satisfies the evidence.
            TooLargeError: the attributes have more than 10,000 combinations of values.
        """
        import numpy as np

        from lcorpp.values import Distribution

        marginal = self.exact(attribute, evidence, do)  # type: ignore[arg-type]
        return Distribution(tuple(marginal), np.array([float(p) for p in marginal.values()]))

    def exact(
        self, attribute: Subject, evidence: Facts = NOTHING, do: Facts = NOTHING
    ) -> dict[Value, Fraction]:
        """Compute a posterior in fractions: value -> probability, in the order of the declaration.

        Raises:
            ProgramError, UndefinedError: as `posterior`.
            TooLargeError: as `posterior`; or the program is too large to be compiled.
        """
        question = resolve_subject(self.program, attribute)
        facts, set_to = resolve_evidence(self.program, evidence), resolve_interventions(self.program, do)
        worlds = self.find_worlds(make_query(self.program, "", {}, set_to), (question, *facts))
        weights = worlds.compute_exact_weights(question, facts)
        return normalise_marginal(self.program, question, weights, format_conditions(facts, set_to))

    def expect(self, expression: str, evidence: Mapping[str, Label] = NOTHING, do: Facts = NOTHING) -> float:
        """Compute an expectation given evidence and interventions, as `posterior`; `ask` gives fractions.

        Args:
            expression: of attributes with integer values, such as ``a*b - 2*roll(d1)``; division is exact.

        Raises:
            ProgramError: as `posterior`; or a value is not a number, or the expression divides by zero.
            UndefinedError, TooLargeError: as `posterior`.
        """
        query = resolve_expectation(self.program, expression)
        return compute_expectation(query, lambda question: dict(self.posterior(question, evidence, do)))  # type: ignore[return-value]

    def most_probable(
        self, evidence: Facts = NOTHING, count: int = 1, *, of: Subject | None = None, do: Facts = NOTHING
    ) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds, or the most probable joint values of some attributes.

        Args:
            count: how many, at most 100,000; those of probability 0 are left out.
            of: attributes, all others are summed out (marginal MAP); by default whole worlds.

        Returns:
            Worlds, with the values of these attributes only, and their probabilities given the evidence.

        Raises:
            ProgramError, UndefinedError, TooLargeError: as `exact`.
        """
        check_count(count)
        if of is not None:
            question = resolve_subject(self.program, [of] if isinstance(of, str) else of)
            return rank_values(question, self.exact(question, evidence, do), count)
        facts, set_to = resolve_evidence(self.program, evidence), resolve_interventions(self.program, do)
        query = make_query(self.program, "", {}, set_to)  # the same for all evidence about these terms
        worlds = self.find_worlds(query, tuple(facts)).most_probable(facts, count)
        if not worlds:
            raise make_no_world_error(self.program, format_conditions(facts, set_to))
        return worlds

    def list_worlds(self, query: Query, count: int) -> tuple[PossibleWorld, ...]:
        """List the most probable worlds under the conditions of a query, best first; see `most_probable`."""
        check_count(count)
        return self.find_worlds(resolve_query(self.program, query)).most_probable({}, count)

    def sample(self, rng: np.random.Generator, given: Facts = NOTHING) -> dict[str, str]:
        """Sample a possible world given evidence: term -> value. Raises the errors of `exact`."""
        return self.sample_many(1, rng, given)[0]

    def sample_many(
        self, count: int, rng: np.random.Generator, given: Facts = NOTHING
    ) -> list[dict[str, str]]:
        """Sample `count` possible worlds: the results of `count` calls of `sample`, faster."""
        check_type(count, int, "count", ProgramError)
        check_rng(rng)
        facts = resolve_evidence(self.program, given)
        worlds = self.find_worlds(Query(), tuple(facts)).sample(count, rng, facts)
        if worlds is None:
            raise make_no_world_error(self.program, format_conditions(facts, {}))
        return worlds

    def count(self) -> int:
        """Count the possible worlds of the program without listing them. Raises the errors of `exact`."""
        if not self.list_worlds(Query(), 1):
            raise make_no_world_error(self.program, "")
        return self.find_worlds(Query()).count()

    def ask(self, query: Query, *, exact: bool = False) -> QueryAnswer:
        """Answer a query, see `parse_query`: compute a distribution, a probability or an expectation.

        Args:
            exact: whether to return fractions.

        Returns:
            A number, or value -> number.

        Raises:
            ProgramError, UndefinedError, TooLargeError: as `exact`.
        """
        check_type(exact, bool, "exact", ProgramError)
        query = resolve_query(self.program, query)
        worlds = self.find_worlds(query)
        weigh = worlds.compute_exact_weights if exact else worlds.compute_float_weights
        return answer_query(self.program, query, lambda question: weigh(question, {}))
