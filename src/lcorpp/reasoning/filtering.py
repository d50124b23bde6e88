"""Filtering: a belief about the state of a two-slice program, updated in constant time at each step.

The program describes a step: terms of slice 0 are the state before it, terms of slice 1 the state after it.
The carried terms separate the past from the future: with the belief b over their values, evidence e, query q,

    b'(x1) ~ sum over x0 of b(x0) P(x1, e | x0),    P(q, e) = sum over x0 of b(x0) P(q, e | x0).

The matrix of P(x1, e | x0) and P(q, e | x0) depends on the evidence only. It is computed by a pass over the
circuit of the program when its evidence first occurs; a step is then one product of a vector and a matrix.

Source: Murphy, Dynamic Bayesian Networks, 2002, section 3.2 (the interface algorithm).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from math import prod

import numpy as np

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError, check_type, expected_one_of
from lcorpp.notebook import join_some
from lcorpp.reasoning.answers import (
    format_conditions,
    list_values,
    make_no_value_error,
    make_no_world_error,
)
from lcorpp.reasoning.circuit.compiler import build_layers
from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.circuit.evidence import Codes, EvidenceEncoder
from lcorpp.reasoning.circuit.passes import evaluate
from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.grounding.ground_program import GroundProgram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.grounding.slices import split_slices
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_evidence, resolve_inputs, resolve_queries, resolve_term
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array, Distribution, Label, Likelihood

MAX_STATES = 1000
"""The carried terms have at most this many combinations of values."""

MAX_CACHED_NUMBERS = 10_000_000
"""A filter caches matrices with at most this many numbers together."""

_Outcomes = Sequence[Sequence[int]]
"""Rows of outcomes of terms."""


class Filter:
    """A belief about the carried terms of a two-slice program, by `Reasoner.filter`.

    Args:
        program: the program.
        carried: term of slice 0 -> the term of slice 1 whose value it has in the next step. All other terms
            are drawn anew in each step.
        inputs: the terms that evidence may name; an attribute without arguments denotes all its terms.
        query: a term, or several.
        initial: evidence about slice 0, term -> value.
        window: the number of steps that `smooth` covers.

    states: the combinations of values of the carried terms.
    belief: (states,) their probabilities given all evidence so far.

    Raises:
        ProgramError: a name is unknown, a carried term may have no value, slice 1 depends on a term of the
            past that is not carried, a world violates a condition of the language, or there are cr-rules.
        UndefinedError: `initial` is impossible.
        TooLargeError: the program is too large to be compiled, or has too many states.
    """

    @pause_gc()
    def __init__(
        self,
        program: Program,
        carried: Mapping[str, str],
        inputs: Sequence[str],
        query: str | Sequence[str],
        *,
        initial: Mapping[str, str],
        window: int = 0,
    ) -> None:
        if program.has_cr_rules:
            raise ProgramError(
                f"{program.file}: a program with cr-rules has no filter, as it is not compiled"
            )
        self.program, self.window = program, window
        self._old, self._new = _resolve_carried(program, carried)
        self.inputs = tuple(resolve_inputs(program, inputs))
        self.queries, self.single = resolve_queries(program, query), isinstance(query, str)
        self._encoder = EvidenceEncoder(program, self.inputs)
        self._ranges = [list_values(program, term) for term in self._new]
        self._sizes = list(map(len, self._ranges))
        if prod(self._sizes) > MAX_STATES:
            raise TooLargeError(
                f"{program.file}: {prod(self._sizes)} combinations of values of the carried terms; at most"
                f" {MAX_STATES} can be filtered"
            )
        self.states = tuple(product(*self._ranges))
        codes = list(product(*map(range, self._sizes)))
        initial = resolve_evidence(program, initial)
        past, step = split_slices(ground_program(program, {}, queried=self.queries), self._old, initial)
        self._first = self._compute_first(_Table(past, (*self._old, *initial)), codes, initial)

        self._table = _Table(step, (*self._old, *self._new, *self.inputs, *self.queries))
        self._before = self._table.encode(self._old, codes)
        columns = [self._table.encode(self._new, codes)]
        self._answers: list[tuple[str, tuple[str, ...], slice]] = []  # query, its values, their columns
        end = len(codes)
        for name in self.queries:
            values = list_values(program, name)
            self._answers.append((name, values, slice(end, end + len(values))))
            end += len(values) + 1  # the last outcome is having no value
            columns.append(self._table.encode((name,), [[i] for i in range(len(values) + 1)]))
        self._after = np.vstack([*columns, self._table.encode()])
        self._matrices: dict[tuple[object, ...], Array] = {}
        self._n_cached = 0
        self._check_reachable_states()
        self.reset()

    def __repr__(self) -> str:
        carried = join_some([f"{old} -> {new}" for old, new in zip(self._old, self._new, strict=True)])
        return f"Filter({self.program.file}: {carried}; {len(self.states)} states)"

    def reset(self) -> None:
        """Return to the belief before the first step."""
        self.belief = self._first
        self._steps: deque[tuple[Array, Array]] = deque(maxlen=self.window)  # (matrix, belief after it)

    def step(self, evidence: Mapping[str, Label]) -> Distribution | dict[str, Distribution]:
        """Advance by one step with its evidence; an error leaves the belief unchanged.

        Args:
            evidence: input -> value, or -> the likelihood of its values; other inputs are not observed.

        Returns:
            The distribution of the query given all evidence so far; of several queries a dict.

        Raises:
            ProgramError: an input or a value is unknown, or a query may have no value under the evidence.
            UndefinedError: the evidence is impossible.
            TooLargeError: the values of the inputs with likelihoods have too many combinations.
        """
        matrix = None
        try:
            key = tuple(map(evidence.get, self.inputs))
            if len(key) - key.count(None) == len(evidence):
                matrix = self._matrices[key][0]
        except (AttributeError, KeyError, TypeError, ValueError):
            pass  # new, or reported below
        if matrix is None:
            matrix = self._find_matrix(evidence)
        weights = self.belief @ matrix
        total = weights[-1]
        if not total > 0:
            conditions = {name: str(value) for name, value in evidence.items()}
            raise UndefinedError(
                f"{self.program.file}: no possible world of positive measure continues the steps so far and"
                f"{format_conditions(conditions, {})}"
            )
        weights /= total
        weights.flags.writeable = False
        answers = {}
        for query, values, own in self._answers:
            if weights[own.stop]:
                raise make_no_value_error(self.program, query, weights[own.stop])
            answers[query] = Distribution.unchecked(values, weights[own])
        n = len(self.states)
        self.belief = weights[:n]
        if self.window:
            self._steps.append((matrix[:, :n], self.belief))
        return answers[self.queries[0]] if self.single else answers

    def smooth(self) -> list[dict[str, Distribution]]:
        """Compute the distributions of the carried terms after each of the last `window` steps, oldest first.

        They are conditional on all evidence so far, later steps included.

        Returns:
            For each step: carried term of slice 1 -> distribution.
        """
        future = np.ones(len(self.states))
        answers: list[dict[str, Distribution]] = []
        for matrix, belief in reversed(self._steps):
            smoothed = belief * future
            smoothed /= smoothed.sum()
            joint = smoothed.reshape(self._sizes)
            answers.append({})
            for axis, (term, values) in enumerate(zip(self._new, self._ranges, strict=True)):
                marginal = np.moveaxis(joint, axis, 0).reshape(len(values), -1).sum(axis=1)
                answers[-1][term] = Distribution(values, marginal)
            # states that the past excludes are left out: their futures may be more probable by any factor
            future = matrix @ np.divide(smoothed, belief, out=np.zeros_like(belief), where=belief > 0)
        return answers[::-1]

    def _find_matrix(self, evidence: Mapping[str, Label]) -> Array:
        """(states, columns) P(x1, e | x0), P(q, e | x0) for the queries, and P(e | x0), up to one factor.

        With likelihoods it is a weighted sum of the matrices for all values of their inputs.
        """
        given = self._encoder.canonicalize(evidence)
        hard = {
            n: self._encoder.encode_value(n, v) for n, v in given.items() if not isinstance(v, Likelihood)
        }
        weights = np.ones(1)
        ranges: list[range] = []
        for name, label in given.items():
            if isinstance(label, Likelihood):
                values, weight_of = self._encoder.values[name], dict(label)
                if weight_of.keys() != set(values):
                    raise ProgramError(
                        f"a likelihood of {', '.join(label.values)} for {name}; {expected_one_of(values)}"
                    )
                weights = np.multiply.outer(weights, [weight_of[value] for value in values]).ravel()
                ranges.append(range(len(values)))
        soft = [name for name in given if name not in hard]
        key = (*[given.get(name) if name in hard else None for name in self.inputs], *soft)
        if key not in self._matrices:
            size = len(weights) * len(self._before) * len(self._after)
            if size > MAX_CACHED_NUMBERS:
                raise TooLargeError(
                    f"{self.program.file}: {len(weights)} combinations of values of {join_some(soft)}, which"
                    f" have likelihoods, in {len(self.states)} states"
                )
            if self._n_cached + size > MAX_CACHED_NUMBERS:
                self._matrices.clear()
                self._n_cached = 0
            observed = [(*hard.values(), *own) for own in product(*ranges)]
            rows = self._table.encode((*hard, *soft), observed)
            self._matrices[key] = self._table.compute(rows, self._before, self._after)
            self._n_cached += size
        matrix: Array = np.tensordot(weights, self._matrices[key], 1)
        return matrix

    # checks

    def _compute_first(self, table: _Table, codes: _Outcomes, initial: Mapping[str, str]) -> Array:
        """(states,) Compute the initial belief."""
        encoder = EvidenceEncoder(self.program, tuple(initial))
        facts = table.encode(tuple(initial), [[encoder.encode_value(*fact) for fact in initial.items()]])
        outcomes = np.vstack([table.encode(self._old, codes), table.encode()])
        (prior,), (first,) = table.compute(table.encode(), outcomes), table.compute(facts, outcomes)
        self._check_values(self._old, prior, "")
        if not first[:-1].any():
            raise make_no_world_error(self.program, format_conditions(initial, {}))
        belief: Array = first[:-1] / first[:-1].sum()
        return belief

    def _check_reachable_states(self) -> None:
        """Check that the states that steps without evidence lead to lead to states in turn."""
        n, matrix = len(self.states), self._find_matrix({})
        following, checked = np.flatnonzero(self._first).tolist(), set[int]()
        while new := set(following) - checked:
            for i in new:
                state = dict(zip(self._old, self.states[i], strict=True))
                weights = np.append(matrix[i, :n], matrix[i, -1])
                self._check_values(self._new, weights, f" if the last step{format_conditions(state, {})}")
            checked |= new
            following = np.flatnonzero(matrix[list(new), :n].any(axis=0)).tolist()

    def _check_values(self, terms: Sequence[str], weights: Array, condition: str) -> None:
        """Check that the last weight, of all worlds, is the sum of the others, with values of the terms."""
        lost = 1 - weights[:-1].sum() / weights[-1] if weights[-1] else 0.0
        if lost > 1e-9:
            raise ProgramError(
                f"{self.program.file}: {', '.join(terms)}: a carried term has no value with probability"
                f" {lost:.6g}{condition}; expected a value in each world"
            )


class _Table:
    """The weights of combinations of outcomes of some terms of a ground program."""

    def __init__(self, ground: GroundProgram, names: Iterable[str]) -> None:
        self._names = list(dict.fromkeys(names))
        diagram = build_decision_diagram(build_transition_system(ground, self._names))
        self._layers = build_layers(diagram, self._names)

    def encode(self, terms: Sequence[str] = (), outcomes: _Outcomes = ((),)) -> Codes:
        """(n, names) Encode n combinations of outcomes of terms; the others, by default all, are free."""
        codes = np.full((len(outcomes), len(self._names)), -1, dtype=np.intp)
        codes[:, [self._names.index(term) for term in terms]] = outcomes
        return codes

    def compute(self, *parts: Codes) -> Array:
        """(n1, n2, ...) Compute the weights of each combination of a row of each part, up to one factor."""
        codes, agree = parts[0], np.ones(len(parts[0]), dtype=bool)
        for part in parts[1:]:
            codes = codes[..., None, :]
            agree = agree[..., None] & ((codes < 0) | (part < 0) | (codes == part)).all(axis=-1)
            codes = np.maximum(codes, part)
        weights: Array = evaluate(self._layers, codes.reshape(-1, len(self._names))).reshape(agree.shape)
        return weights * agree


def _resolve_carried(program: Program, carried: Mapping[str, str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    check_type(carried, Mapping, "carried", ProgramError)
    old = tuple(canonical_text(resolve_term(program, name)) for name in carried)
    new = tuple(canonical_text(resolve_term(program, name)) for name in carried.values())
    if not old:
        raise ProgramError(
            "nothing is carried; expected a term of slice 0 and its term of slice 1, or several"
        )
    if len({*old, *new}) < 2 * len(old):
        raise ProgramError(f"the carried terms are {', '.join((*old, *new))}; expected different terms")
    for before, after in zip(old, new, strict=True):
        if list_values(program, before) != list_values(program, after):
            raise ProgramError(f"{before} and {after} have different ranges, so that no value is carried")
    return old, new
