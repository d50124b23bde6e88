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

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from math import log2

from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components
from lcorpp.reasoning.transitions.linear_recursion import find_linear_components
from lcorpp.reasoning.transitions.recursion_order import rank_components

MAX_EXACT_DEGREE = 32
"""The degrees of the members of larger scopes are updated only when one of them is about to be eliminated."""


@dataclass(frozen=True, slots=True, eq=False)
class EliminationTree:
    """Steps in depth-first order: a step comes before its children, and a subtree is a range of steps.

    order: step -> the terms that it decides; terms that no clause names have no value and no step.
    children: step -> the first steps of the independent parts that remain after it.
    roots: the first steps of the parts that are independent from the start.
    ends: step -> the end of the range of its subtree.
    linear: the components of several terms with linear rules, see `linear_recursion`.
    """

    order: Sequence[tuple[int, ...]]
    children: Sequence[tuple[int, ...]]
    roots: tuple[int, ...]
    ends: Sequence[int]
    linear: Collection[tuple[int, ...]]

    def list_branches(self, step: int) -> list[range]:
        """List the steps of each branch that follows a step."""
        return [range(child, self.ends[child]) for child in self.children[step]]

    def find_path(self, step: int) -> list[int]:
        """Return the steps from a root to a step."""
        return [above for above in range(step + 1) if self.ends[above] > step]


def build_elimination_tree(
    program: GroundProgram, clauses: Sequence[Clause], outcomes: Sequence[int], queried: Collection[int]
) -> EliminationTree:
    """Build the elimination tree of a ground program.

    Args:
        clauses: the simplified clauses.
        outcomes: the mask of the possible outcomes of each term.
        queried: the terms whose outcomes queries read.
    """
    needs: defaultdict[int, set[int]] = defaultdict(set)  # term -> the terms in the bodies of its clauses
    joint: set[frozenset[int]] = set()  # the terms of each constraint
    for clause in clauses:
        body = clause.body
        if clause.term >= 0:  # constraints have no head
            own = needs[clause.term]
            for literal in body:
                own.add(literal[0])
        elif len(body) > 1:
            joint.add(frozenset([literal[0] for literal in body]))
    for term in (*program.do, *queried):
        needs[term]  # an intervention alone may give a value to a term, and queries read also no value
    for term, own in needs.items():
        own.discard(term)
    terms = sorted(needs)
    components: list[tuple[int, ...]] = [(term,) for term in terms]
    if any(own and max(own) > term for term, own in needs.items()):  # cycles are possible
        components = sorted(find_strongly_connected_components(needs))
    component_needs: Sequence[set[int]]
    constraints: Iterable[Collection[int]] = joint
    if len(components) == len(outcomes):
        component_needs = [needs[term] for term in terms]
    else:
        component_of = {term: i for i, own in enumerate(components) for term in own}
        component_needs = [
            {component_of[need] for term in own for need in needs[term]} - {i}
            for i, own in enumerate(components)
        ]
        constraints = {frozenset([component_of[term] for term in group]) for group in joint}
    linear = find_linear_components(program, components, clauses)
    ranks = rank_components(components, linear, queried, clauses)
    bits = {mask: log2(mask.bit_count() or 1) for mask in set(outcomes)}
    sizes = [sum([bits[outcomes[term]] for term in own]) for own in components]
    children, roots = _eliminate(
        component_needs, [group for group in constraints if len(group) > 1], sizes, ranks
    )
    if len(components) < len(terms):
        random = {clause.term for clause in clauses if clause.kind is ClauseKind.SELECT} | program.do.keys()
        _merge_deterministic(components, children, random.union(*linear))
    return _number_nodes(components, children, roots, frozenset(linear))


