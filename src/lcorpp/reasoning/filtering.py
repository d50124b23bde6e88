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
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import product

import numpy as np

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError, check_type
from lcorpp.notebook import join_some
from lcorpp.reasoning.answers import (
    format_conditions,
    make_no_value_error,
    make_no_world_error,
)
from lcorpp.reasoning.diagram.decision_diagram import build_decision_diagram
from lcorpp.reasoning.diagram.layers import build_layers, weigh
from lcorpp.reasoning.evidence import Codes, EncodedEvidence, EvidenceEncoder
from lcorpp.reasoning.grounding.ground_program import GroundProgram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.grounding.slices import split_slices
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Term
from lcorpp.reasoning.questions import list_values, name_joint
from lcorpp.reasoning.resolve import resolve_evidence, resolve_inputs, resolve_queries, resolve_term
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array, Distribution, Label, Likelihood

MAX_STATES = 1000
"""The carried terms have at most this many combinations of values."""

MAX_CACHED_NUMBERS = 10_000_000
"""A filter caches matrices with at most this many numbers together."""

_MIN_POSITIVE = 5e-324


class Filter:
    """A belief about the carried terms of a two-slice program, by `Reasoner.filter`.

    Args:
        program: the program.
        carried: term of slice 0 -> the term of slice 1 whose value it has in the next step. All other terms
            are drawn anew in each step, which is refused for those of slice 0 on which slice 1 depends.
        inputs: the terms that evidence may name; an attribute without arguments denotes all its terms.
        query: a question, or several; see `Reasoner.compile`.
        initial: evidence about slice 0, term -> value.
        window: the number of steps that `smooth` covers.

    states: the combinations of values of the carried terms.
    belief: (states,) their probabilities given all evidence so far.

    Raises:
        ProgramError: a name is unknown, a carried term may have no value, slice 1 depends on a term of the
            past that is not carried, a world violates a condition of the language, or there are cr-rules.
        UndefinedError: `initial` is impossible.
        TooLargeError: the program is too large to be compiled, or has too many states.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> doors = parse_plog(
        ...     "t = {0, 1}. at, seen : t -> boolean. random(at(0)). random(at(1)). random(seen(1))."
        ...     "pr(at(1) | at(0)) = 0.9. pr(at(1) | -at(0)) = 0.1."
        ...     "pr(seen(1) | at(1)) = 0.8. pr(seen(1) | -at(1)) = 0.2."
        ... )
        >>> tracker = Reasoner(doors).filter({"at(0)": "at(1)"}, ["seen(1)"], "at(1)")
        >>> [tracker.step({"seen(1)": seen}) for seen in ("true", "true")]
        [Distribution(true: 0.8, false: 0.2), Distribution(true: 0.9193, false: 0.08075)]
    """

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
        check_type(window, int, "window", ProgramError)
        if window < 0:
            raise ProgramError(f"window is {window}; expected at least 0")
        self.program, self.window = program, window
        pairs = _resolve_carried(program, carried)
        old, new = name_joint([term for term, _ in pairs]), name_joint([term for _, term in pairs])
        self.inputs = tuple(resolve_inputs(program, inputs))
        self.queries, self.single = resolve_queries(program, query), isinstance(query, str)
        self._encoder = EvidenceEncoder(program, self.inputs)
        self._names = [name[1:].split(", ") for name in (old, new)]
        self.states: tuple[tuple[str, ...], ...] = list_values(program, new)
        if len(self.states) > MAX_STATES:
            raise TooLargeError(
                f"{program.file}: {len(self.states)} combinations of values of the carried terms; at most"
                f" {MAX_STATES} can be filtered"
            )
        initial = resolve_evidence(program, initial)
        ground = ground_program(program, {}, queried=dict.fromkeys([old, new, *self.queries]))
        past, step = split_slices(ground, old, initial, _recognise_slice(program, pairs))
        self._first = self._compute_first(_Table(past, list(initial), [old]), initial)
        self._table = _Table(step, [old, *self.inputs], [new, *self.queries])
        self._answers: list[tuple[str, tuple[Label, ...], slice]] = []  # query, its values, their columns
        self._width = len(self.states) + 2  # of no value, and of the evidence
        for name in self.queries:
            values, start = list_values(program, name), self._width - 1
            self._answers.append((name, values, slice(start, start + len(values))))
            self._width += len(values) + 1
        self._matrices: dict[tuple[object, ...], Array] = {}
        self._n_cached = 0
        self._check_reachable_states()
        self.reset()

    def __repr__(self) -> str:
        carried = join_some([f"{old} -> {new}" for old, new in zip(*self._names, strict=True)])
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
        ranges = [list_values(self.program, term) for term in self._names[1]]
        future = np.ones(len(self.states))
        answers: list[dict[str, Distribution]] = []
        for matrix, belief in reversed(self._steps):
            smoothed = belief * future
            smoothed /= smoothed.sum()
            joint = smoothed.reshape(list(map(len, ranges)))
            answers.append({})
            for axis, (term, values) in enumerate(zip(self._names[1], ranges, strict=True)):
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
        n, hard, soft = len(self.states), dict[int, int](), dict[int, list[float]]()
        for name, label in given.items():
            if isinstance(label, Likelihood):
                soft[self._encoder.columns[name]] = self._encoder.list_weights(name, label)[:-1]
            else:
                hard[self._encoder.columns[name]] = self._encoder.encode_value(name, label)
        weights = reduce(np.multiply.outer, soft.values(), np.ones(1)).ravel()
        key = (*[given.get(name) if i not in soft else None for i, name in enumerate(self.inputs)], *soft)
        if key not in self._matrices:
            size = len(weights) * n * self._width
            if size > MAX_CACHED_NUMBERS:
                raise TooLargeError(
                    f"{self.program.file}: {len(weights)} combinations of values of"
                    f" {join_some([self.inputs[i] for i in soft])}, which have likelihoods, in {n} states"
                )
            if self._n_cached + size > MAX_CACHED_NUMBERS:
                self._matrices.clear()
                self._n_cached = 0
            codes = np.full((len(weights), len(self.inputs)), -1)
            codes[:, list(hard)] = list(hard.values())
            codes[:, list(soft)] = list(product(*[range(len(own)) for own in soft.values()]))
            rows = np.column_stack([np.tile(np.arange(n), len(codes)), codes.repeat(n, axis=0)])
            self._matrices[key] = self._table.compute(rows).reshape(len(weights), n, self._width)
            self._n_cached += size
        matrices = self._matrices[key]
        matrix: Array = (weights @ matrices.reshape(len(weights), -1)).reshape(n, -1)
        return matrix

    def _compute_first(self, table: _Table, initial: Mapping[str, str]) -> Array:
        """(states,) Compute the initial belief."""
        codes, _ = EvidenceEncoder(self.program, tuple(initial)).encode(initial)
        self._check_values(0, table.compute(np.full_like(codes.codes, -1))[0])
        given = table.compute(codes.codes)[0]
        if not given[-1]:
            raise make_no_world_error(self.program, format_conditions(initial, {}))
        belief: Array = given[:-2] / given[-1]
        return belief

    def _check_reachable_states(self) -> None:
        """Check that the states that steps without evidence lead to lead to states in turn."""
        n, matrix = len(self.states), self._find_matrix({})
        reachable = self._first > 0
        while (more := reachable | matrix[reachable, :n].any(axis=0)).sum() > reachable.sum():
            reachable = more
        for i in np.flatnonzero(reachable):
            state = dict(zip(self._names[0], self.states[i], strict=True))
            self._check_values(1, matrix[i], f" if the last step{format_conditions(state, {})}")

    def _check_values(self, slice_: int, weights: Array, condition: str = "") -> None:
        """Check that the carried terms of a slice have values in each world."""
        if lost := weights[len(self.states)]:
            raise ProgramError(
                f"{self.program.file}: {', '.join(self._names[slice_])}: a carried term has no value with"
                f" probability {lost / weights[-1]:.6g}{condition}; expected a value in each world"
            )


