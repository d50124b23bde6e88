"""The reasoner: answers queries of a P-log program by compilation into circuits.

It compiles one circuit for each kind of question and caches circuits and answers. Two kinds of programs need
another method: programs with cr-rules are enumerated, as an observation can create worlds (the log reports
it); programs that are too large to be compiled are sampled (a `ReasoningWarning` reports it, and the answer
has confidence intervals), unless their evidence is too improbable for sampling.
"""

from __future__ import annotations

import logging
from collections.abc import Hashable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property, partial
from typing import TYPE_CHECKING, TypeVar

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError, check_type
from lcorpp.reasoning.answers import (
    QueryAnswer,
    Value,
    format_conditions,
    make_no_world_error,
    normalise_marginal,
)
from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Literal, Query
from lcorpp.reasoning.query_model import EnumeratedQuery, QueryModel
from lcorpp.reasoning.resolve import (
    check_rng,
    resolve_evidence,
    resolve_interventions,
    resolve_labels,
    resolve_query,
    resolve_subject,
    resolve_term,
)
from lcorpp.reasoning.transitions.transition_system import build_transition_system

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

NO_EVIDENCE: Mapping[str, str] = {}

_Value = TypeVar("_Value")


class Reasoner:
    """Answers queries of a program; `Enumeration` is the reference with the same methods.

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
        self._circuits: dict[Hashable, Circuit | TooLargeError] = {}
        self._answers: dict[Hashable, Distribution] = {}
        self._worlds: dict[Hashable, WorldQueries] = {}

    def __repr__(self) -> str:
        return f"Reasoner({self.program!r})"

    def __reduce__(self) -> tuple[partial[Reasoner], tuple[Program]]:
        return partial(Reasoner, samples=self.samples, seed=self.seed), (self.program,)  # without caches

    def posterior(
        self,
        attribute: str | Sequence[str],
        evidence: Mapping[str, Label] = NO_EVIDENCE,
        do: Mapping[str, str] = NO_EVIDENCE,
    ) -> Distribution:
        """Compute the marginal of an attribute, or of several jointly, given evidence and interventions.

        Args:
            attribute: an attribute or a term of one, such as ``roll(d1)``; or several, such as ``["item",
                "person"]``: the values are then tuples, ``("cup", "ann")``, of all combinations in order.
            evidence: term -> value, or -> the likelihood of each of its values. Integers and truth values
                may be given as such: 3 for ``3``, True for ``true``.
            do: term -> value.

        Raises:
            ProgramError: a name is unknown, `attribute` may have no value under the evidence, or a world
                violates a condition of the language.
            UndefinedError: no possible world satisfies the evidence.
            TooLargeError: the program is too large to be compiled, and the evidence too improbable for
                sampling; or the attributes have more than 10,000 combinations of values.
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
        self,
        attribute: str | Sequence[str],
        evidence: Mapping[str, str] = NO_EVIDENCE,
        do: Mapping[str, str] = NO_EVIDENCE,
    ) -> dict[Value, Fraction]:
        """Compute a posterior in fractions: value -> probability, in the order of the declaration.

        Raises:
            ProgramError, UndefinedError: as `posterior`.
            TooLargeError: the program is too large to be compiled.
        """
        term = resolve_subject(self.program, attribute)
        facts, set_to = resolve_evidence(self.program, evidence), resolve_interventions(self.program, do)
        if self.program.has_cr_rules:
            return self._enumeration.exact(attribute, facts, set_to)
        weights = self._get_world_queries(set_to, (term, *facts)).compute_exact_weights(term, facts)
        return normalise_marginal(self.program, term, weights, format_conditions(facts, set_to))

    def compile(
        self,
        inputs: Sequence[str],
        query: str | Sequence[str | Sequence[str]],
        do: Mapping[str, str] = NO_EVIDENCE,
    ) -> Circuit:
        """Compile the program into a circuit, a function of the evidence; see `Circuit`.

        Args:
            inputs: the terms that evidence may name; an attribute without arguments denotes all its terms.
            query: a term; the joint of several, ``"?item, person"``; or a sequence of such questions, each
                with an answer of its own.
            do: interventions, term -> value.

        Raises:
            ProgramError: a name is unknown, a world violates a condition of the language, or the program has
                cr-rules, whose worlds depend on the evidence.
            TooLargeError: the program is too large to be compiled.
        """
        from lcorpp.reasoning.circuit.compiler import compile_program  # imports numpy

        return compile_program(self.program, inputs, query, do)

    def filter(
        self,
        carried: Mapping[str, str],
        inputs: Sequence[str],
        query: str | Sequence[str],
        *,
        initial: Mapping[str, str] = NO_EVIDENCE,
        window: int = 0,
    ) -> Filter:
        """Compile a two-slice program into a filter, whose belief steps carry on; see `Filter`."""
        from lcorpp.reasoning.filtering import Filter  # imports numpy

        return Filter(self.program, carried, inputs, query, initial=initial, window=window)

    def sample(self, rng: np.random.Generator, given: Mapping[str, str] = NO_EVIDENCE) -> dict[str, str]:
        """Sample a possible world given evidence.

        Returns:
            term -> value.

        Raises:
            ProgramError, UndefinedError: as `posterior`.
            TooLargeError: the program is too large to be compiled.
        """
        check_rng(rng)
        if self.program.has_cr_rules:
            return self._enumeration.sample(rng, given)
        facts = resolve_evidence(self.program, given)
        world = self._get_world_queries({}, tuple(facts)).sample(rng, facts)
        if world is None:
            raise UndefinedError(f"{self.program.file}: no possible world{format_conditions(facts, {})}")
        return world

    def count(self) -> int:
        """Count the possible worlds of the program without listing them.

        Raises:
            ProgramError: a world violates a condition of the language.
            UndefinedError: no world has positive measure.
            TooLargeError: the program is too large to be compiled.
        """
        if self.program.has_cr_rules:
            return len(self._enumeration.worlds)
        worlds = self._get_world_queries({}, ())
        if not sum(worlds.compute_float_weights("", {}).values()):
            raise make_no_world_error(self.program, "")
        return worlds.count()

    def ask(self, query: Query, *, exact: bool = False) -> QueryAnswer:
        """Answer a query: compute a distribution or a probability.

        Args:
            exact: whether to return fractions.

        Returns:
            A number, or value -> number; `Estimate`s if the program is too large to be compiled.

        Raises:
            ProgramError, UndefinedError: as `posterior`.
            TooLargeError: the program is too large to be compiled, and `exact`, or the evidence is too
                improbable for sampling.
        """
        check_type(exact, bool, "exact", ProgramError)
        return self.build_query_model(query).answer(exact=exact)

    def build_query_model(self, query: Query) -> QueryModel | EnumeratedQuery:
        """Prepare a query: resolve its names, and ground the program under its conditions.

        Raises:
            ProgramError: a name in the query is unknown, or arithmetic is undefined.
        """
        query = resolve_query(self.program, query)
        if self.program.has_cr_rules:
            return EnumeratedQuery(self._enumeration, query)
        return QueryModel(self.program, query, samples=self.samples, seed=self.seed)

    # methods of answering

    def _compute_posterior(
        self, attribute: str | Sequence[str], evidence: Mapping[str, Label], do: Mapping[str, str]
    ) -> Distribution:
        term = resolve_subject(self.program, attribute)
        facts, likelihoods = resolve_labels(self.program, evidence)
        set_to = resolve_interventions(self.program, do)
        if self.program.has_cr_rules:
            if likelihoods:
                raise ProgramError(
                    f"{self.program.file}: soft evidence has no meaning for a program with cr-rules"
                )
            return self._enumeration.posterior(attribute, facts, set_to)
        names = sorted((*facts, *likelihoods))
        key = (term, frozenset(names), frozenset(set_to.items()))
        circuit = self._circuits.get(key)
        if circuit is None:
            try:
                circuit = self.compile(names, term, set_to)
            except TooLargeError as error:
                circuit = error  # cached, so that it is not compiled again
            _store(self._circuits, key, circuit)
        if not isinstance(circuit, TooLargeError):
            return circuit({**facts, **likelihoods})  # type: ignore[return-value]
        if likelihoods:
            raise TooLargeError(
                f"{self.program.file}: the program is too large to be compiled; soft evidence needs exact"
                " answers"
            )
        return self._estimate(circuit, term, facts, set_to)

    def _get_world_queries(self, do: Mapping[str, str], wanted: Sequence[str]) -> WorldQueries:
        key = frozenset(do.items()), frozenset(wanted)
        if key not in self._worlds:
            system = build_transition_system(ground_program(self.program, do, queried=wanted), wanted)
            _store(self._worlds, key, WorldQueries(build_decision_diagram(system)))
        return self._worlds[key]

    @cached_property
    def _enumeration(self) -> Enumeration:
        from lcorpp.reasoning.enumeration.reasoner import Enumeration  # imports numpy and clingo

        LOG.info("%s: a program with cr-rules is answered by enumeration", self.program.file)
        return Enumeration(self.program)

    def _estimate(
        self, reason: TooLargeError, term: str, facts: Mapping[str, str], do: Mapping[str, str]
    ) -> Distribution:
        from lcorpp.reasoning.estimation import EstimatedDistribution, drop_no_value, estimate_probabilities
        from lcorpp.reasoning.transitions.rejection_sampling import sample_worlds

        terms = {name: resolve_term(self.program, name) for name in facts}
        observed = [Literal(terms[name], "=", parse_term(value, name)) for name, value in facts.items()]
        ground = ground_program(self.program, do, observed, queried=(term,))
        system = build_transition_system(ground, (term,))
        found = sample_worlds(ground, system, term, self.samples, self.seed)
        estimates = estimate_probabilities(ground, found, reason, format_conditions(facts, do), stacklevel=5)
        return EstimatedDistribution.from_estimates(drop_no_value(ground, term, estimates))


def ask(program: Program, query: Query) -> QueryAnswer:
    """Answer one query in fractions: value -> probability, or a probability; see `Reasoner.ask`."""
    return Reasoner(program).ask(query, exact=True)


def _store(cache: dict[Hashable, _Value], key: Hashable, value: _Value) -> None:
    if len(cache) >= CACHE_SIZE:
        cache.clear()
    cache[key] = value
