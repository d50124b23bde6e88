"""The reasoner: answers queries of a P-log program by compilation into circuits.

It compiles one circuit for each kind of question and caches circuits and answers. Programs with cr-rules are
enumerated, as an observation can create worlds (the log reports it); programs that are too large to be
compiled are sampled, and the answer has confidence intervals (a `ReasoningWarning` reports it).
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any

from lcorpp.errors import ProgramError, TooLargeError, check_type
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
from lcorpp.reasoning.query_model import QueryModel
from lcorpp.reasoning.questions import is_joint
from lcorpp.reasoning.resolve import (
    check_count,
    check_rng,
    make_query,
    resolve_evidence,
    resolve_expectation,
    resolve_interventions,
    resolve_labels,
    resolve_query,
    resolve_subject,
)

if TYPE_CHECKING:
    import numpy as np

    from lcorpp.reasoning.circuit.circuit import Circuit
    from lcorpp.reasoning.enumeration.reasoner import Enumeration
    from lcorpp.reasoning.filtering import Filter
    from lcorpp.values import Distribution, Label

LOG = logging.getLogger("lcorpp.reasoning")

DEFAULT_SAMPLES = 20_000
"""The default number of worlds sampled if a program is too large to be compiled."""

CACHE_SIZE = 1000
"""Maximal number of entries of each cache of a reasoner; a full cache is cleared."""

MAX_MODELS = 20
"""A reasoner keeps at most this many ground programs with their decision diagrams, which may be large."""
Subject = str | Sequence[str]
Facts = Mapping[str, str]
NOTHING: Facts = {}


class Reasoner:
    """Answers queries of a program; `Enumeration` is the reference.

    Args:
        program: the program.
        samples: the number of worlds sampled if the program is too large to be compiled; up to 16 times as
            many if few of them have the evidence.
        seed: of the samples; each answer starts with it.

    Raises:
        ProgramError: `samples` is not positive, or `seed` negative.
    """

    def __init__(self, program: Program, *, samples: int = DEFAULT_SAMPLES, seed: int = 0) -> None:
        check_type(program, Program, "program", ProgramError)
        for name, number, lowest in (("samples", samples, 1), ("seed", seed, 0)):
            check_type(number, int, name, ProgramError)
            if number < lowest:
                raise ProgramError(f"{name} is {number}; expected at least {lowest}")
        self.program, self.samples, self.seed = program, samples, seed
        self._circuits: dict[object, Circuit | TooLargeError] = {}
        self._answers: dict[object, Distribution] = {}
        self.build_model = lru_cache(MAX_MODELS)(partial(QueryModel, program))

    def __repr__(self) -> str:
        return f"Reasoner({self.program!r})"

    def __reduce__(self) -> tuple[partial[Reasoner], tuple[Program]]:
        return partial(Reasoner, samples=self.samples, seed=self.seed), (self.program,)  # without caches

    def posterior(
        self, attribute: Subject, evidence: Mapping[str, Label] = NOTHING, do: Facts = NOTHING
    ) -> Distribution:
        """Compute the marginal of an attribute, or of several jointly, given evidence and interventions.

        Args:
            attribute: an attribute or a term of one, such as ``roll(d1)``; or several, such as ``["item",
                "person"]``: the values are then tuples, ``("cup", "ann")``, of all combinations in order.
            evidence: term -> value, or -> the likelihood of each of its values. Integers and truth values
                may be given as such: 3 for ``3``, True for ``true``.
            do: term -> value.

        Returns:
            An `EstimatedDistribution`, with a `ReasoningWarning`, if the program is too large to be compiled.

        Raises:
            ProgramError: a name is unknown, `attribute` may have no value under the evidence, or a world
                violates a condition of the language.
            UndefinedError: no possible world satisfies the evidence.
            TooLargeError: the program is too large, and the evidence soft, or too improbable for sampling;
                or the attributes have more than 10,000 combinations of values.
        """
        try:
            asked = tuple(attribute) if isinstance(attribute, list) else attribute
            key = asked, tuple(evidence.items()), tuple(do.items())
            answer = self._answers.get(key)
        except (AttributeError, TypeError):  # no mapping, or an unhashable value
            answer = key = None
        if answer is None:
            answer = self._compute_posterior(attribute, evidence, do)
            # likelihoods rarely repeat, and 1 == True
            if key and all(isinstance(value, str) for value in (*evidence.values(), *do.values())):
                _store(self._answers, key, answer)
        return answer

    def exact(
        self, attribute: Subject, evidence: Facts = NOTHING, do: Facts = NOTHING
    ) -> dict[Value, Fraction]:
        """Compute a posterior in fractions: value -> probability, in the order of the declaration.

        Raises:
            ProgramError, UndefinedError: as `posterior`.
            TooLargeError: the program is too large to be compiled.
        """
        question = resolve_subject(self.program, attribute)
        facts, set_to = resolve_evidence(self.program, evidence), resolve_interventions(self.program, do)
        if self.program.has_cr_rules:
            return self._enumeration.exact(question, facts, set_to)
        model = self.build_model(make_query(self.program, "", {}, set_to), (question, *facts))
        weights = model.worlds.compute_exact_weights(question, facts)
        return normalise_marginal(self.program, question, weights, format_conditions(facts, set_to))

    def expect(self, expression: str, evidence: Mapping[str, Label] = NOTHING, do: Facts = NOTHING) -> float:
        """Compute an expectation given evidence and interventions, as `posterior`; `ask` gives fractions.

        Args:
            expression: of attributes with integer values, such as ``a*b - 2*roll(d1)``; division is exact.

        Raises:
            ProgramError: as `posterior`; or a value is no number, or the expression divides by zero.
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
        worlds = self.list_worlds(make_query(self.program, "", facts, set_to), count)
        if not worlds:
            raise make_no_world_error(self.program, format_conditions(facts, set_to))
        return worlds

    def list_worlds(self, query: Query, count: int) -> tuple[PossibleWorld, ...]:
        """List the most probable worlds under the conditions of a query, best first; see `most_probable`."""
        check_count(count)
        query = resolve_query(self.program, query)
        if self.program.has_cr_rules:
            return self._enumeration.list_worlds(query, count)
        return self.build_model(query).worlds.most_probable({}, count)

    def compile(self, inputs: Sequence[str], query: str | Sequence[Subject], do: Facts = NOTHING) -> Circuit:
        """Compile the program into a circuit, a function of the evidence; see `Circuit`.

        Args:
            inputs: the terms that evidence may name; an attribute without arguments denotes all its terms.
            query: a term; the joint of several, ``"?item, person"``; or a sequence of such questions, each
                with an answer of its own.

        Raises:
            ProgramError: a name is unknown, a world violates a condition of the language, or the program has
                cr-rules, whose worlds depend on the evidence.
            TooLargeError: the program is too large to be compiled.
        """
        from lcorpp.reasoning.circuit.compiler import compile_program  # imports numpy

        return compile_program(self.program, inputs, query, do)

    def filter(
        self,
        carried: Facts,
        inputs: Sequence[str],
        query: Subject,
        *,
        initial: Facts = NOTHING,
        window: int = 0,
    ) -> Filter:
        """Compile a two-slice program into a filter, whose belief steps carry on; see `Filter`."""
        from lcorpp.reasoning.filtering import Filter  # imports numpy

        return Filter(self.program, carried, inputs, query, initial=initial, window=window)

    def sample(self, rng: np.random.Generator, given: Facts = NOTHING) -> dict[str, str]:
        """Sample a possible world given evidence: term -> value. Raises the errors of `exact`."""
        check_rng(rng)
        if self.program.has_cr_rules:
            return self._enumeration.sample(rng, given)
        facts = resolve_evidence(self.program, given)
        world = self.build_model(Query(), tuple(facts)).worlds.sample(rng, facts)
        if world is None:
            raise make_no_world_error(self.program, format_conditions(facts, {}))
        return world

    def count(self) -> int:
        """Count the possible worlds of the program without listing them. Raises the errors of `exact`."""
        if self.program.has_cr_rules:
            return len(self._enumeration.worlds)
        if not self.list_worlds(Query(), 1):
            raise make_no_world_error(self.program, "")
        return self.build_model(Query()).worlds.count()

    def ask(self, query: Query, *, exact: bool = False) -> QueryAnswer:
        """Answer a query, see `parse_query`: compute a distribution, a probability or an expectation.

        Args:
            exact: whether to return fractions.

        Returns:
            A number, or value -> number; `Estimate`s if the program is too large to be compiled.

        Raises:
            ProgramError, UndefinedError: as `posterior`.
            TooLargeError: as `posterior`; or the program is too large to be compiled, and `exact`.
        """
        check_type(exact, bool, "exact", ProgramError)
        query = resolve_query(self.program, query)
        if self.program.has_cr_rules:
            return self._enumeration.ask(query, exact=exact)
        model = self.build_model(query)
        try:
            worlds = model.worlds
        except TooLargeError as error:
            from lcorpp.reasoning.estimation import estimate_answer  # imports numpy

            if exact:
                raise
            return estimate_answer(model, error, self.samples, self.seed)
        weigh = worlds.compute_exact_weights if exact else worlds.compute_float_weights
        return answer_query(self.program, query, lambda question: weigh(question, {}))

    def _compute_posterior(
        self, attribute: Subject, evidence: Mapping[str, Label], do: Facts
    ) -> Distribution:
        question = resolve_subject(self.program, attribute)
        facts, likelihoods = resolve_labels(self.program, evidence)
        set_to = resolve_interventions(self.program, do)
        if self.program.has_cr_rules:
            if likelihoods:
                file = self.program.file
                raise ProgramError(f"{file}: soft evidence has no meaning for a program with cr-rules")
            return self._enumeration.posterior(question, facts, set_to)
        names = tuple(sorted((*facts, *likelihoods)))
        key = question, names, frozenset(set_to.items())
        if key not in self._circuits:
            try:
                _store(self._circuits, key, self.compile(names, question, set_to))
            except TooLargeError as error:
                _store(self._circuits, key, error)  # so that it is not compiled again
        circuit = self._circuits[key]
        if not isinstance(circuit, TooLargeError):
            return circuit({**facts, **likelihoods})  # type: ignore[return-value]
        if likelihoods:
            raise TooLargeError(f"{circuit}; soft evidence needs an exact answer")
        from lcorpp.reasoning.estimation import EstimatedDistribution, estimate_answer

        model = self.build_model(make_query(self.program, question, facts, set_to))
        return EstimatedDistribution.from_estimates(
            estimate_answer(model, circuit, self.samples, self.seed), is_joint(question)
        )

    @cached_property
    def _enumeration(self) -> Enumeration:
        from lcorpp.reasoning.enumeration.reasoner import Enumeration  # imports numpy and clingo

        LOG.info("%s: a program with cr-rules is answered by enumeration", self.program.file)
        return Enumeration(self.program)


def ask(program: Program, query: Query) -> QueryAnswer:
    """Answer one query in fractions: value -> probability, or a number; see `Reasoner.ask`."""
    return Reasoner(program).ask(query, exact=True)


def _store(cache: dict[Any, Any], key: object, value: object) -> None:
    if len(cache) >= CACHE_SIZE:
        cache.clear()
    cache[key] = value
