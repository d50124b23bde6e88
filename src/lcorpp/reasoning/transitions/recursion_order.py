"""Order of the inputs of linear recursions, so that their frontiers are small.

The frontier after a step has the atoms that may still become true (undecided rules have them as head) and
those that are still used (undecided rules have them in the body, or other rules read them); see
`linear_recursion`. The number of its states grows exponentially with both.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from lcorpp.reasoning.grounding.ground_program import Clause

MAX_TRIED_TERMS = 4000
"""Maximal number of terms of all orders tried for one recursion; at least two orders are tried."""

_Graph = Mapping[int, set[int]]


def rank_components(
    components: Sequence[tuple[int, ...]],
    linear: Mapping[tuple[int, ...], Sequence[Clause]],
    queried: Collection[int],
    clauses: Sequence[Clause],
) -> list[int]:
    """Rank components in the order of the program, but the inputs of linear recursions by their terms.

    Args:
        linear: the components with linear rules, with these.
        queried: the terms whose outcomes queries read.
        clauses: all clauses.
    """
    ranks = list(range(len(components)))
    if not linear:
        return ranks
    component_of = {term: i for i, terms in enumerate(components) for term in terms}
    read = set(queried)
    for clause in clauses:
        own = component_of.get(clause.term, -1)
        read.update([literal[0] for literal in clause.body if component_of[literal[0]] != own])
    for terms, rules in linear.items():
        position = _order_terms(terms, rules, read)
        key: dict[int, int] = {}  # input -> position of the last term of its first rule
        for rule in rules:
            named = [rule.term, *[literal[0] for literal in rule.body]]
            at = max([position[term] for term in named if term in position])
            for term in named:
                if term not in position:
                    i = component_of[term]
                    key[i] = min(key.get(i, at), at)
        ordered = sorted(key, key=lambda i: (key[i], i))
        for i, rank in zip(ordered, sorted([ranks[i] for i in ordered]), strict=True):
            ranks[i] = rank
    return ranks


def _order_terms(terms: Sequence[int], rules: Sequence[Clause], read: Collection[int]) -> dict[int, int]:
    """Return term -> position in the best of several orders."""
    bodies: dict[int, set[int]] = {term: set() for term in terms}  # term -> those that its rules name
    heads: dict[int, set[int]] = {term: set() for term in terms}  # the converse
    for rule in rules:
        for literal in rule.body:
            if literal[0] in heads and literal[0] != rule.term:
                bodies[rule.term].add(literal[0])
                heads[literal[0]].add(rule.term)
    best = _order_from(terms[0], bodies, heads, read)
    n_orders = MAX_TRIED_TERMS // len(terms)
    # the last term of an order is at the rim of the graph
    for start in (best[1][-1], *terms[1 :: max(len(terms) // max(n_orders, 1), 1)][:n_orders]):
        best = min(best, _order_from(start, bodies, heads, read))
    return {term: i for i, term in enumerate(best[1])}


def _order_from(start: int, bodies: _Graph, heads: _Graph, read: Collection[int]) -> tuple[float, list[int]]:
    """Order terms greedily: next is the one that extends the frontier least.

    Returns:
        (cost, order): the estimated number of states of all steps.
    """
    n_bodies = {term: len(own) for term, own in bodies.items()}  # those not yet placed
    n_heads = {term: len(own) + (term in read) for term, own in heads.items()}
    order: list[int] = []
    placed: set[int] = set()
    reached = {start: 0}  # candidate -> the number of terms placed when it was reached
    width, cost = 0, 0.0

    def count_new(term: int) -> int:
        """Count the roles in the frontier that a term adds, less those that it finishes."""
        count = (n_bodies[term] > 0) + (n_heads[term] > 0)
        for other in heads[term]:
            count -= other in placed and n_bodies[other] == 1
        for other in bodies[term]:
            count -= other in placed and n_heads[other] == 1
        return count

    while reached:
        new, _, term = min([(count_new(term), since, term) for term, since in reached.items()])
        del reached[term]
        order.append(term)
        placed.add(term)
        width += new
        cost += 2.0**width
        for other in heads[term]:
            n_bodies[other] -= 1
        for other in bodies[term]:
            n_heads[other] -= 1
        for other in (*heads[term], *bodies[term]):
            if other not in placed:
                reached.setdefault(other, len(order))
    return cost, order
