"""Compilation, step 2: rules that no query depends on, such as those of facts and of unobserved effects.

Rules that only derive values, one for each term, change no probability: in each world of the other terms they
have exactly one stable model. So terms that neither a query nor a constraint nor a random selection depends
on need no step; `derive_values` computes their outcomes if a world is listed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components
from lcorpp.reasoning.transitions.linear_recursion import find_edges, is_linear

DerivedComponent = tuple[tuple[int, ...], Sequence[Clause]]
"""The terms of a component, and their rules."""


def separate_irrelevant_rules(
    program: GroundProgram, clauses: list[Clause], queried: Collection[int]
) -> tuple[list[Clause], list[DerivedComponent]]:
    """Separate the rules of the terms that no query, constraint or random selection depends on.

    Args:
        clauses: the simplified clauses.
        queried: the terms whose outcomes queries read.

    Returns:
        (the other clauses, the irrelevant components); a component comes after those that it depends on.
    """
    rules_of: dict[int, list[Clause]] = {}
    stack = list(program.do)
    for clause in clauses:
        if clause.kind is ClauseKind.DERIVE:
            rules_of.setdefault(clause.term, []).append(clause)
        else:
            stack.append(clause.term)
            stack += [literal[0] for literal in clause.body]
    if not rules_of:
        return clauses, []
    relevant: set[int] = set()

    def mark(terms: Iterable[int]) -> None:
        """Mark terms, and those that they depend on, as relevant."""
        stack = [term for term in terms if term in rules_of]
        while stack:
            term = stack.pop()
            if term not in relevant:
                relevant.add(term)
                stack += [x[0] for rule in rules_of[term] for x in rule.body if x[0] in rules_of]

    mark([*stack, *queried])
    irrelevant = [term for term in rules_of if term not in relevant]
    needs = {
        term: {x[0] for rule in rules_of[term] for x in rule.body if x[0] in rules_of} - relevant
        for term in irrelevant
    }
    components: list[DerivedComponent] = [
        (own, [rule for term in own for rule in rules_of[term]])
        for own in find_strongly_connected_components(needs)
    ]
    for own, rules in components:
        if not _has_one_model(program, own, rules):
            mark(own)
    components = [component for component in components if component[0][0] not in relevant]
    dropped = {term for own, _ in components for term in own}
    return [clause for clause in clauses if clause.term not in dropped], components


def _has_one_model(program: GroundProgram, terms: Sequence[int], rules: Sequence[Clause]) -> bool:
    """Whether the rules of a component have one stable model for all outcomes of other terms.

    This holds for linear rules if no term has rules with different values, except for one default.
    """
    if all(not rule.body for rule in rules) and len({rule.value for rule in rules}) == len(terms) == 1:
        return True  # a fact
    if not is_linear(program, set(terms), rules):
        return False
    own = set(terms)
    values: dict[int, set[int]] = {term: set() for term in terms}
    defaults: dict[int, tuple[int, int]] = {}  # term -> value, mask of the outcomes for which it applies
    for rule in rules:
        literals = [literal for literal in rule.body if literal[0] in own]
        if find_edges(program, rule, literals) != []:
            values[rule.term].add(rule.value)
        elif rule.term in defaults:
            return False
        else:
            mask = -1
            for _, own_mask, _ in literals:
                mask &= own_mask
            defaults[rule.term] = rule.value, mask
    return all(len(own) < 2 for own in values.values()) and all(
        mask >> value & 1 and not any(mask >> other & 1 for other in values[term] - {value})
        for term, (value, mask) in defaults.items()
    )
