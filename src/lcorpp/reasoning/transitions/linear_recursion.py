"""Recursive components with linear rules, such as reachability on an uncertain map.

    reach(q) :- reach(r), open(r, q).      reach(r) :- reach(q), open(r, q).

Such a component is not decided as a whole: the steps that decide its inputs keep in the state what these
imply (`recursion_frontier`). Only those of its terms have a step that queries or other rules read. It follows
as soon as the inputs of the term's rules are decided, although the term may depend on others, and *guesses*
the outcome; the state keeps what later steps must justify. So what other rules make of the outcome is known
at once, and the term can leave the state.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from lcorpp.reasoning.grounding.ground_program import (
    DERIVE,
    Atom,
    Clause,
    GroundLiteral,
    GroundProgram,
    make_full_mask,
)
from lcorpp.reasoning.transitions.local_distribution import Outcome
from lcorpp.reasoning.transitions.recursive_components import RecursiveComponent

Edge = tuple[Atom | None, Atom]
"""(body, head): the head follows from the body, or from nothing if the body is None."""


@dataclass(slots=True, eq=False)
class Guess:
    """The local distribution of a term of a recursion before it is known which of its rules apply.

    outcomes: those that may turn out right.
    claims: triples (mask, value, is_derived): outcomes that demand that rules derive a value, or do not.
    """

    outcomes: list[Outcome]
    claims: list[tuple[int, int, bool]]

    def list_outcomes(self, states: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """Return the outcomes, the same for each state."""
        return dict.fromkeys(states, self.outcomes)


@dataclass(slots=True, eq=False)
class LinearRecursion:
    """A recursive component with linear rules.

    guesses: the terms that have steps -> their distributions. Besides those that queries or other rules read
        these are terms that may have two values, so that there is no world.
    needs: guessed term -> the inputs of the rules from which it follows.
    scope: the inputs and the guessed terms.
    """

    terms: tuple[int, ...]
    clauses: Sequence[Clause]
    guesses: dict[int, Guess]
    needs: dict[int, set[int]]
    scope: frozenset[int]


def describe_recursion(
    program: GroundProgram, terms: tuple[int, ...], clauses: Sequence[Clause], read: Collection[int]
) -> LinearRecursion | None:
    """Describe a component with linear rules, some of them with inputs; None if it has others.

    A linear rule has at most one literal about the component, which is not negated. Besides there may be
    defaults such as ``p=false :- not p`` that no rule of the component uses.

    Args:
        read: the terms that queries or other components read.
    """
    own = set(terms)
    edges_of: list[tuple[Clause, list[Edge]]] = []
    defaults: dict[int, list[Clause]] = {}
    for clause in clauses:
        literals = [literal for literal in clause.body if literal[0] in own]
        edges = find_edges(program, clause, literals)
        if edges is None or (not edges and len(literals) < len(clause.body)):
            return None
        if edges:
            edges_of.append((clause, edges))
        else:
            defaults.setdefault(clause.term, []).append(clause)
    bodies = {body for _, edges in edges_of for body, _ in edges}
    is_default_used = any((x.term, x.value) in bodies for rules in defaults.values() for x in rules)
    if is_default_used or not own.isdisjoint(program.do):
        return None
    values: dict[int, dict[int, None]] = {term: {} for term in terms}  # those that rules derive
    for _, edges in edges_of:
        for _, (term, value) in edges:
            values[term][value] = None
    guesses: dict[int, Guess] = {}
    known: dict[object, Guess | None] = {}
    for term in terms:
        rules = defaults.get(term, [])
        structure = [(rule.value, [literal[1:] for literal in rule.body]) for rule in rules]
        key = term in read, len(program.values[term]), *values[term], str(structure)
        if key not in known:
            known[key] = _make_guess(program, term, values[term], rules, term in read)
        guess = known[key]
        if guess:
            guesses[term] = guess
    inputs = {literal[0] for clause, _ in edges_of for literal in clause.body} - own
    needs = _find_needs(own, [clause for clause, _ in edges_of], guesses)
    return (
        LinearRecursion(terms, clauses, guesses, needs, frozenset(inputs.union(guesses))) if inputs else None
    )


def find_edges(
    program: GroundProgram, clause: Clause, own_literals: Sequence[GroundLiteral]
) -> list[Edge] | None:
    """Find the edges of a clause by its literals about the component.

    Returns:
        The edges, none for a default; None if the clause is neither a default nor a linear rule.
    """
    if clause.kind is not DERIVE:
        return None
    head = clause.term, clause.value
    if any(negated for _, _, negated in own_literals):
        is_default = all(negated and term == clause.term for term, _, negated in own_literals)
        return [] if is_default else None
    if not own_literals:
        return [(None, head)]
    if len(own_literals) > 1:
        return None
    term, mask, _ = own_literals[0]
    return [((term, value), head) for value in range(len(program.values[term])) if mask >> value & 1]


def _make_guess(
    program: GroundProgram, term: int, values: Collection[int], defaults: Sequence[Clause], is_read: bool
) -> Guess | None:
    """List what can become of a term whose rules derive values; None if it needs no step."""

    def decide(*derived: int) -> dict[int, Outcome]:
        facts = [(0, Clause(DERIVE, term, value, ()), ()) for value in derived]
        guarded = [*facts, *[(0, rule, rule.body) for rule in defaults]]
        component = RecursiveComponent(program, (term,), guarded, {})
        return {outcome.values[0]: outcome for outcome in component.list_outcomes((0,))[0]}

    without = decide()
    cases = {value: decide(value) for value in values}
    if not is_read and len(values) < 2 and all(len(case) == 1 for case in (without, *cases.values())):
        return None
    outcomes = without.copy()
    claims: list[tuple[int, int, bool]] = []
    for value, case in cases.items():
        outcomes |= case
        claims.append((make_full_mask(len(program.values[term])) ^ 1 << value, value, False))
        if value not in without:  # otherwise the outcome is right whether rules derive it or not
            claims.append((1 << value, value, True))
    return Guess(list(outcomes.values()), claims)


def _find_needs(own: Collection[int], rules: Iterable[Clause], guessed: Iterable[int]) -> dict[int, set[int]]:
    """Find the inputs of the rules of terms, and of the terms from which they follow without a condition."""
    inputs: dict[int, set[int]] = {term: set() for term in own}
    follows_from: dict[int, set[int]] = {term: set() for term in own}
    for rule in rules:
        external = [literal[0] for literal in rule.body if literal[0] not in own]
        inputs[rule.term].update(external)
        if not external:
            follows_from[rule.term].update([literal[0] for literal in rule.body])
    needs: dict[int, set[int]] = {}
    for term in guessed:
        reached, stack = {term}, [term]
        while stack:
            new = follows_from[stack.pop()] - reached
            reached |= new
            stack += new
        needs[term] = set().union(*[inputs[other] for other in reached])
    return needs