class _Table:
    """The joint weights of the outcomes of some terms of a ground program, given those of others."""

    def __init__(self, ground: GroundProgram, given: Sequence[str], asked: Sequence[str]) -> None:
        names = list(dict.fromkeys([*given, *asked]))
        diagram = build_decision_diagram(build_transition_system(ground, names))
        self._layers, self._asked = build_layers(diagram, names), [names.index(name) for name in asked]

    def compute(self, given: Codes) -> Array:
        """(B, weights) Compute the weights of the outcomes of each term that is asked, and of what is given.

        Args:
            given: (B, terms) the outcomes of the given terms, -1 for no evidence.
        """
        by_term, logarithms = weigh(self._layers, EncodedEvidence(given), self._asked)
        largest = logarithms.max()
        totals = np.exp(logarithms - largest if largest > -np.inf else logarithms)[:, None]
        rows = [by_term[term] for term in self._asked]
        sums = [np.maximum(own.sum(axis=1, keepdims=True), _MIN_POSITIVE) for own in rows]
        return np.hstack([*[own / total * totals for own, total in zip(rows, sums, strict=True)], totals])


def _resolve_carried(program: Program, carried: Mapping[str, str]) -> list[tuple[Term, Term]]:
    """Return the carried terms of slice 0, each with its term of slice 1."""
    check_type(carried, Mapping, "carried", ProgramError)
    if not carried:
        raise ProgramError(
            "nothing is carried; expected a term of slice 0 and its term of slice 1, or several"
        )
    pairs = [(resolve_term(program, old), resolve_term(program, new)) for old, new in carried.items()]
    names = [canonical_text(term) for pair in pairs for term in pair]
    if len(set(names)) < len(names):
        raise ProgramError(f"the carried terms are {', '.join(names)}; expected different terms")
    for old, new in pairs:
        if program.attributes[old.name].values != program.attributes[new.name].values:
            raise ProgramError(f"{old} and {new} have different ranges, so that no value is carried")
    return pairs


def _recognise_slice(program: Program, pairs: Sequence[tuple[Term, Term]]) -> Callable[[str], bool]:
    """Make the test whether a term belongs to slice 0: an argument of the sort of times is its time."""
    times = {
        (sort, canonical_text(before))
        for old, new in pairs
        if old.name == new.name
        for sort, before, after in zip(
            program.attributes[old.name].arguments, old.arguments, new.arguments, strict=True
        )
        if before != after
    }

    def is_old(name: str) -> bool:
        attribute = program.attributes.get(name.partition("(")[0])
        arguments = name.partition("(")[2].removesuffix(")").split(",")
        return attribute is not None and not times.isdisjoint(
            zip(attribute.arguments, arguments, strict=False)
        )

    return is_old
