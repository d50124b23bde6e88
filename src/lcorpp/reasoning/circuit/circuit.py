"""A compiled program: new evidence costs one pass over matrices, or a look-up in a small evidence space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import prod
from operator import itemgetter
from typing import Any

import numpy as np

from lcorpp.errors import ProgramError, check_type
from lcorpp.notebook import join_some
from lcorpp.reasoning.answers import (
    PossibleWorld,
    format_conditions,
    list_values,
    make_no_value_error,
    make_no_world_error,
    normalise_marginal,
)
from lcorpp.reasoning.circuit.answer_table import AnswerTable, Codes, check_rows, normalize_rows
from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.circuit.evidence import Column, EncodedEvidence, EvidenceEncoder
from lcorpp.reasoning.circuit.matrices import Layer
from lcorpp.reasoning.circuit.passes import differentiate
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import check_rng
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array, Distribution, Label, Likelihood

CACHE_SIZE = 100_000
"""A circuit caches at most this many answers."""

MAX_PRECOMPUTED = 1000
"""Circuits with at most this many evidence combinations precompute all answers."""

MAX_WORLDS = 100_000
"""`Circuit.most_probable` returns at most this many worlds."""

SINGLE_PASS_ROWS = 128
"""A pass for one evidence costs about as much as this many rows of a batch."""

Answer = Distribution | dict[str, Distribution]
Answers = Array | dict[str, Array]


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
    layers: the matrices, see `matrices`.

    Source: Darwiche, J. ACM 50(3), 2003; the elimination tree as in AND/OR search, see `elimination_tree`.
    """

    def __init__(
        self,
        program: Program,
        inputs: Sequence[str],
        query: str | Sequence[str],
        do: Mapping[str, str],
        layers: Sequence[Layer],
        world_queries: WorldQueries | None = None,
    ) -> None:
        self.program, self.do = program, dict(do)
        self.inputs = tuple(inputs)
        self._encoder = EvidenceEncoder(program, self.inputs)
        self.queries = (query,) if isinstance(query, str) else tuple(query)
        self.single = isinstance(query, str)
        names = dict.fromkeys((*self.inputs, *self.queries))
        self.values = {name: list_values(program, name) for name in names}
        self.layers = tuple(layers)
        self._variables = {name: i for i, name in enumerate(names)}
        # a key contains all inputs
        self._max_cached = min(CACHE_SIZE, 100 * CACHE_SIZE // (len(self.inputs) + 1))
        # two caches: by the values of all inputs if all are observed; by (input or None, ...) otherwise
        self._full_answers: dict[object, Answer] = {}
        self._partial_answers: dict[tuple[str | None, ...], tuple[int, Answer]] = {}
        self._n_inputs = len(self.inputs) or -1
        self._get_inputs = itemgetter(*self.inputs) if self.inputs else itemgetter(0)
        self._world_queries = world_queries
        self._has_table = AnswerTable.is_feasible(self._encoder.sizes)
        self._built_table: AnswerTable | None = None
        self._n_computed = 0  # rows, see `_is_table_due`

    def __repr__(self) -> str:
        given, queries = join_some(self.inputs) or "nothing", join_some(self.queries) or "nothing"
        return f"Circuit({self.program.file}: {queries} given {given}; {len(self.layers)} layers)"

    def prepare(self) -> None:
        """Precompute all answers if they are few; larger tables follow when they pay off."""
        if prod(self._encoder.sizes) <= MAX_PRECOMPUTED:
            _ = self._table

    # one evidence

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
        """
        try:  # cached answers first: evidence for all inputs, then for some
            if len(evidence) == self._n_inputs:
                return self._full_answers[self._get_inputs(evidence)]
            n_observed, answer = self._partial_answers[tuple(map(evidence.get, self.inputs))]  # type: ignore[union-attr, arg-type]
            if n_observed == len(evidence):
                return answer
        except (KeyError, TypeError, AttributeError, IndexError):
            pass
        if isinstance(evidence, np.ndarray):
            return self._answer_batch(evidence, undefined)
        if not isinstance(evidence, Mapping):
            raise ProgramError(f"expected a mapping from inputs to values, or codes, not {evidence!r}")
        if not self._encoder.columns.keys() >= evidence.keys():
            evidence = self._encoder.canonicalize(evidence)
        if any(not isinstance(value, str) for value in evidence.values()):
            evidence = self._encoder.name_values(evidence)
            kinds = {str if isinstance(value, str) else type(value) for value in evidence.values()}
            if kinds <= {str, Likelihood} and Likelihood in kinds:
                answers = self._run_pass(self._encoder.encode(evidence), evidence)  # type: ignore[arg-type]
                return answers[self.queries[0]] if self.single else answers
            if kinds != {str}:
                return self._answer_columns(evidence, undefined)
        return self._answer_one(evidence)  # type: ignore[arg-type]

    def _answer_one(self, evidence: Mapping[str, str]) -> Answer:
        encoder = self._encoder
        encoder.check_names(evidence)
        codes = {encoder.columns[name]: encoder.encode_value(name, value) for name, value in evidence.items()}
        if self._is_table_due(SINGLE_PASS_ROWS):
            answers = self._look_up(codes, evidence)
        else:
            answers = self._run_pass(encoder.make_row(codes), evidence)
        answer: Answer = answers[self.queries[0]] if self.single else answers
        if len(self._partial_answers) + len(self._full_answers) >= self._max_cached:
            self._partial_answers.clear()
            self._full_answers.clear()
        if len(evidence) == self._n_inputs:
            self._full_answers[self._get_inputs(evidence)] = answer
        else:
            self._partial_answers[tuple(map(evidence.get, self.inputs))] = len(evidence), answer
        return answer

    @property
    def _table(self) -> AnswerTable:  # a cached_property would slow down all attributes, as it needs __dict__
        if self._built_table is None:
            self._built_table = AnswerTable(
                self._encoder.sizes, lambda codes: self._compute_weights(EncodedEvidence(codes))
            )
        return self._built_table

    def _is_table_due(self, n_rows: int) -> bool:
        """Whether to use the table for as much work as `n_rows` more rows of a batch.

        It is filled when passes have cost as much as filling it costs, so that no first call waits for it.
        """
        if self._built_table is None and self._has_table:
            self._n_computed += n_rows
            return self._n_computed >= prod(self._encoder.sizes)
        return self._has_table

    def _look_up(self, codes: Mapping[int, int], evidence: Mapping[str, str]) -> dict[str, Distribution]:
        table, row = self._table, self._table.find_row(codes)
        if table.is_complete:
            return {q: Distribution.unchecked(self.values[q], rows[row]) for q, rows in table.answers.items()}
        return {query: self._read_row(query, rows[row], evidence) for query, rows in table.answers.items()}

    def _run_pass(self, encoded: EncodedEvidence, evidence: Mapping[str, Label]) -> dict[str, Distribution]:
        return {
            query: self._read_row(query, normalize_rows(rows)[0], evidence)
            for query, rows in self._compute_weights(encoded).items()
        }

    def _read_row(self, query: str, row: Array, evidence: Mapping[str, Label]) -> Distribution:
        """Convert probabilities (values + 1,), the last for no value, to a distribution."""
        if np.isnan(row[-1]):
            raise make_no_world_error(self.program, format_conditions(evidence, self.do))
        if row[-1]:
            raise make_no_value_error(self.program, query, row[-1])
        return Distribution(self.values[query], row[:-1])

    # batches

    def encode(self, evidence: Mapping[str, str | Sequence[str]]) -> Codes:
        """(B, inputs) Encode a batch of evidence as integers.

        Args:
            evidence: input -> B values, None for not observed; or one value for all rows.

        Raises:
            ProgramError: an input or value is unknown, or the columns have different lengths.
        """
        return self._encoder.encode_values(evidence)

    def _answer_columns(self, evidence: Mapping[str, Column], undefined: str) -> Answers:
        columns: list[Any] = [c.tolist() if isinstance(c, np.ndarray) else c for c in evidence.values()]
        is_table = all(isinstance(c, list) and len(c) == len(columns[0]) for c in columns)
        if not is_table or not self._is_table_due(len(columns[0])):
            return self._answer_encoded(self._encoder.encode(evidence), undefined)
        inputs = tuple([self._encoder.columns[name] for name in evidence])
        codes = [self._encoder.codes[name] for name in evidence]
        try:
            rows = self._table.find_rows_of_values(inputs, columns, codes)
        except (KeyError, TypeError):
            return self._answer_encoded(self._encoder.encode(evidence), undefined)
        return self._take_rows(rows, undefined)

    def _answer_batch(self, codes: Codes, undefined: str) -> Answers:
        return self._answer_encoded(EncodedEvidence(self._encoder.check_codes(codes)), undefined)

    def _answer_encoded(self, evidence: EncodedEvidence, undefined: str) -> Answers:
        if not evidence.weights and self._is_table_due(len(evidence.codes)):
            return self._take_rows(self._table.find_rows(evidence.codes), undefined)
        weights = self._compute_weights(evidence)
        return self._finish({query: normalize_rows(rows) for query, rows in weights.items()}, undefined)

    def _take_rows(self, rows: Codes, undefined: str) -> Answers:
        answers = {query: table.take(rows, axis=0) for query, table in self._table.answers.items()}
        return self._finish(answers, undefined, is_complete=self._table.is_complete)

    def _finish(self, answers: dict[str, Array], undefined: str, *, is_complete: bool = False) -> Answers:
        """Check the rows of each query unless they are those of a complete table."""
        if undefined not in ("raise", "nan"):
            raise ProgramError(f"undefined={undefined!r}; expected 'raise' or 'nan'")
        if not is_complete:
            answers = {
                query: check_rows(self.program, query, rows, undefined) for query, rows in answers.items()
            }
        return answers[self.queries[0]] if self.single else answers

    def _compute_weights(self, evidence: EncodedEvidence) -> dict[str, Array]:
        """(B, outcomes) The joint weights of each query and the evidence; 0 for impossible evidence."""
        codes = evidence.codes
        no_evidence = np.full((len(codes), len(self._variables) - len(self.inputs)), -1, dtype=np.intp)
        observed = replace(evidence, codes=np.concatenate([codes, no_evidence], axis=1))
        queries = {self._variables[query]: len(self.values[query]) + 1 for query in self.queries}
        weights = differentiate(self.layers, observed, queries)
        by_query = {query: weights[self._variables[query]] for query in self.queries}
        if not evidence.weights and any(not layer.smallest for layer in self.layers):
            names = [self._encoder.decode(row) for row in codes]
            self.world_queries.restore_lost(names, {q: (self.values[q], by_query[q]) for q in by_query})
        return by_query

    # worlds

    @property
    def world_queries(self) -> WorldQueries:
        """Queries about whole worlds; a loaded circuit expands its program when it first needs them."""
        if self._world_queries is None:
            ground = ground_program(self.program, self.do, queried=self.queries)
            system = build_transition_system(ground, (*self.inputs, *self.queries))
            self._world_queries = WorldQueries(build_decision_diagram(system))
        return self._world_queries

    def exact(self, evidence: Mapping[str, str]) -> dict[str, Fraction] | dict[str, dict[str, Fraction]]:
        """Compute the same as a call with one evidence in fractions: value -> probability, for each query.

        Raises:
            ProgramError, UndefinedError: as a call.
        """
        evidence = self._encoder.resolve(evidence)
        answers = {query: self._compute_fractions(query, evidence) for query in self.queries}
        return answers[self.queries[0]] if self.single else answers

    def _compute_fractions(self, query: str, evidence: Mapping[str, str]) -> dict[str, Fraction]:
        weights = self.world_queries.compute_exact_weights(query, evidence)
        return normalise_marginal(self.program, query, weights, format_conditions(evidence, self.do))

    def most_probable(self, evidence: Mapping[str, str], count: int = 1) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds given evidence, with their probabilities given it, best first.

        Raises:
            ProgramError, UndefinedError: as a call.
        """
        evidence = self._encoder.resolve(evidence)
        check_type(count, int, "count", ProgramError)
        if not 1 <= count <= MAX_WORLDS:
            raise ProgramError(f"expected 1 to {MAX_WORLDS} worlds, not {count}")
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
        given = self._encoder.resolve(given)
        world = self.world_queries.sample(rng, given)
        if world is None:
            raise make_no_world_error(self.program, format_conditions(given, self.do))
        return world
