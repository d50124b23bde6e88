"""A compiled program: new evidence costs one pass over its layers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.notebook import join_some
from lcorpp.reasoning.answers import (
    PossibleWorld,
    format_conditions,
    make_no_value_error,
    make_no_world_error,
    normalise_marginal,
)
from lcorpp.reasoning.diagram.decision_diagram import DecisionDiagram, build_decision_diagram
from lcorpp.reasoning.diagram.layers import weigh
from lcorpp.reasoning.evidence import Codes, Column, EncodedEvidence, EvidenceEncoder
from lcorpp.reasoning.grounding.ground_program import GroundProgram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.questions import list_values
from lcorpp.reasoning.resolve import check_count, check_rng
from lcorpp.reasoning.transitions.transition_system import TransitionSystem, build_transition_system
from lcorpp.values import Array, Distribution, Label

if TYPE_CHECKING:
    from lcorpp.reasoning._diagram import Layers
    from lcorpp.reasoning.circuit.table_worlds import TableWorlds
    from lcorpp.reasoning.diagram.world_queries import WorldQueries
    from lcorpp.reasoning.factors.network import TableNetwork

CACHE_SIZE = 100_000
"""A circuit caches at most this many answers."""

EXPANDED = ("ground", "system", "diagram", "world_queries")
"""What a circuit computes again when it is first needed, so that a pickled circuit is small."""

Answer = Distribution | dict[str, Distribution]
Answers = Array | dict[str, Array]

_Answer = TypeVar("_Answer", Distribution, Array, dict[str, Fraction])


class Circuit:
    """A program compiled for some inputs and queries, by `Reasoner.compile`.

    A call takes evidence, a mapping from inputs to values or likelihoods; missing inputs are not observed:

        circuit({"time": "morning", "classifier": "one"})            -> Distribution
        circuit({"time": [...], "classifier": [...]})                -> (B, values) array
        circuit(codes)                                               -> (B, values) array

    where ``codes`` is an integer array (B, inputs): the index of each value in ``circuit.values[input]``, -1
    for not observed (`encode` computes it). With several queries the answer is a dict, query -> answer.

    inputs: the terms that evidence may name.
    queries: the queried terms, of several attributes `?item, person`; single: whether there is one answer.
    values: term -> range, for all of these terms; of several attributes tuples.
    layers: see `layers`; None if there are tables.
    network: the tables of a program, some of them of blocks, see `TableNetwork`; or None.

    Source: Darwiche, J. ACM 50(3), 2003; the elimination tree as in AND/OR search, see `elimination_tree`.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> coins = parse_plog("a, b : boolean. random(a). random(b). pr(b | a) = 3/4. pr(b | -a) = 1/4.")
        >>> circuit = Reasoner(coins).compile(["a"], "b")
        >>> circuit({"a": ["true", "false"]}).tolist()  # in the order of circuit.values["b"], true first
        [[0.75, 0.25], [0.25, 0.75]]
    """

    def __init__(
        self,
        program: Program,
        inputs: Sequence[str],
        query: str | Sequence[str],
        do: Mapping[str, str],
        layers: Layers | None = None,
        network: TableNetwork | None = None,
    ) -> None:
        self.program, self.do = program, dict(do)
        self.inputs = tuple(inputs)
        self.encoder = EvidenceEncoder(program, self.inputs)
        self.queries = (query,) if isinstance(query, str) else tuple(query)
        self.single = isinstance(query, str)
        names = dict.fromkeys((*self.inputs, *self.queries))
        self.values = {name: list_values(program, name) for name in names}
        self.layers, self.network = layers, network
        self._variables = {name: i for i, name in enumerate(names)}
        # by the values of all inputs, None for not observed; with the number of observed inputs
        self._answers: dict[tuple[object, ...], tuple[int, Answer]] = {}
        self._max_cached = min(CACHE_SIZE, 100 * CACHE_SIZE // (len(self.inputs) + 1))  # by length of keys

    def __repr__(self) -> str:
        given, queries = join_some(self.inputs) or "nothing", join_some(self.queries) or "nothing"
        parts = f"{len(self.layers)} layers" if self.layers is not None else ""
        if self.network is not None:
            parts = f"{len(self.network.graph.factors)} tables"
        return f"Circuit({self.program.file}: {queries} given {given}; {parts})"

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name not in EXPANDED}

    def __call__(
        self, evidence: Mapping[str, Column] | Codes, *, undefined: str = "raise"
    ) -> Answer | Answers:
        """Compute the distributions of the queries given evidence.

        Args:
            evidence: input -> value or likelihood, input -> values or likelihoods of a batch, or an array
                (B, inputs) of codes. A likelihood, as a value, rules out that the input has no value.
            undefined: for impossible evidence in a batch: "raise", or "nan" for a row of NaN.

        Raises:
            ProgramError: an input or a value is unknown, or a query may have no value under the evidence.
            UndefinedError: the evidence is impossible.
            TooLargeError: the tables are too large with this evidence.
        """
        try:
            n_observed, answer = self._answers[tuple(map(evidence.get, self.inputs))]  # type: ignore[union-attr]
            if n_observed == len(evidence):
                return answer
        except (AttributeError, KeyError, TypeError):  # not cached, or no mapping from terms to values
            pass
        if self.network is not None and self.single and (quick := self._answer_values(evidence)) is not None:
            return quick
        if undefined not in ("raise", "nan"):
            raise ProgramError(f"undefined={undefined!r}; expected 'raise' or 'nan'")
        named: Mapping[str, Label] | None = None  # one evidence
        if isinstance(evidence, np.ndarray):
            encoded = self.encoder.check_codes(evidence)
        elif isinstance(evidence, Mapping):
            canonical = self.encoder.canonicalize(evidence)
            encoded, is_batch = self.encoder.encode(canonical)
            named = None if is_batch else canonical  # type: ignore[assignment]
        else:
            raise ProgramError(f"expected a mapping from inputs to values, or codes, not {evidence!r}")
        probabilities = self.compute_probabilities(encoded)
        self._check_rows(probabilities, undefined, named)
        if named is None:
            return self._select({query: rows[:, :-1] for query, rows in probabilities.items()})
        answer = self._select(
            {query: Distribution(self.values[query], rows[0, :-1]) for query, rows in probabilities.items()}
        )
        if not encoded.weights:
            self._store(tuple(map(named.get, self.inputs)), len(named), answer)
        return answer

    def _answer_values(self, evidence: Mapping[str, Column] | Codes) -> Distribution | None:
        """Answer one evidence of values by tables; None if it is of another kind, wrong or impossible."""
        try:
            codes = [self.encoder.codes[name][value] for name, value in evidence.items()]  # type: ignore[union-attr, index]
        except (AttributeError, KeyError, TypeError):
            return None
        assert self.network is not None
        plan = self.network.find_simple_plan(self.queries[0], tuple(evidence))
        if plan is None or (shares := plan.distribute(codes)) is None:
            return None
        shares.flags.writeable = False
        answer = Distribution.unchecked(self.values[self.queries[0]], shares)
        self._store(tuple(map(evidence.get, self.inputs)), len(codes), answer)  # type: ignore[union-attr]
        return answer

    def _store(self, key: tuple[object, ...], n_observed: int, answer: Answer) -> None:
        """Cache an answer; a full cache is cleared."""
        if len(self._answers) >= self._max_cached:
            self._answers.clear()
        self._answers[key] = n_observed, answer

    def _select(self, answers: dict[str, _Answer]) -> _Answer | dict[str, _Answer]:
        """Return the answer to a query; of several queries all answers."""
        return answers[self.queries[0]] if self.single else answers

    def compute_probabilities(self, evidence: EncodedEvidence) -> dict[str, Array]:
        """(B, outcomes) Compute the distribution of each query; rows of NaN for impossible evidence."""
        rows, numbers = evidence.number_rows()
        if self.network is not None:
            own = evidence.take(rows)
            weighed = self.network.weigh_questions(self.queries, self.inputs, own)
            with np.errstate(invalid="ignore"):
                return {
                    query: (weights / weights.sum(axis=1, keepdims=True)).take(numbers, axis=0)
                    for query, weights in weighed.items()
                }
        variables = {query: self._variables[query] for query in self.queries}
        assert self.layers is not None
        weights, _ = weigh(self.layers, evidence.take(rows), list(variables.values()))
        with np.errstate(invalid="ignore"):
            shares = {
                query: weights[i] / weights[i].sum(axis=1, keepdims=True) for query, i in variables.items()
            }
        return {query: own.take(numbers, axis=0) for query, own in shares.items()}

    def _check_rows(
        self, probabilities: Mapping[str, Array], undefined: str, named: Mapping[str, Label] | None
    ) -> None:
        """Raise an error for the first row without an answer; `named` is the evidence if it is one."""
        for query, rows in probabilities.items():
            no_value = rows[:, -1]
            if not no_value.any():  # NaN is true
                continue
            for row in np.flatnonzero(no_value > 0):
                where = f"row {row}: " if named is None else ""
                raise make_no_value_error(self.program, query, no_value[row], where)
            if named is not None:
                raise make_no_world_error(self.program, format_conditions(named, self.do))
            if undefined == "raise":
                row = np.flatnonzero(np.isnan(no_value))[0]
                raise UndefinedError(f"{self.program.file}: row {row}: no possible world has this evidence")

    def encode(self, evidence: Mapping[str, str | Sequence[str]]) -> Codes:
        """(B, inputs) Encode a batch of evidence as integers.

        Args:
            evidence: input -> B values, None for not observed; or one value for all rows.

        Raises:
            ProgramError: an input or value is unknown, the columns have different lengths, or there are
                likelihoods, which have no codes.
        """
        encoded, _ = self.encoder.encode(self.encoder.canonicalize(evidence))
        if encoded.weights:
            names = ", ".join([self.inputs[i] for i in encoded.weights])
            raise ProgramError(f"the likelihoods of {names} have no codes")
        return encoded.codes

    # worlds

    @cached_property
    def ground(self) -> GroundProgram:
        """The ground program."""
        return ground_program(self.program, self.do, queried=self.queries)

    @cached_property
    def system(self) -> TransitionSystem:
        """The program as a transition system; that of its decision diagram may have a better order."""
        return build_transition_system(self.ground, self._variables)

    @cached_property
    def diagram(self) -> DecisionDiagram:
        """The decision diagram."""
        return build_decision_diagram(self.system)

    @cached_property
    def world_queries(self) -> WorldQueries:
        """Queries about whole worlds; a loaded circuit expands its program when it first needs them."""
        from lcorpp.reasoning.diagram.world_queries import WorldQueries  # rarely needed

        return WorldQueries(self.diagram)

    def exact(self, evidence: Mapping[str, str]) -> dict[str, Fraction] | dict[str, dict[str, Fraction]]:
        """Compute the same as a call with one evidence in fractions: value -> probability, for each query.

        Raises:
            ProgramError, UndefinedError: as a call.
        """
        evidence = self.encoder.resolve(evidence)
        return self._select({query: self._compute_fractions(query, evidence) for query in self.queries})

    def _compute_fractions(self, query: str, evidence: Mapping[str, str]) -> dict[str, Fraction]:
        worlds: WorldQueries | TableWorlds
        if self.network is None:
            worlds = self.world_queries
        else:
            from lcorpp.reasoning.circuit.table_worlds import TableWorlds  # few programs are tables

            worlds = TableWorlds(self.network, lambda: self.world_queries)
        weights = worlds.compute_exact_weights(query, evidence)
        return normalise_marginal(self.program, query, weights, format_conditions(evidence, self.do))

    def most_probable(self, evidence: Mapping[str, str], count: int = 1) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds given evidence, with their probabilities given it, best first.

        Raises:
            ProgramError, UndefinedError: as a call.
        """
        evidence = self.encoder.resolve(evidence)
        check_count(count)
        worlds = self.world_queries.most_probable(evidence, count)
        if not worlds:
            raise make_no_world_error(self.program, format_conditions(evidence, self.do))
        return worlds

    def sample(self, rng: np.random.Generator, given: Mapping[str, str]) -> dict[str, str]:
        """Draw one world with its probability given evidence, term -> value.

        Raises:
            ProgramError, UndefinedError: as a call.
        """
        check_rng(rng)
        given = self.encoder.resolve(given)
        worlds = self.world_queries.sample(1, rng, given)
        if worlds is None:
            raise make_no_world_error(self.program, format_conditions(given, self.do))
        return worlds[0]
