"""Order of the inputs of linear recursions, so that their frontiers are small.

The frontier after a step has the atoms that may still become true (undecided rules have them as head) and
those that are still used (undecided rules have them in the body); see `recursion_frontier`. The number of its
states grows exponentially with both.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence, Set

from lcorpp.reasoning.grounding.ground_program import Clause, GroundProgram
from lcorpp.reasoning.transitions.linear_recursion import LinearRecursion, describe_recursion

MAX_TRIED_TERMS = 4000
"""Maximal number of terms of all orders tried for one recursion; at least two orders are tried."""

_Graph = Mapping[int, set[int]]


def find_recursions(
    program: GroundProgram,
    components: Iterable[tuple[int, ...]],
    clauses: Sequence[Clause],
    queried: Collection[int],
    max_frontier: int,
) -> list[tuple[LinearRecursion, list[int]]]:
    """Find the linear recursions with a small frontier, and the orders of their terms."""
    component_of = {term: own for own in components if len(own) > 1 for term in own}
    if not component_of:
        return []
    clauses_of: dict[tuple[int, ...], list[Clause]] = {own: [] for own in component_of.values()}
    read = set(queried)
    for clause in clauses:
        own = component_of.get(clause.term, ())
        if own:
            clauses_of[own].append(clause)
        read.update([literal[0] for literal in clause.body if component_of.get(literal[0]) is not own])
    found = []
    for terms, rules in clauses_of.items():
        recursion = describe_recursion(program, terms, rules, read)
        if recursion:
            width, order = order_terms(terms, rules, recursion.guesses.keys())
            if width <= max_frontier:
                found.append((recursion, order))
    return found


def rank_components(
    components: Sequence[tuple[int, ...]], recursions: Iterable[tuple[LinearRecursion, Sequence[int]]]
) -> tuple[list[int], set[int]]:
    """Rank components in the order of the program, but the inputs of linear recursions by their terms.

    Args:
        recursions: each with the order of its terms.

    Returns:
        (ranks, ordered): component -> rank; the inputs and guessed terms of recursions.
    """
    ranks, ordered = list(range(len(components))), set[int]()
    component_of = {term: i for i, terms in enumerate(components) for term in terms}
    for recursion, order in recursions:
        position = {term: i for i, term in enumerate(order)}
        rules: list[
            tuple[set[int], set[int]]
        ] = []  # the terms of the component and the inputs that each names
        last: dict[int, int] = {}  # term -> position of the last term that shares a rule with it
        for rule in recursion.clauses:
            named = {rule.term, *[literal[0] for literal in rule.body]}
            own = named & position.keys()
            rules.append((own, named - own))
            for term in own:
                last[term] = max(last.get(term, 0), *[position[other] for other in own])
        key: dict[int, int] = {}  # input -> position of the last term of its first rule
        for own, inputs in rules:
            at = max([position[term] for term in own]) if len(own) > 1 else last[min(own)]
            for term in inputs:
                i = component_of[term]
                key[i] = min(key.get(i, at), at)
        keys = {i: (at, 0, i) for i, at in key.items()}
        for term, needs in recursion.needs.items():  # a guess follows the last input
            i = component_of[term]
            keys[i] = max([key[component_of[need]] for need in needs], default=0), 1, i
        order = sorted(keys, key=keys.__getitem__)
        for i, rank in zip(order, sorted([ranks[i] for i in order]), strict=True):
            ranks[i] = rank
        ordered.update(keys)
    return ranks, ordered


def order_terms(terms: Sequence[int], rules: Sequence[Clause], guessed: Set[int]) -> tuple[int, list[int]]:
    """Order the terms of a recursion by the best of several orders.

    Returns:
        (width, order): the estimated number of roles of terms in the frontier, and the terms.
    """
    bodies: dict[int, set[int]] = {term: set() for term in terms}  # term -> those that its rules name
    heads: dict[int, set[int]] = {term: set() for term in terms}  # the converse
    for rule in rules:
        for literal in rule.body:
            if literal[0] in heads and literal[0] != rule.term:
                bodies[rule.term].add(literal[0])
                heads[literal[0]].add(rule.term)
    best = _order_from(terms[0], bodies, heads, guessed)
    n_orders = MAX_TRIED_TERMS // len(terms)
    # the last term of an order is at the rim of the graph
    for start in (best[2][-1], *terms[1 :: max(len(terms) // max(n_orders, 1), 1)][:n_orders]):
        best = min(best, _order_from(start, bodies, heads, guessed))
    return best[1:]


def _order_from(start: int, bodies: _Graph, heads: _Graph, guessed: Set[int]) -> tuple[float, int, list[int]]:
    """Order terms greedily: next is the one that extends the frontier least.

    Returns:
        (cost, width, order): the estimated number of states of all steps, and the largest frontier.
    """
    n_bodies = {term: len(own) for term, own in bodies.items()}  # those not yet placed
    n_heads = {term: len(own) for term, own in heads.items()}
    order: list[int] = []
    placed: set[int] = set()
    reached = {start: 0}  # candidate -> the number of terms placed when it was reached
    width, largest, cost = 0, 0, 0.0

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
        largest = max(largest, width)
        cost += 2.0 ** (width + (not guessed.isdisjoint(placed)))
        for other in heads[term]:
            n_bodies[other] -= 1
        for other in bodies[term]:
            n_heads[other] -= 1
        for other in (*heads[term], *bodies[term]):
            if other not in placed:
                reached.setdefault(other, len(order))
    return cost, largest, order
