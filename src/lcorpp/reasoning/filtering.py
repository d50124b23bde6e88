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
from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import product
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError, check_type, expected_one_of
from lcorpp.notebook import join_some
from lcorpp.reasoning.answers import (
    format_conditions,
    list_values,
    make_no_value_error,
    make_no_world_error,
)
from lcorpp.reasoning.circuit.evidence import Codes, EvidenceEncoder
from lcorpp.reasoning.circuit.joint_weights import JointWeights
from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.grounding.slices import split_slices
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_evidence, resolve_inputs, resolve_queries, resolve_term
from lcorpp.values import Array, Distribution, Label, Likelihood

MAX_STATES = 1000
"""The carried terms have at most this many combinations of values."""

MAX_CACHED_NUMBERS = 10_000_000
"""A filter caches matrices with at most this many numbers together."""


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
        ranges = [list_values(program, term) for term in self._new]
        self._sizes = [len(values) for values in ranges]
        if prod(self._sizes) > MAX_STATES:
            raise TooLargeError(
                f"{program.file}: {prod(self._sizes)} combinations of values of the carried terms; at most"
                f" {MAX_STATES} can be filtered"
            )
        self.states = tuple(product(*ranges))
        self._codes = np.array(list(product(*map(range, self._sizes))), dtype=np.intp)
        self._matrices: dict[tuple[Label | None, ...], Array] = {}
        self._columns: list[tuple[str, tuple[str, ...], slice]] = []  # query, its values, its columns
        end = len(self.states)
        for query in self.queries:
            values = list_values(program, query)
            self._columns.append((query, values, slice(end, end + len(values))))
            end += len(values)
        self._max_cached = max(1, MAX_CACHED_NUMBERS // (len(self.states) * (end + 1)))

        initial = resolve_evidence(program, initial)
        ground = ground_program(program, {}, queried=self.queries)
        past, step = split_slices(ground, self._old, initial)
        start = JointWeights(past, (*self._old, *initial))
        self._check_values(self._old, start.compute((self._old, self._codes)).sum(), float(start.compute()))
        self._weights = JointWeights(step, (*self._old, *self._new, *self.inputs, *self.queries))
        encoder = EvidenceEncoder(program, tuple(initial))
        codes = np.array([[encoder.encode_value(*fact) for fact in initial.items()]], dtype=np.intp)
        first = start.compute((tuple(initial), codes), (self._old, self._codes))[0]
        if not first.sum() > 0:
            raise make_no_world_error(program, format_conditions(initial, {}))
        self._first = first / first.sum()
        self._reachable = self._find_reachable()
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
        """
        matrix = None
        try:
            key = tuple(map(evidence.get, self.inputs))
            if len(key) - key.count(None) == len(evidence):
                matrix = self._matrices.get(key)
        except (AttributeError, TypeError, ValueError):
            pass  # reported below
        if matrix is None:
            check_type(evidence, Mapping, "evidence", ProgramError)
            matrix = self._find_matrix(self._encoder.canonicalize(evidence))
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
        n = len(self.states)
        self.belief = weights[:n]
        if self.window:
            self._steps.append((matrix[:, :n], self.belief))
        answers = {q: Distribution.unchecked(values, weights[own]) for q, values, own in self._columns}
        return answers[self.queries[0]] if self.single else answers

    def smooth(self) -> list[dict[str, Distribution]]:
        """Compute the distributions of the carried terms after each of the last `window` steps, oldest first.

        They are conditional on all evidence so far, later steps included.

        Returns:
            For each step: carried term of slice 1 -> distribution.
        """
        future = np.ones(len(self.states))
        answers = []
        for matrix, belief in reversed(self._steps):
            joint = belief * future
            joint = (joint / joint.sum()).reshape(self._sizes)
            axes = range(len(self._sizes))
            answers.append(
                {
                    term: Distribution(
                        list_values(self.program, term), joint.sum(axis=tuple(a for a in axes if a != axis))
                    )
                    for axis, term in enumerate(self._new)
                }
            )
            future = matrix @ future
            future /= future.max()
        return answers[::-1]

    # matrices

    def _find_matrix(self, evidence: Mapping[str, Label]) -> Array:
        """(states, columns) P(x1, e | x0), P(q, e | x0) for the queries, P(e | x0); sum likelihoods out."""
        for name, label in evidence.items():
            if isinstance(label, Likelihood):
                values = self._encoder.values[name]
                if set(label.values) != set(values):
                    raise ProgramError(
                        f"a likelihood of {', '.join(label.values)} for {name}; {expected_one_of(values)}"
                    )
                parts = [w * self._find_matrix({**evidence, name: value}) for value, w in label if w > 0]
                return reduce(np.add, parts)
        codes = [self._encoder.encode_value(name, value) for name, value in evidence.items()]
        key = tuple(map(evidence.get, self.inputs))
        if key not in self._matrices:
            if len(self._matrices) >= self._max_cached:
                self._matrices.clear()
            self._matrices[key] = self._compute_matrix(tuple(evidence), codes)
        return self._matrices[key]

    def _compute_matrix(self, observed: Sequence[str], codes: Sequence[int]) -> Array:
        blocks = [self._compute_conditional(observed, codes, self._new, self._codes)]
        for query, values, _ in self._columns:
            outcomes = np.arange(len(values) + 1)[:, None]
            block = self._compute_conditional(observed, codes, (query,), outcomes)
            no_value = block[self._reachable, -1].max()
            if no_value:
                raise make_no_value_error(self.program, query, f"up to {no_value:.6g}")
            blocks.append(block[:, :-1])
        blocks.append(blocks[0].sum(axis=1, keepdims=True))
        return np.hstack(blocks)

    def _compute_conditional(
        self, observed: Sequence[str], codes: Sequence[int], terms: Sequence[str], outcomes: Codes
    ) -> Array:
        """(states, outcomes) P(outcomes of terms, evidence | state of slice 0)."""
        evidence = (observed, np.array([codes], dtype=np.intp))
        joint = self._weights.compute(evidence, (self._old, self._codes), (terms, outcomes))[0]
        conditional: Array = joint * len(self.states)  # the states are equally probable, see `split_slices`
        return conditional

    def _find_reachable(self) -> npt.NDArray[np.bool_]:
        """(states,) The states that steps without evidence lead to; check that their steps lead to states."""
        step = self._compute_conditional((), (), self._new, self._codes)
        total = self._compute_conditional((), (), (), np.zeros((1, 0), dtype=np.intp))[:, 0]
        reachable = np.zeros(len(self.states), dtype=bool)
        more = self._first > 0
        while (more & ~reachable).any():
            reachable |= more
            more = step[reachable].any(axis=0)
        for i in np.flatnonzero(reachable):
            state = dict(zip(self._old, self.states[i], strict=True))
            self._check_values(
                self._new, step[i].sum(), total[i], f" if the last step{format_conditions(state, {})}"
            )
        return reachable

    def _check_values(
        self, terms: Sequence[str], with_values: float, total: float, condition: str = ""
    ) -> None:
        if with_values < total * (1 - 1e-9):
            raise ProgramError(
                f"{self.program.file}: {', '.join(terms)}: a carried term has no value with probability"
                f" {1 - with_values / total:.6g}{condition}; expected a value in each world"
            )


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
