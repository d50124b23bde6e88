"""The reasoner: it compiles a program for each kind of question, once, and says so when it must do otherwise.

Programs with cr-rules are enumerated, as an observation can create worlds. Programs with more states than
can be compiled are answered by likelihood weighting; a `ReasoningWarning` says so, and the answer carries
its standard errors.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Hashable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, TypeVar

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError
from lcorpp.reasoning.circuit.trellis import build_trellis
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.errors import format_conditions, no_value_error, no_world_error
from lcorpp.reasoning.gc_pause import gc_paused
from lcorpp.reasoning.grounding.grounder import QUERY_TERM
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query, Term
from lcorpp.reasoning.resolve import resolve_evidence, resolve_interventions, resolve_term
from lcorpp.reasoning.transitions.likelihood_weighting import DEFAULT_SAMPLES, SampleEstimates, estimate
from lcorpp.reasoning.transitions.transition_system import build_transition_system

if TYPE_CHECKING:
    import numpy as np

    from lcorpp.reasoning.circuit.circuit import Circuit
    from lcorpp.reasoning.enumeration.reasoner import Enumeration
    from lcorpp.reasoning.soft_evidence import SoftEvidence
    from lcorpp.values import Distribution, Label

LOG = logging.getLogger("lcorpp.reasoning")

KEPT = 1000
"""How many circuits and answers a reasoner keeps before it begins anew."""

NOTHING: Mapping[str, str] = {}

_Kept = TypeVar("_Kept")


class ReasoningWarning(UserWarning):
    """An answer was not found by the compiled engine."""


class Reasoner:
    """Answers queries of a program; it compiles each kind of question once and keeps the answers.

    Args:
        program: the program.
        samples: how many worlds are drawn where likelihood weighting must serve.
    """

    def __init__(self, program: Program, *, samples: int = DEFAULT_SAMPLES) -> None:
        self.program, self.samples = program, samples
        self._circuits: dict[Hashable, Circuit | TooLargeError] = {}
        self._answers: dict[Hashable, Distribution] = {}
        self._paths: dict[Hashable, WorldQueries] = {}
        self._weighing: dict[Hashable, SoftEvidence] = {}

    def __reduce__(self) -> tuple[Callable[[Program, int], Reasoner], tuple[Program, int]]:
        return _again, (self.program, self.samples)

    def posterior(
        self, attribute: str, evidence: Mapping[str, Label] = NOTHING, do: Mapping[str, str] = NOTHING
    ) -> Distribution:
        """The marginal of `attribute` given evidence and interventions.

        Args:
            attribute: an attribute or a term of one, such as ``roll(d1)``.
            evidence: term -> value, or -> the likelihood of its values (see `soft_evidence`).
            do: term -> value.

        Raises:
            ProgramError: the program does not know a name, `attribute` may have no value under the evidence,
                or a world breaks a condition of the language.
            UndefinedError: no possible world has the evidence.
        """
        asked = (attribute, tuple(evidence.items()), tuple(do.items()))
        try:
            answer = self._answers.get(asked)
        except TypeError:  # what cannot be a key is no value either, and is told so
            answer = None
        if answer is None:
            facts = self._hard(evidence)
            if facts is None:  # every likelihood is another, so that to keep answers would only fill memory
                return self._soft(do).posterior(attribute, evidence)
            answer = self._posterior(attribute, facts, do)
            _keep(self._answers, asked, answer)
        return answer

    @staticmethod
    def _hard(evidence: Mapping[str, Label]) -> Mapping[str, str] | None:
        """The evidence where all of it is hard, None where there is a likelihood."""
        if all(isinstance(value, str) for value in evidence.values()):
            return evidence  # type: ignore[return-value]
        from lcorpp.values import Likelihood  # here, as it loads numpy

        soft = any(isinstance(value, Likelihood) for value in evidence.values())
        return None if soft else evidence  # type: ignore[return-value]  # what else there is is refused

    def _soft(self, do: Mapping[str, str]) -> SoftEvidence:
        key = frozenset(do.items())
        if key not in self._weighing:
            from lcorpp.reasoning.soft_evidence import SoftEvidence  # here, as it loads numpy

            made = SoftEvidence(self.program, lambda name, facts: self.posterior(name, facts, do))
            _keep(self._weighing, key, made)
        return self._weighing[key]

    def _posterior(self, attribute: str, evidence: Mapping[str, str], do: Mapping[str, str]) -> Distribution:
        term = canonical_text(resolve_term(self.program, attribute))
        facts, set_to = resolve_evidence(self.program, evidence), resolve_interventions(self.program, do)
        if self.program.has_cr_rules:
            return self._enumeration().posterior(term, facts, set_to)
        key = (term, frozenset(facts), frozenset(set_to.items()))
        circuit = self._circuits.get(key)
        if circuit is None:
            try:
                circuit = self.compile(sorted(facts), term, set_to)
            except TooLargeError as found:
                circuit = found
            _keep(self._circuits, key, circuit)
        if isinstance(circuit, TooLargeError):
            return self._estimated(circuit, term, facts, set_to)
        return circuit(facts)  # type: ignore[return-value]

    def compile(
        self, inputs: Sequence[str], query: str | Sequence[str], do: Mapping[str, str] = NOTHING
    ) -> Circuit:
        """Compile the program for some inputs and queries; see `Circuit`.

        Args:
            inputs: the terms that evidence may name; an attribute with arguments stands for all its terms.
            query: a term, or several.
            do: interventions, term -> value.

        Raises:
            ProgramError: a name is unknown, a world breaks a condition of the language, or there are cr-
            rules.
            TooLargeError: the program has too many states.
        """
        from lcorpp.reasoning.circuit.compiler import compile_program  # here, as it takes time to load numpy

        return compile_program(self.program, inputs, query, do)

    def exact(
        self, attribute: str, evidence: Mapping[str, str], do: Mapping[str, str] = NOTHING
    ) -> dict[str, Fraction]:
        """The same as `posterior`, as fractions by value in the order of the declaration.

        Raises:
            TooLargeError: the program has too many states.
        """
        term = resolve_term(self.program, attribute)
        facts, set_to = resolve_evidence(self.program, evidence), resolve_interventions(self.program, do)
        if self.program.has_cr_rules:
            return self._enumeration().exact(canonical_text(term), facts, set_to)
        sums = self._worlds(set_to, (canonical_text(term), *facts)).exact_weights(canonical_text(term), facts)
        return _marginal(self.program, term, sums, format_conditions(facts, set_to))

    def sample(self, rng: np.random.Generator, given: Mapping[str, str] = NOTHING) -> dict[str, str]:
        """Draw one world with its probability given some evidence.

        Returns:
            term -> value.

        Raises:
            ProgramError, UndefinedError: as `posterior`.
            TooLargeError: the program has too many states.
        """
        if self.program.has_cr_rules:
            return self._enumeration().sample(rng, given)
        facts = resolve_evidence(self.program, given)
        found = self._worlds({}, tuple(facts)).sample(rng, facts)
        if found is None:
            raise UndefinedError(f"{self.program.file}: no possible world{format_conditions(given, {})}")
        return found

    def count(self) -> int:
        """How many possible worlds the program has, found without listing them.

        Raises:
            ProgramError: a world breaks a condition of the language.
            UndefinedError: there is none of positive measure.
            TooLargeError: the program has too many states.
        """
        if self.program.has_cr_rules:
            return len(self._enumeration().worlds)
        paths = self._worlds({}, ())
        if not sum(paths.float_weights("", {}).values()):
            raise no_world_error(self.program, "")
        return paths.count()

    @gc_paused()
    def ask(self, query: Query, *, exact: bool = False) -> dict[str, Answer] | Answer:
        """The distribution that a query asks for, or its probability.

        Args:
            exact: whether the numbers are fractions.

        Returns:
            A number, or value -> number; numbers are `Estimate`s where likelihood weighting had to serve.

        Raises:
            ProgramError, UndefinedError: as `posterior`.
            TooLargeError: fractions are asked of a program with too many states.
        """
        checked = _checked(self.program, query)
        if self.program.has_cr_rules:
            found = self._enumeration().ask(checked)
            return found if exact else _floats(found)  # type: ignore[return-value]
        do = {canonical_text(item.term): canonical_text(item.value) for item in checked.interventions}
        observed = [observation.literal for observation in checked.observations]
        name = canonical_text(checked.subject) if checked.subject else QUERY_TERM
        prepared = build_transition_system(self.program, do, observed, (name,), checked.literals)
        conditions = _conditions(checked)
        try:
            paths = WorldQueries(build_trellis(prepared))
            found_sums = paths.exact_weights(name, {}) if exact else paths.float_weights(name, {})
        except TooLargeError as error:
            if exact:
                raise
            self._say(error)
            return _estimates(self.program, checked, estimate(prepared, name, {}, self.samples))
        sums: Mapping[str, Fraction | float] = found_sums
        if checked.subject:
            return _marginal(self.program, checked.subject, sums, conditions)  # type: ignore[type-var]
        total = sum(sums.values())
        if not total:
            raise no_world_error(self.program, conditions)
        return sums.get("true", 0 * total) / total

    # the other engines

    def _worlds(self, do: Mapping[str, str], wanted: Sequence[str]) -> WorldQueries:
        key = frozenset(do.items()), frozenset(wanted)
        if key not in self._paths:
            _keep(
                self._paths,
                key,
                WorldQueries(build_trellis(build_transition_system(self.program, do, queried=wanted))),
            )
        return self._paths[key]

    def _enumeration(self) -> Enumeration:
        from lcorpp.reasoning.enumeration.reasoner import Enumeration  # here, as it loads numpy and clingo

        LOG.info("%s: a program with cr-rules is answered by enumeration", self.program.file)

        return Enumeration(self.program)

    def _say(self, reason: TooLargeError) -> None:
        warnings.warn(
            f"{reason}: estimated from {self.samples} worlds drawn at random", ReasoningWarning, stacklevel=4
        )

    def _estimated(
        self, reason: TooLargeError, term: str, facts: Mapping[str, str], do: Mapping[str, str]
    ) -> Distribution:
        import numpy as np

        from lcorpp.reasoning.distributions import EstimatedDistribution

        prepared = build_transition_system(self.program, do)
        self._say(reason)
        found = estimate(prepared, term, facts, self.samples)
        if found.values[""][0]:
            raise no_value_error(self.program, term, found.values[""][0])
        rows = [pair for value, pair in found.values.items() if value]
        values = tuple(value for value in found.values if value)
        p = np.array([pair[0] for pair in rows])
        return EstimatedDistribution(values, p / p.sum(), np.array([pair[1] for pair in rows]), found.samples)


class Estimate(float):
    """An estimated probability.

    error: its standard error.
    """

    error: float

    def __new__(cls, value: float, error: float) -> Estimate:
        made = super().__new__(cls, value)
        made.error = error
        return made


Answer = Fraction | float


def _checked(program: Program, query: Query) -> Query:
    try:
        query = program.named(query)
        program.check_query(query)
    except SourceIssue as issue:
        raise ProgramError(str(issue)) from None
    set_to: dict[str, str] = {}
    for item in query.interventions:
        term, value = canonical_text(item.term), canonical_text(item.value)
        if set_to.setdefault(term, value) != value:
            raise ProgramError(f"{item.at}: do({term}) sets two values, {set_to[term]} and {value}")
    return query


def _conditions(query: Query) -> str:
    parts = [str(part).removesuffix(".") for part in (*query.observations, *query.interventions)]
    return f" has {', '.join(parts)}" if parts else ""


_Number = TypeVar("_Number", Fraction, float)


def _marginal(
    program: Program, term: Term, sums: Mapping[str, _Number], conditions: str
) -> dict[str, _Number]:
    total = sum(sums.values())
    if not total:
        raise no_world_error(program, conditions)
    if sums.get(""):
        raise no_value_error(program, canonical_text(term), sums[""] / total)
    zero = 0 * total
    return {v: sums.get(v, zero) / total for v in program.attributes[term.name].values}


def _floats(found: dict[str, Fraction] | Fraction) -> dict[str, float] | float:
    return {v: float(p) for v, p in found.items()} if isinstance(found, dict) else float(found)


def _estimates(program: Program, query: Query, found: SampleEstimates) -> dict[str, Answer] | Answer:
    made = {value: Estimate(p, error) for value, (p, error) in found.values.items()}
    if query.subject is None:
        return made.get("true", Estimate(0.0, 0.0))
    lost = made.pop("")
    if lost:
        raise no_value_error(program, canonical_text(query.subject), lost)
    return dict(made)


def _again(program: Program, samples: int) -> Reasoner:
    return Reasoner(program, samples=samples)


def _keep(memory: dict[Hashable, _Kept], key: Hashable, value: _Kept) -> None:
    if len(memory) >= KEPT:
        memory.clear()
    memory[key] = value


def ask(program: Program, query: Query) -> dict[str, Answer] | Answer:
    """Answer one query exactly: value -> fraction, or a fraction; see `Reasoner.ask`."""
    return Reasoner(program).ask(query, exact=True)
