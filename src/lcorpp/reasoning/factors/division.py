"""The division of a program into tables and blocks, before any table is computed.

A term has a table over the terms in the bodies of its clauses, and so have the constraints about the same
terms, unless these are too many. Terms that depend on each other, and the rest, become blocks, see `blocks`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log2, prod

from lcorpp.reasoning.factors.blocks import Block, Part, find_blocks
from lcorpp.reasoning.grounding.ground_program import Clause, GroundProgram
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components
from lcorpp.reasoning.questions import is_joint, list_terms
from lcorpp.reasoning.transitions.elimination_order import eliminate
from lcorpp.reasoning.transitions.elimination_tree import MAX_DIAGRAM_WIDTH, MAX_SCOPE_BITS
from lcorpp.reasoning.transitions.relevance import separate_irrelevant_rules

MAX_ENTRIES = 2**MAX_SCOPE_BITS
"""A table that is computed from clauses has at most this many entries; larger ones are left to blocks."""

MAX_TERMS = 20_000
"""Programs with more terms are expanded: an elimination order takes time and memory for pairs of terms."""


@dataclass(frozen=True, slots=True, eq=False)
class Division:
    """A program, divided.

    terms: the terms, without those of irrelevant rules. numbers: queried term as text -> its number.
    outcomes_of: the possible outcomes of each term that agree with the constraints about it alone.
    observed: the terms of which such constraints exclude outcomes.
    parents_of: term -> the terms on which its distribution depends.
    clauses_of: term -> the clauses about it. constraints: terms -> the constraints about them.
    tables, blocks: the parts with a table each, and the others. None of either if there is no world.
    """

    program: GroundProgram
    terms: Sequence[int]
    numbers: Mapping[str, int]
    outcomes_of: Sequence[Sequence[int]]
    observed: set[int]
    parents_of: Mapping[int, Sequence[int]]
    clauses_of: Mapping[int, Sequence[Clause]]
    constraints: Mapping[frozenset[int], Sequence[Clause]]
    tables: Sequence[Part]
    blocks: Sequence[Block]
    has_worlds: bool

    def __repr__(self) -> str:
        file = self.program.source.file
        return f"Division({file}: {len(self.tables)} tables, {len(self.blocks)} blocks)"

    @property
    def has_wide_tables(self) -> bool:
        """Whether the program would be a wide decision diagram even without its blocks."""
        index_of = {term: i for i, term in enumerate([term for part in self.tables for term in part.terms])}
        needs: list[set[int]] = []
        groups: list[set[int]] = []
        for part in self.tables:
            own = {index_of[term] for term in part.scope if term in index_of}
            if part.terms:
                needs.append(own - {index_of[part.terms[0]]})
            elif len(own) > 1:
                groups.append(own)
        bits = _compute_bits(index_of, self.outcomes_of)
        _, _, width = eliminate(needs, groups, [bits[term] for term in index_of], range(len(needs)), ())
        return width > MAX_DIAGRAM_WIDTH


def divide_program(
    program: GroundProgram, queried: Iterable[str], parents: Mapping[str, Sequence[str]]
) -> Division | None:
    """Divide a ground program.

    Args:
        queried: terms that questions and evidence will name.
        parents: term -> its parents, for terms whose distributions are given as tables.

    Returns:
        None if there are too many terms, or a block would have a large table.
    """
    program, numbers = program.number_terms(set(queried))
    joint = {
        term
        for term, name in enumerate(program.names)
        if is_joint(name) and len(list_terms(name)) > 1 and name not in numbers
    }
    if joint:  # questions and evidence name its terms instead; formulas have names such as "?1"
        program = replace(program, clauses=[c for c in program.clauses if c.term not in joint])
    clauses, masks = simplify(program)
    needed = set(numbers.values())
    number_of = {name: term for term, name in enumerate(program.names)} if parents else {}
    given = {number_of[name]: tuple([number_of[parent] for parent in own]) for name, own in parents.items()}
    for term in program.do:
        given.pop(term, None)
    needed.update([parent for own in given.values() for parent in own])
    clauses, _, _ = separate_irrelevant_rules(program, clauses, needed)
    clauses_of: defaultdict[int, list[Clause]] = defaultdict(list)
    constraints: defaultdict[frozenset[int], list[Clause]] = defaultdict(list)
    bodies: set[int] = set()
    for clause in clauses:
        own = [literal[0] for literal in clause.body]
        bodies.update(own)
        if clause.term >= 0:
            clauses_of[clause.term].append(clause)
        else:
            constraints[frozenset(own)].append(clause)
    terms = sorted(clauses_of.keys() | program.do.keys() | needed | bodies)
    if len(terms) > MAX_TERMS:
        return None
    outcomes_of, observed = _list_outcomes(masks, constraints)
    parents_of = {
        term: given[term]
        if term in given
        else tuple(dict.fromkeys([x[0] for clause in clauses_of.get(term, ()) for x in clause.body]))
        for term in terms
    }
    has_worlds = all(outcomes_of[term] for term in terms) and frozenset() not in constraints
    parts: list[Part] = []
    blocks: list[Block] | None = []
    if has_worlds:
        parts = _list_parts(parents_of, given, constraints, outcomes_of)
        blocks = find_blocks(parts, _compute_bits(terms, outcomes_of), {*needed, *given})
    if blocks is None:
        return None
    taken = {part for block in blocks for part in block.parts}
    return Division(
        program,
        terms,
        numbers,
        outcomes_of,
        observed,
        parents_of,
        clauses_of,
        constraints,
        [part for part in parts if part not in taken],
        blocks,
        has_worlds,
    )


def _list_outcomes(
    masks: Sequence[int], constraints: Mapping[frozenset[int], Sequence[Clause]]
) -> tuple[list[Sequence[int]], set[int]]:
    """List the outcomes of each term that constraints about it alone allow, and the terms of these."""
    decoded: dict[int, list[int]] = {}
    outcomes_of: list[Sequence[int]] = [
        decoded.get(mask) or decoded.setdefault(mask, [i for i in range(mask.bit_length()) if mask >> i & 1])
        for mask in masks
    ]
    observed: set[int] = set()
    for scope, own in constraints.items():
        if len(scope) == 1:
            (term,) = scope
            observed.add(term)
            outcomes_of[term] = [
                outcome
                for outcome in outcomes_of[term]
                if not any(all(mask >> outcome & 1 for _, mask, _ in clause.body) for clause in own)
            ]
    return outcomes_of, observed


def _list_parts(
    parents_of: Mapping[int, Sequence[int]],
    given: Mapping[int, Sequence[int]],
    constraints: Iterable[frozenset[int]],
    outcomes_of: Sequence[Sequence[int]],
) -> list[Part]:
    """List the components, each after those that it depends on, and the constraints of several terms."""

    def is_small(scope: Iterable[int]) -> bool:
        return bool(prod([len(outcomes_of[term]) for term in scope]) <= MAX_ENTRIES)

    parts = []
    for own in find_strongly_connected_components(parents_of):
        scope = frozenset(own).union(*[parents_of[term] for term in own])
        parts.append(Part(own, scope, own[0] in given or (len(own) == 1 and is_small(scope))))
    return [*parts, *[Part((), scope, is_small(scope)) for scope in constraints if len(scope) > 1]]


def _compute_bits(terms: Iterable[int], outcomes_of: Sequence[Sequence[int]]) -> dict[int, float]:
    """Compute the bits of the outcomes of terms."""
    return {term: log2(len(outcomes_of[term]) or 1) for term in terms}