def _merge_deterministic(
    components: list[tuple[int, ...]], children: list[list[int]], separate: Collection[int]
) -> None:
    """Merge each deterministic component of several terms with the deterministic ones before and after it.

    `Stratified` evaluates such a component for all states at once, so its deterministic inputs should be part
    of it.

    Args:
        separate: terms whose components stay as they are.
    """
    mergeable = [not any(term in separate for term in own) for own in components]
    following = {
        i: own[0] for i, own in enumerate(children) if len(own) == 1 and mergeable[i] and mergeable[own[0]]
    }
    for start in following.keys() - set(following.values()):
        run = [start]
        while run[-1] in following:
            run.append(following[run[-1]])
        if any(len(components[i]) > 1 for i in run):
            components[start] = tuple([term for i in run for term in components[i]])
            children[start] = children[run[-1]]


def _number_nodes(
    components: Sequence[tuple[int, ...]],
    children: Sequence[Sequence[int]],
    roots: Iterable[int],
    linear: Collection[tuple[int, ...]],
) -> EliminationTree:
    """Number the nodes of a tree depth first; brothers keep their order."""
    ordered = [own if len(own) < 2 else sorted(own) for own in children]
    preorder: list[int] = []
    stack = sorted(roots, reverse=True)
    while stack:
        node = stack.pop()
        preorder.append(node)
        stack.extend(ordered[node][::-1])
    number = [0] * len(components)
    for new, node in enumerate(preorder):
        number[node] = new
    numbered = [tuple([number[child] for child in ordered[node]]) for node in preorder]
    ends = list(range(1, len(preorder) + 1))
    for step in range(len(preorder) - 1, -1, -1):
        if numbered[step]:
            ends[step] = ends[numbered[step][-1]]
    order = [components[node] for node in preorder]
    return EliminationTree(order, numbered, tuple(sorted([number[root] for root in roots])), ends, linear)


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
    # scope: components that share a clause or, after the elimination of others, what remains of their clauses
    scopes = [{i, *own} for i, own in enumerate(needs)] + [set(group) for group in groups]
    origin = [-1] * len(scopes)  # scope -> the component whose elimination left it
    merged = [False] * len(scopes)  # into a later scope
    scopes_of: list[list[int]] = [[i] if own else [] for i, own in enumerate(needs)]
    n_users = [0] * len(needs)  # the components not yet eliminated whose clauses name this one
    for i, needed in enumerate(needs):
        for need in needed:
            scopes_of[need].append(i)
            n_users[need] += 1
    for number in range(len(needs), len(scopes)):
        for member in scopes[number]:
            scopes_of[member].append(number)

    def compute_degree(i: int) -> float:
        """The bits of all components that share a scope with a component."""
        own = scopes_of[i] = [number for number in scopes_of[i] if not merged[number]]
        if not own:
            return 0.0
        members = scopes[own[0]]
        if len(own) == 1 and len(members) > MAX_EXACT_DEGREE:
            return len(members)
        if len(own) > 1:
            members = members.union(*[scopes[number] for number in own])
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
        own = [number for number in scopes_of[i] if not merged[number]]
        if not own:
            roots.append(i)
            continue
        number, scope = own[0], scopes[own[0]]
        children[i] += [origin[other] for other in own if origin[other] >= 0]
        if len(own) > 1:
            number = len(scopes)
            scope = scope.union(*[scopes[other] for other in own])
            for other in own:
                merged[other] = True
            for member in scope:
                scopes_of[member].append(number)
                outdated[member] = True
            scopes.append(scope)
            origin.append(-1)
            merged.append(False)
        scope.discard(i)
        origin[number] = i
        if not scope:
            roots.append(i)
        elif len(scope) == 1:  # the scope has done its work
            merged[number] = True
            children[next(iter(scope))].append(i)
        for need in needs[i]:
            n_users[need] -= 1
            if not n_users[need]:
                ready.append(need)
        if len(scope) <= MAX_EXACT_DEGREE:
            for member in scope:
                if not n_users[member] and degrees[member] >= 0:
                    push(member)
    return children, roots
