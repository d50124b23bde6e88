"""Compilation, step 2: rules that no query depends on, such as facts and the rules of unobserved effects.

Rules that always have exactly one stable model change no probability. So the terms that they decide need no
step, unless a query, a constraint or a random selection depends on them; `derive_values` computes their
outcomes if a world is listed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from itertools import combinations

from lcorpp.reasoning.grounding.ground_program import DERIVE, Clause, GroundProgram
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components

DerivedComponent = tuple[tuple[int, ...], Sequence[Clause]]
"""The terms of a component, and their rules."""


def separate_irrelevant_rules(
    program: GroundProgram, clauses: list[Clause], queried: Collection[int]
) -> tuple[list[Clause], dict[int, int], list[DerivedComponent]]:
    """Separate the rules of the terms that no query, constraint or random selection depends on.

    Args:
        clauses: the simplified clauses.
        queried: the terms whose outcomes queries read.

    Returns:
        (clauses, facts, components): the other clauses, term -> value for the irrelevant facts, and the other
        irrelevant components, each after those that it depends on.
    """
    rules_of: dict[int, list[Clause]] = {}
    for clause in clauses:
        if clause.kind is DERIVE:
            rules_of.setdefault(clause.term, []).append(clause)
    if rules_of.keys() <= set(queried):  # usual in chains, and faster
        return clauses, {}, []
    seeds = [*program.do, *queried]
    for clause in clauses:
        if clause.kind is not DERIVE:
            seeds.append(clause.term)
            seeds += [literal[0] for literal in clause.body]
    facts = {
        term: rules[0].value for term, rules in rules_of.items() if len(rules) == 1 and not rules[0].body
    }
    for term in seeds:
        facts.pop(term, None)
    for term in facts:
        del rules_of[term]
    relevant: set[int] = set()

    def mark(terms: Iterable[int]) -> None:
        """Mark terms, and those that they depend on, as relevant."""
        stack = [term for term in terms if term in rules_of]
        while stack:
            term = stack.pop()
            if term not in relevant:
                relevant.add(term)
                stack += [x[0] for rule in rules_of[term] for x in rule.body if x[0] in rules_of]

    mark(seeds)
    needs = {
        term: {x[0] for rule in rules for x in rule.body if x[0] in rules_of} - relevant
        for term, rules in rules_of.items()
        if term not in relevant
    }
    components: list[DerivedComponent] = [
        (own, [rule for term in own for rule in rules_of[term]])
        for own in find_strongly_connected_components(needs)
    ]
    for own, rules in components:
        if not _has_one_model(program, own, rules):
            mark(own)
    components = [component for component in components if component[0][0] not in relevant]
    dropped = facts.keys() | {term for own, _ in components for term in own}
    return [clause for clause in clauses if clause.term not in dropped], facts, components


def _has_one_model(program: GroundProgram, terms: tuple[int, ...], rules: Sequence[Clause]) -> bool:
    """Whether the rules of a component have one stable model for all outcomes of other terms.

    They do if they are stratified and never derive two values of a term: there is only one, or the rules of
    the other are defaults such as ``p=false :- not p``.
    """
    from lcorpp.reasoning.transitions.stratified import Stratified  # few programs have such components

    rules_of: dict[int, dict[int, list[Clause]]] = {}  # term -> value -> rules
    for rule in rules:
        rules_of.setdefault(rule.term, {}).setdefault(rule.value, []).append(rule)

    def yields_to(rule: Clause, value: int) -> bool:
        return any(x[0] == rule.term and x[2] and not x[1] >> value & 1 for x in rule.body)

    for by_value in rules_of.values():
        for value, other in combinations(by_value, 2):
            if not (
                all(yields_to(rule, other) for rule in by_value[value])
                or all(yields_to(rule, value) for rule in by_value[other])
            ):
                return False
    guarded = [(0, rule, rule.body) for rule in rules]
    return Stratified.from_clauses(program, terms, guarded, terms) is not None
