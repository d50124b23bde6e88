"""Compilation, step 2: the elimination tree, in which the components of a ground program are decided.

A component is a strongly connected set of terms of the dependency graph (usually one term); each comes after
the components that its clauses name. After some components are decided, the others may fall into parts that
share no clause: given the state, each part has its own worlds, and their sums multiply. The tree branches
there, so that the cost is exponential in the width of a branch, not of the whole frontier. For
``a. b :- a. c :- a. d :- c.``:

    a -> b        children  [(1, 2), (), (3,), ()]
      -> c -> d   roots     (0,)

The tree is built from its leaves. Of the components that no clause needs any more, the one that shares
clauses with the fewest others (in bits) is eliminated; the others then share what remains of its clauses.
This is minimum-degree elimination, kept to topological orders; scopes are merged instead of connecting all
pairs of their members.

Source: Amestoy, Davis and Duff, "An approximate minimum degree ordering algorithm", SIAM J. Matrix Anal. 17,
1996 (quotient graphs); Dechter and Mateescu, "AND/OR search spaces for graphical models", Artificial
Intelligence 171, 2007 (pseudo trees).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from math import log2

from lcorpp.reasoning.grounding.ground_program import Clause
from lcorpp.reasoning.transitions.strong_components import find_strongly_connected_components

MAX_EXACT_DEGREE = 32
"""The degrees of the members of larger scopes are updated only when one of them is about to be eliminated."""


@dataclass(frozen=True, slots=True, eq=False)
class EliminationTree:
    """Steps in depth-first order: a step comes before its children, and a subtree is a range of steps.

    order: step -> the terms that it decides.
    children: step -> the first steps of the independent parts that remain after it.
    roots: the first steps of the parts that are independent from the start.
    """

    order: Sequence[tuple[int, ...]]
    children: Sequence[tuple[int, ...]]
    roots: tuple[int, ...]

    @classmethod
    def from_nodes(
        cls,
        terms: Sequence[tuple[int, ...]],
        children: Sequence[Sequence[int]],
        roots: Iterable[int],
    ) -> EliminationTree:
        """Number the nodes of a tree depth first; brothers keep their order.

        Args:
            terms: node -> the terms that it decides.
            children, roots: the tree over the nodes.
        """
        preorder: list[int] = []
        stack = sorted(roots, reverse=True)
        while stack:
            node = stack.pop()
            preorder.append(node)
            own = children[node]
            stack.extend(own if len(own) < 2 else sorted(own, reverse=True))
        number = [0] * len(terms)
        for new, node in enumerate(preorder):
            number[node] = new
        return cls(
            [terms[node] for node in preorder],
            [tuple(sorted([number[child] for child in children[node]])) for node in preorder],
            tuple(sorted([number[root] for root in roots])),
        )


def build_elimination_tree(clauses: Sequence[Clause], outcomes: Sequence[int]) -> EliminationTree:
    """Build the elimination tree of a ground program.

    Args:
        clauses: the simplified clauses.
        outcomes: the mask of the possible outcomes of each term.
    """
    n_terms = len(outcomes)
    needs: list[set[int]] = [set() for _ in range(n_terms)]  # term -> the terms in the bodies of its clauses
    joint: set[frozenset[int]] = set()  # the terms of each constraint
    for clause in clauses:
        body = clause.body
        if clause.term >= 0:  # constraints have no head
            for literal in body:
                needs[clause.term].add(literal[0])
        elif len(body) > 1:
            joint.add(frozenset([literal[0] for literal in body]))
    for term, needed in enumerate(needs):
        needed.discard(term)
    components: list[tuple[int, ...]] = [(term,) for term in range(n_terms)]
    component_needs = needs
    constraints: Iterable[frozenset[int]] = joint
    if any(needed and max(needed) > term for term, needed in enumerate(needs)):  # cycles are possible
        strong = find_strongly_connected_components(needs)
        if len(strong) < n_terms:
            components = sorted(strong)
            component_of = {term: i for i, terms in enumerate(components) for term in terms}
            component_needs = [
                {component_of[need] for term in terms for need in needs[term]} - {i}
                for i, terms in enumerate(components)
            ]
            constraints = {frozenset([component_of[term] for term in group]) for group in joint}
    ranks = _rank_components(components, clauses)
    bits = {mask: log2(mask.bit_count() or 1) for mask in set(outcomes)}
    sizes = [sum([bits[outcomes[term]] for term in terms]) for terms in components]
    children, roots = _eliminate(
        component_needs, [group for group in constraints if len(group) > 1], sizes, ranks
    )
    return EliminationTree.from_nodes(components, children, roots)


def _rank_components(components: Sequence[tuple[int, ...]], clauses: Iterable[Clause]) -> list[int]:
    """Rank components in the order of the program, except for the inputs of a component of several terms.

    These are decided one after the other, and the component's terms between which none is decided yet, or all
    are, cost nothing (see `linear_recursion`): so they are ranked by the distance of the terms, as in the
    Cuthill-McKee order of a sparse matrix.
    """
    ranks = list(range(len(components)))
    if all(len(terms) == 1 for terms in components):
        return ranks
    component_of = {term: i for i, terms in enumerate(components) for term in terms}
    neighbours: dict[int, set[int]] = {
        term: set() for terms in components if len(terms) > 1 for term in terms
    }
    inputs: dict[int, list[tuple[int, set[int]]]] = {}  # component -> (input, terms that a clause links)
    for clause in clauses:
        own = component_of.get(clause.term, -1)
        if own >= 0 and len(components[own]) > 1:
            linked = {clause.term, *(x[0] for x in clause.body if component_of[x[0]] == own)}
            for term in linked:
                neighbours[term] |= linked
            for other in {component_of[literal[0]] for literal in clause.body} - {own}:
                inputs.setdefault(own, []).append((other, linked))
    for own, links in inputs.items():
        position: dict[int, int] = {}
        for term in components[own]:
            if term not in position:
                end = _list_by_distance(term, neighbours)[-1]  # far from the term, so at the rim
                for reached in _list_by_distance(end, neighbours):
                    position[reached] = len(position)
        key: dict[int, int] = {}
        for other, linked in links:
            at = max([position[term] for term in linked])
            key[other] = min(key.get(other, at), at)
        ordered = sorted(key, key=lambda other: (key[other], other))
        for other, rank in zip(ordered, sorted([ranks[other] for other in ordered]), strict=True):
            ranks[other] = rank
    return ranks


def _list_by_distance(start: int, neighbours: Mapping[int, set[int]]) -> list[int]:
    """List the reachable nodes, nearest first; of equally near ones those with few neighbours first."""
    order, seen = [start], {start}
    for node in order:
        new = sorted(neighbours[node] - seen, key=lambda other: (len(neighbours[other]), other))
        seen.update(new)
        order.extend(new)
    return order


def _eliminate(
    needs: Sequence[set[int]],
    groups: Iterable[Iterable[int]],
    sizes: Sequence[float],
    ranks: Sequence[int],
) -> tuple[list[list[int]], list[int]]:
    """Eliminate components from the leaves of the tree to the roots.

    Args:
        needs: component -> the components that must come before it.
        groups: the components of each constraint.
        sizes: the bits of each component.
        ranks: a permutation; of equally good components the one with the highest rank is eliminated.

    Returns:
        (children, roots): component -> those that follow it in the tree; those that none precedes.
    """
    # components that share a clause or, after the elimination of others, what remains of their clauses
    scopes = [{i, *own} for i, own in enumerate(needs)] + [set(group) for group in groups]
    origin = [-1] * len(scopes)  # scope -> the component whose elimination left it
    scopes_of: list[set[int]] = [set() for _ in needs]
    n_users = [0] * len(needs)  # the components not yet eliminated whose clauses name this one
    for number, scope in enumerate(scopes):
        for member in scope:
            scopes_of[member].add(number)
    for own in needs:
        for need in own:
            n_users[need] += 1

    def compute_degree(i: int) -> float:
        """The bits of all components that share a scope with a component."""
        if len(scopes_of[i]) == 1:
            (number,) = scopes_of[i]
            members = scopes[number]
            if len(members) > MAX_EXACT_DEGREE:
                return len(members)
        else:
            members = set().union(*[scopes[number] for number in scopes_of[i]])
        return sum([sizes[member] for member in members]) - sizes[i]

    degrees = [-1.0] * len(needs)  # of the components on the heap
    outdated = [False] * len(needs)  # whether the degree may have grown
    heap: list[tuple[float, int, int]] = []

    def push(i: int) -> None:
        degrees[i], outdated[i] = compute_degree(i), False
        heappush(heap, (degrees[i], -ranks[i], i))

    eliminated = [False] * len(needs)
    children: list[list[int]] = [[] for _ in needs]
    roots: list[int] = []
    ready = [i for i, count in enumerate(n_users) if not count]  # not yet on the heap
    while heap or ready:
        if len(ready) == 1 and not heap:  # no choice
            i = ready.pop()
        else:
            while ready:
                push(ready.pop())
            degree, _, i = heappop(heap)
            if eliminated[i] or degree != degrees[i]:
                continue
            if outdated[i]:
                push(i)
                continue
        eliminated[i] = True
        own = scopes_of[i]
        children[i] = [origin[number] for number in own if origin[number] >= 0]
        if len(own) == 1:
            (number,) = own
            scope = scopes[number]
            scope.discard(i)
        else:
            number = len(scopes)
            scope = set().union(*[scopes[other] for other in own])
            scope.discard(i)
            for member in scope:
                scopes_of[member] -= own
                scopes_of[member].add(number)
                outdated[member] = True
            scopes.append(scope)
            origin.append(-1)
        origin[number] = i
        if not scope:
            roots.append(i)
        for need in needs[i]:
            n_users[need] -= 1
            if not n_users[need]:
                ready.append(need)
        if len(scope) <= MAX_EXACT_DEGREE:
            for member in scope:
                if not n_users[member] and degrees[member] >= 0:
                    push(member)
    return children, roots
