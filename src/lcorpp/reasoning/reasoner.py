"""The reasoner: answers queries of a P-log program by compilation into circuits.

It compiles one circuit for each kind of question and caches circuits and answers. Programs with cr-rules are
enumerated, as an observation can create worlds (the log reports it); programs that are too large to be
compiled are sampled, and the answer has confidence intervals (a `ReasoningWarning` reports it).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any, overload

from lcorpp.errors import LcorppError, ProgramError, TooLargeError, check_type
from lcorpp.reasoning.answers import QueryAnswer
from lcorpp.reasoning.inference import NOTHING, Facts, Inference, Subject, Worlds
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.query_model import QueryModel
from lcorpp.reasoning.questions import is_joint
from lcorpp.reasoning.resolve import (
    check_at_least,
    make_query,
    resolve_inputs,
    resolve_interventions,
    resolve_labels,
    resolve_query,
    resolve_subject,
)

if TYPE_CHECKING:
    from lcorpp.reasoning.circuit.circuit import Circuit
    from lcorpp.reasoning.enumeration.reasoner import Enumeration
    from lcorpp.reasoning.factors.network import TableNetwork
    from lcorpp.reasoning.filtering import Filter
    from lcorpp.values import Distribution, Label

LOG = logging.getLogger("lcorpp.reasoning")

DEFAULT_SAMPLES = 20_000
"""The default number of worlds sampled if a program is too large to be compiled."""

CACHE_SIZE = 1000
"""Maximal number of entries of each cache of a reasoner; a full cache is cleared."""

MAX_MODELS = 20
"""A reasoner keeps at most this many ground programs with their decision diagrams, which may be large."""


class Reasoner(Inference):
    """Answers queries of a program; `Enumeration` is the reference.

    Args:
        program: the program.
        samples: the number of worlds sampled if the program is too large to be compiled; up to 16 times as
            many if few of them have the evidence.
        seed: of the samples; each answer starts with it.

    Raises:
        ProgramError: `samples` is not positive, or `seed` negative.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> coins = parse_plog("a, b : boolean. random(a). random(b). pr(b | a) = 3/4. pr(b | -a) = 1/4.")
        >>> reasoner = Reasoner(coins)
        >>> reasoner.posterior("a", {"b": "true"})
        Distribution(true: 0.75, false: 0.25)
        >>> reasoner.posterior("a", do={"b": "true"})  # an intervention on b leaves a as it was
        Distribution(true: 0.5, false: 0.5)
    """

    def __init__(self, program: Program, *, samples: int = DEFAULT_SAMPLES, seed: int = 0) -> None:
        check_type(program, Program, "program", ProgramError)
        check_at_least(samples, 1, "samples")
        check_at_least(seed, 0, "seed")
        self.program, self.samples, self.seed = program, samples, seed
        self._circuits: dict[object, Circuit | TooLargeError] = {}
        self._answers: dict[object, Distribution] = {}
        self._known: dict[object, Circuit] = {}  # by question and terms as they are spelled
        self._networks: dict[object, TableNetwork] = {}
        self._find_model = lru_cache(MAX_MODELS)(partial(QueryModel, program))

    def __repr__(self) -> str:
        return f"Reasoner({self.program!r})"

    def __reduce__(self) -> tuple[partial[Reasoner], tuple[Program]]:
        return partial(Reasoner, samples=self.samples, seed=self.seed), (self.program,)  # without caches

    def build_model(self, query: Query, terms: tuple[str, ...] = ()) -> QueryModel:
        """Ground the program for a query, see `QueryModel`; models are cached."""
        return self._find_model(query, terms)

    def find_worlds(self, query: Query, terms: tuple[str, ...] = ()) -> Worlds:
        """Find the worlds that satisfy the conditions of a resolved query, see `Inference`."""
        if self.program.has_cr_rules:
            return self._enumeration.find_worlds(query)
        return self.build_model(query, terms).worlds

    def posterior(
        self, attribute: Subject, evidence: Mapping[str, Label] = NOTHING, do: Facts = NOTHING
    ) -> Distribution:
        """Compute a marginal given evidence and interventions, see `Inference.posterior`.

        Args:
            evidence: term -> value, or -> the likelihood of each of its values.

        Returns:
            An `EstimatedDistribution`, with a `ReasoningWarning`, if the program is too large to be compiled.

        Raises:
            TooLargeError: also if the program is too large, and the evidence soft, or too improbable for
                sampling.
        """
        try:
            asked = tuple(attribute) if isinstance(attribute, list) else attribute
            key = asked, tuple(evidence.items()), tuple(do.items())
            answer = self._answers.get(key)
        except (AttributeError, TypeError):  # no mapping, or an unhashable value
            answer = key = None
        if answer is None and key and not do and (circuit := self._known.get((asked, tuple(evidence)))):
            with suppress(TooLargeError):  # then worlds are sampled
                return circuit(evidence)  # type: ignore[return-value]  # the names are resolved, and it caches
        if answer is None:
            answer = self._compute_posterior(attribute, evidence, do)
            # likelihoods rarely repeat, and 1 == True
            if key and all(isinstance(value, str) for value in (*evidence.values(), *do.values())):
                _store(self._answers, key, answer)
        return answer

    @overload
    def posteriors(
        self, attribute: Subject, evidence: Sequence[Mapping[str, Label]]
    ) -> list[Distribution]: ...

    @overload
    def posteriors(
        self, attribute: None = None, evidence: Mapping[str, Label] = NOTHING
    ) -> dict[str, Distribution]: ...

    @overload
    def posteriors(
        self, attribute: None, evidence: Sequence[Mapping[str, Label]]
    ) -> list[dict[str, Distribution]]: ...

    def posteriors(
        self,
        attribute: Subject | None = None,
        evidence: Mapping[str, Label] | Sequence[Mapping[str, Label]] = NOTHING,
    ) -> list[Distribution] | dict[str, Distribution] | list[dict[str, Distribution]]:
        """Compute the posteriors given many pieces of evidence, or those of all terms, in one pass.

        They equal those of `posterior` up to rounding errors. A program without a circuit answers one after
        the other.

        Args:
            attribute: as in `posterior`; None for each term that has a value in all worlds with the evidence.
            evidence: pieces of evidence, which may name different terms; for all terms also a single one.

        Returns:
            A distribution for each evidence; of all terms term -> distribution.

        Raises:
            ProgramError, UndefinedError, TooLargeError: as `posterior`, for the first wrong evidence.

        Examples:
            >>> from lcorpp import Reasoner, parse_plog
            >>> coins = parse_plog("a, b : boolean. random(a). random(b). pr(b | a) = 3/4. pr(b | -a) = 1/4.")
            >>> Reasoner(coins).posteriors("a", [{"b": "true"}, {"b": "false"}])
            [Distribution(true: 0.75, false: 0.25), Distribution(true: 0.25, false: 0.75)]
            >>> Reasoner(coins).posteriors(evidence={"b": "true"})["a"]
            Distribution(true: 0.75, false: 0.25)
        """
        if attribute is None:
            from lcorpp.reasoning.marginals import compute_marginals  # imports numpy

            return compute_marginals(self.program, evidence, self._compile_all)
        if isinstance(evidence, Mapping):
            raise ProgramError(
                f"expected a sequence of evidence for {attribute!r}; one evidence is for posterior"
            )
        from lcorpp.values import Distribution  # imports numpy

        names = tuple(sorted({name for each in evidence for name in each}))
        if names:
            try:
                question = resolve_subject(self.program, attribute)
                circuit = self._find_circuit(question, names, NOTHING)
                if not isinstance(circuit, TooLargeError):
                    rows: Any = circuit({name: [each.get(name) for each in evidence] for name in names})
                    return [Distribution(circuit.values[question], row) for row in rows]
            except LcorppError:
                pass  # one by one the evidence is found that is wrong
        return [self.posterior(attribute, each) for each in evidence]

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

        return compile_program(self.program, inputs, query, do, self._networks)

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

    def ask(
        self, query: Query, *, exact: bool = False, progress: Callable[[float, str], None] | None = None
    ) -> QueryAnswer:
        """Answer a query, see `Inference.ask`; in `Estimate`s if the program is too large to be compiled.

        Args:
            progress: called in long work with its share and a text: the arcs of the decision diagram so far,
                or the numbers of sampled worlds.
        """
        if not self.program.has_cr_rules:
            query = resolve_query(self.program, query)
            self.build_model(query).progress = progress
        try:
            return super().ask(query, exact=exact)
        except TooLargeError as error:
            if exact or self.program.has_cr_rules:
                raise
            from lcorpp.reasoning.estimation import estimate_answer  # imports numpy

            model = self.build_model(query)
            return estimate_answer(model, error, self.samples, self.seed, progress)

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
            return super().posterior(question, facts, set_to)
        names = tuple(sorted((*facts, *likelihoods)))
        circuit = self._find_circuit(question, names, set_to)
        if not isinstance(circuit, TooLargeError):
            try:
                answer: Distribution = circuit({**facts, **likelihoods})  # type: ignore[assignment]
            except TooLargeError as error:
                circuit = error
            else:
                if len(names) == len(evidence) and not set_to:
                    asked = tuple(attribute) if isinstance(attribute, list) else attribute
                    _store(self._known, (asked, tuple(evidence)), circuit)
                return answer
        if likelihoods:
            raise TooLargeError(f"{circuit}; soft evidence needs an exact answer")
        from lcorpp.reasoning.estimation import EstimatedDistribution, estimate_answer

        model = self.build_model(make_query(self.program, question, facts, set_to))
        return EstimatedDistribution.from_estimates(
            estimate_answer(model, circuit, self.samples, self.seed), is_joint(question)
        )

    def _find_circuit(self, question: str, names: tuple[str, ...], do: Facts) -> Circuit | TooLargeError:
        """Return the circuit for a question given these terms, compiled once, or why there is none."""
        key = question, names, frozenset(do.items())
        if key not in self._circuits:
            try:
                _store(self._circuits, key, self.compile(names, question, do))
            except TooLargeError as error:
                _store(self._circuits, key, error)  # so that it is not compiled again
        return self._circuits[key]

    def _compile_all(self, names: tuple[str, ...]) -> Circuit:
        """Return the circuit for all terms given these, compiled once."""
        key = None, names
        if key not in self._circuits:
            terms = resolve_inputs(self.program, list(self.program.attributes))
            _store(self._circuits, key, self.compile(names, terms))
        return self._circuits[key]  # type: ignore[return-value]

    @cached_property
    def _enumeration(self) -> Enumeration:
        from lcorpp.reasoning.enumeration.reasoner import Enumeration  # loads clingo

        LOG.info("%s: a program with cr-rules is answered by enumeration", self.program.file)
        return Enumeration(self.program)


def ask(program: Program, query: Query) -> QueryAnswer:
    """Answer one query in fractions: value -> probability, or a number; see `Reasoner.ask`.

    Examples:
        >>> from lcorpp.reasoning import ask, parse_plog, parse_query
        >>> die = parse_plog("sides = {1..6}. roll : sides. random(roll).")
        >>> str(ask(die, parse_query("?{roll > 4}.", die)))
        '1/3'
    """
    return Reasoner(program).ask(query, exact=True)


def _store(cache: dict[Any, Any], key: object, value: object) -> None:
    if len(cache) >= CACHE_SIZE:
        cache.clear()
    cache[key] = value
