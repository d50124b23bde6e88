"""A compiled program: new evidence is one pass through numbers, or a look-up where there are few."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import prod
from operator import itemgetter

import numpy as np

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning.circuit.answer_table import AnswerTable, Codes, normalised
from lcorpp.reasoning.circuit.evidence import EvidenceEncoder
from lcorpp.reasoning.circuit.matrices import Layer, forward_backward
from lcorpp.reasoning.circuit.refusals import impossible, no_value, shown
from lcorpp.reasoning.circuit.trellis import build_trellis
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.reasoning.world import World
from lcorpp.values import Array, Distribution

KEPT = 100_000
"""How many answers are kept before they are forgotten."""

EAGER = 1000
"""Up to so many different evidences are answered when a circuit is made."""

MAX_WORLDS = 100_000
"""How many of the most probable worlds may be asked for."""

Answer = Distribution | dict[str, Distribution]
Answers = Array | dict[str, Array]


class Circuit:
    """A program compiled for some inputs and queries; made by `Reasoner.compile`.

    It is called with evidence, a mapping from inputs to values; inputs that are missing are not observed:

        circuit({"time": "morning", "classifier": "one"})            -> Distribution
        circuit({"time": [...], "classifier": [...]})                -> (B, values) array
        circuit(codes)                                               -> (B, values) array

    where ``codes`` is an integer array (B, inputs): the position of each value in
    ``circuit.values[input]``, -1 for not observed (`codes` makes one). With several queries the answer is a
    dict from query to each of these.

    inputs: the terms that evidence may name.
    queries: the terms that are asked for; single says whether one was asked for by itself.
    values: the range of each of them.
    layers, ending: the numbers, see `layers.layered`.

    Source: Darwiche, J. ACM 50(3), 2003; the order of terms as in frontier (path) elimination.
    """

    def __init__(
        self,
        program: Program,
        inputs: Sequence[str],
        query: str | Sequence[str],
        do: Mapping[str, str],
        layers: Sequence[Layer],
        ending: Array,
        paths: WorldQueries | None = None,
    ) -> None:
        self.program, self.do = program, dict(do)
        self.inputs = tuple(inputs)
        self._given = EvidenceEncoder(program, self.inputs)
        self.queries = (query,) if isinstance(query, str) else tuple(query)
        self.single = isinstance(query, str)
        names = dict.fromkeys((*self.inputs, *self.queries))
        self.values = {name: program.attributes[name.partition("(")[0]].values for name in names}
        self.layers, self.ending = tuple(layers), ending
        self._labels = {name: i for i, name in enumerate(names)}
        self._most = min(KEPT, 100 * KEPT // (len(self.inputs) + 1))  # each is kept with all its inputs
        self._answers: dict[tuple[str | None, ...], tuple[int, Answer]] = {}
        self._complete: dict[object, Answer] = {}
        self._count = len(self.inputs) or -1
        self._take = itemgetter(*self.inputs) if self.inputs else itemgetter(0)
        self._paths = paths
        self._tabulates = AnswerTable.fit(self._given.sizes)
        self._tables: AnswerTable | None = None

    def prepare(self) -> None:
        """Work out all answers if they are few; larger tables wait for the first call."""
        if prod(self._given.sizes) <= EAGER:
            _ = self._table

    # one evidence

    def __call__(
        self, evidence: Mapping[str, str | Sequence[str]] | Codes, *, undefined: str = "raise"
    ) -> Answer | Answers:
        """The distributions of the queries given evidence.

        Args:
            evidence: input -> value, input -> values of a batch, or an array (B, inputs) of codes.
            undefined: what a batch does about impossible evidence: "raise", or "nan" for a row of NaN.

        Raises:
            ProgramError: an input or a value is unknown, or a query may have no value under the evidence.
            UndefinedError: the evidence is impossible.
        """
        try:  # all inputs given, and these met before: nothing but a look-up
            if len(evidence) == self._count:
                return self._complete[self._take(evidence)]
            given, answer = self._answers[tuple(map(evidence.get, self.inputs))]  # type: ignore[union-attr, arg-type]
            if given == len(evidence):
                return answer
        except (KeyError, TypeError, AttributeError, IndexError):
            pass
        if isinstance(evidence, np.ndarray):
            return self._batch(evidence, undefined)
        if not isinstance(evidence, Mapping):
            raise ProgramError(f"expected a mapping from inputs to values, or codes, not {evidence!r}")
        if not self._given.columns.keys() >= evidence.keys():
            evidence = self._given.canonical(evidence)
        if any(not isinstance(value, str) for value in evidence.values()):
            return self._of_columns(evidence, undefined)
        return self._one(evidence)  # type: ignore[arg-type]

    def _one(self, evidence: Mapping[str, str]) -> Answer:
        self._given.check_names(evidence)
        codes = {self._given.columns[name]: self._given.code(name, value) for name, value in evidence.items()}
        answers = self._looked_up(codes, evidence) if self._tabulates else self._passed(codes, evidence)
        answer: Answer = answers[self.queries[0]] if self.single else answers
        if len(self._answers) + len(self._complete) >= self._most:
            self._answers.clear()
            self._complete.clear()
        if len(evidence) == self._count:
            self._complete[self._take(evidence)] = answer
        else:
            self._answers[tuple(map(evidence.get, self.inputs))] = len(evidence), answer
        return answer

    @property
    def _table(self) -> AnswerTable:
        if self._tables is None:
            self._tables = AnswerTable(self._given.sizes, self._joint)
        return self._tables

    def _looked_up(self, codes: Mapping[int, int], evidence: Mapping[str, str]) -> dict[str, Distribution]:
        table = self._table
        index = table.index(codes)
        if table.sound:
            return {
                q: Distribution.unchecked(self.values[q], rows[index]) for q, rows in table.answers.items()
            }
        return {query: self._read(query, rows[index], evidence) for query, rows in table.answers.items()}

    def _passed(self, codes: Mapping[int, int], evidence: Mapping[str, str]) -> dict[str, Distribution]:
        row = np.full((1, len(self.inputs)), -1, dtype=np.intp)
        for column, code in codes.items():
            row[0, column] = code
        found = self._joint(row)
        return {
            query: self._read(query, normalised(weights)[0], evidence) for query, weights in found.items()
        }

    def _read(self, query: str, row: Array, evidence: Mapping[str, str]) -> Distribution:
        """A normalised row of weights, the last for no value, as a distribution."""
        if np.isnan(row[-1]):  # impossible, or too improbable for floating point
            return self._exactly(query, evidence)
        if row[-1]:
            raise no_value(self.program, query, row[-1])
        return Distribution(self.values[query], row[:-1])

    def _exactly(self, query: str, evidence: Mapping[str, str]) -> Distribution:
        exact = self._fractions(query, evidence)
        return Distribution(tuple(exact), np.array([float(p) for p in exact.values()]))

    # many evidences

    def _of_columns(self, evidence: Mapping[str, str | Sequence[str]], undefined: str) -> Answers:
        columns = [c.tolist() if isinstance(c, np.ndarray) else c for c in evidence.values()]
        if not self._tabulates or any(not isinstance(c, list) or len(c) != len(columns[0]) for c in columns):
            return self._batch(self._given.codes(evidence), undefined)
        places = tuple([self._given.columns[name] for name in evidence])
        try:
            index = self._table.indexes_of(places, columns, [self._given.numbers(name) for name in evidence])
        except (KeyError, TypeError):
            return self._batch(self._given.codes(evidence), undefined)  # it says what is wrong
        return self._at(index, undefined)

    def codes(self, evidence: Mapping[str, str | Sequence[str]]) -> Codes:
        """(B, inputs) the codes of a batch of evidence.

        Args:
            evidence: input -> B values, None for not observed; or one value for all.

        Raises:
            ProgramError: an input or value is unknown, or the columns have different lengths.
        """
        return self._given.codes(evidence)

    def _batch(self, codes: Codes, undefined: str) -> Answers:
        codes = self._given.checked(codes)
        if undefined not in ("raise", "nan"):
            raise ProgramError(f"undefined={undefined!r}; expected 'raise' or 'nan'")
        if self._tabulates:
            return self._at(self._table.indexes(codes), undefined)
        answers = {query: normalised(weights) for query, weights in self._joint(codes).items()}
        answers = {query: self._checked(query, rows, undefined) for query, rows in answers.items()}
        return answers[self.queries[0]] if self.single else answers

    def _at(self, index: Codes, undefined: str) -> Answers:
        """The rows of the tables at some places."""
        if undefined not in ("raise", "nan"):
            raise ProgramError(f"undefined={undefined!r}; expected 'raise' or 'nan'")
        answers = {query: table.take(index, axis=0) for query, table in self._table.answers.items()}
        if not self._table.sound:
            answers = {query: self._checked(query, rows, undefined) for query, rows in answers.items()}
        return answers[self.queries[0]] if self.single else answers

    def _joint(self, codes: Codes) -> dict[str, Array]:
        """(B, outcomes) the weights of each query and the evidence."""
        open_queries = np.full((len(codes), len(self._labels) - len(self.inputs)), -1, dtype=np.intp)
        labels = np.concatenate([codes, open_queries], axis=1)
        asked = {self._labels[query]: len(self.values[query]) + 1 for query in self.queries}
        found = forward_backward(self.layers, self.ending, labels, asked)
        return {query: found[self._labels[query]] for query in self.queries}

    def _checked(self, query: str, rows: Array, undefined: str) -> Array:
        lost = rows[:, -1]
        if lost.any() or np.isnan(lost).any():
            bad = np.flatnonzero(lost > 0)
            if len(bad):
                raise no_value(self.program, query, lost[bad[0]], f"row {bad[0]}: ")
            if undefined == "raise":
                row = int(np.flatnonzero(np.isnan(lost))[0])
                raise UndefinedError(f"{self.program.file}: row {row}: no possible world has this evidence")
        return rows[:, :-1]

    # the whole worlds

    @property
    def paths(self) -> WorldQueries:
        """The worlds behind the numbers; after loading they are compiled when first needed."""
        if self._paths is None:
            self._paths = WorldQueries(build_trellis(build_transition_system(self.program, self.do)))
        return self._paths

    def exact(self, evidence: Mapping[str, str]) -> dict[str, Fraction] | dict[str, dict[str, Fraction]]:
        """The same as a call with one evidence, in fractions: value -> probability, for each query.

        Raises:
            ProgramError, UndefinedError: as the call.
        """
        self._given.check(evidence)
        answers = {query: self._fractions(query, evidence) for query in self.queries}
        return answers[self.queries[0]] if self.single else answers

    def _fractions(self, query: str, evidence: Mapping[str, str]) -> dict[str, Fraction]:
        weights = self.paths.exact(query, evidence)
        total = sum(weights.values(), Fraction(0))
        if total == 0:
            raise impossible(self.program, shown(evidence, self.do))
        lost = weights.get("", Fraction(0))
        if lost:
            raise no_value(self.program, query, lost / total)
        return {v: weights.get(v, Fraction(0)) / total for v in self.values[query]}

    def most_probable(self, evidence: Mapping[str, str], count: int = 1) -> tuple[World, ...]:
        """The most probable worlds that have the evidence, with their probabilities given it, best first.

        Raises:
            ProgramError, UndefinedError: as the call.
        """
        self._given.check(evidence)
        if not 1 <= count <= MAX_WORLDS:
            raise ProgramError(f"expected 1 to {MAX_WORLDS} worlds, not {count}")
        found = self.paths.most_probable(evidence, count)
        if not found:
            raise impossible(self.program, shown(evidence, self.do))
        return found

    def sample(self, rng: np.random.Generator, given: Mapping[str, str]) -> dict[str, str]:
        """Draw one world with its probability given some evidence, term -> value.

        Raises:
            ProgramError, UndefinedError: as the call.
        """
        self._given.check(given)
        found = self.paths.sample(rng, given)
        if found is None:
            raise impossible(self.program, shown(given, self.do))
        return found
