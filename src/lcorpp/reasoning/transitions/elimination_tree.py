"""Compilation, step 2: the elimination tree, in which the components of a ground program are decided.

A component is a strongly connected set of terms of the dependency graph (usually one term); each comes after
the components that its clauses name. After some components are decided, the others may fall into parts that
share no clause: given the state, each part has its own worlds, and their sums multiply. The tree branches
there, so that the cost is exponential in the width of a branch, not of the whole frontier. For
``a. b :- a. c :- a. d :- c.``:

    a -> b        children  [[1, 2], [], [3], []]
      -> c -> d   roots     [0]

Source: Dechter and Mateescu, "AND/OR search spaces for graphical models", Artificial Intelligence 171, 2007
(pseudo trees).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from math import log2
from typing import TYPE_CHECKING

from lcorpp.reasoning.grounding.ground_program import SELECT, Clause, GroundProgram
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components
from lcorpp.reasoning.transitions.elimination_order import (
    arrange,
    eliminate,
    list_children,
    list_depth_first,
)

if TYPE_CHECKING:  # few programs are recursive
    from lcorpp.reasoning.transitions.linear_recursion import LinearRecursion
    from lcorpp.reasoning.transitions.order_search import OrderSearch

MAX_FRONTIER = 24
"""Recursions with a larger estimated frontier are decided as a whole."""


MAX_DIAGRAM_WIDTH = 8
"""Decision diagrams that may have levels of more than 2 to this power nodes are compared with tables."""

MAX_PRUNED_WIDTH = 20
"""The same for programs with constraints, which usually cut most of the nodes off."""

MAX_SCOPE_BITS = 16
"""A term has a table if it and those that it depends on have at most this many bits."""


@dataclass(frozen=True, slots=True, eq=False)
class EliminationTree:
    """Steps in depth-first order: a step comes before its children, and a subtree is a range of steps.

    order: step -> the terms that it decides; terms that no clause names have no value and no step.
    children: step -> the first steps of the independent parts that remain after it.
    roots: the first steps of the parts that are independent from the start.
    ends: step -> the end of the range of its subtree.
    recursions: the components without a step of their own, see `linear_recursion`.
    width: bits of the largest set of components on which a step may depend, but for the inputs of recursions.
    is_wide: whether the diagram may be so large that tables are compared with it.
    may_have_blocks: whether there are components of several terms, or terms that depend on many others.
    """

    order: Sequence[tuple[int, ...]]
    children: Sequence[Sequence[int]]
    roots: Sequence[int]
    ends: Sequence[int]
    recursions: Sequence[LinearRecursion]
    width: float
    is_wide: bool
    may_have_blocks: bool

    @property
    def nodes(self) -> float:
        """An estimate of the nodes of the decision diagram, of which few steps have the largest number."""
        return float(2.0 ** min(self.width, 1000.0)) * max(len(self.order) / 8, 1)

    def list_branches(self, step: int) -> list[range]:
        """List the steps of each branch that follows a step."""
        return [range(child, self.ends[child]) for child in self.children[step]]

    def find_path(self, step: int) -> list[int]:
        """Return the steps from a root to a step."""
        return [above for above in range(step + 1) if self.ends[above] > step]


def build_elimination_tree(
    program: GroundProgram,
    clauses: Sequence[Clause],
    outcomes: Sequence[int],
    queried: Collection[int],
    max_frontier: int,
    search: OrderSearch | None = None,
    max_work: float = 0.0,
) -> EliminationTree | None:
    """Build the elimination tree of a ground program.

    Args:
        clauses: the simplified clauses.
        outcomes: the mask of the possible outcomes of each term.
        queried: the terms whose outcomes queries read.
        max_frontier: linear recursions with a larger frontier are decided as a whole.
        search, max_work: to search for a better order, see `order_search`.

    Returns:
        None if the search finds no better order.
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
    recursions: list[tuple[LinearRecursion, list[int]]] = []
    if any(len(own) > 1 for own in components):
        from lcorpp.reasoning.transitions.recursion_order import find_recursions  # few programs are recursive

        recursions = find_recursions(program, components, clauses, queried, max_frontier)
    if recursions:
        whole = {own.terms for own, _ in recursions}
        guessed = [(term,) for own, _ in recursions for term in own.guesses]
        components = sorted([*[own for own in components if own not in whole], *guessed])
        for recursion, _ in recursions:
            needs.update(recursion.needs)
            joint.add(recursion.scope)
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
    ranks, ordered = list(range(len(components))), set[int]()
    if recursions:
        from lcorpp.reasoning.transitions.recursion_order import rank_components

        ranks, ordered = rank_components(components, recursions)
    bits = {mask: log2(mask.bit_count() or 1) for mask in set(outcomes)}
    bits_of = [bits[mask] for mask in outcomes]
    sizes = [bits_of[own[0]] if len(own) == 1 else sum([bits_of[term] for term in own]) for own in components]
    groups = [group for group in constraints if len(group) > 1]
    parents, _, width = eliminate(component_needs, groups, sizes, ranks, ordered)
    if search is not None:
        from lcorpp.reasoning.transitions.order_search import improve_order  # few programs need it

        graph = component_needs, sizes, parents
        if not improve_order(search, program, components, recursions, clauses, *graph, max_work):
            return None
        assert search.order is not None
        parents, width, _ = arrange(component_needs, groups, sizes, search.order)
    children = list_children(parents)
    if len(components) < len(terms):
        random = {clause.term for clause in clauses if clause.kind is SELECT} | program.do.keys()
        _merge_deterministic(components, children, random.union(*[own.guesses for own, _ in recursions]))
    may_have_blocks = (
        bool(recursions)
        or len(components) < len(terms)
        or any(
            sizes[i] + sum([sizes[n] for n in own]) > MAX_SCOPE_BITS for i, own in enumerate(component_needs)
        )
    )
    is_wide = width > (MAX_PRUNED_WIDTH if groups and not may_have_blocks else MAX_DIAGRAM_WIDTH)
    own_recursions = [own for own, _ in recursions]
    return _number_nodes(components, children, own_recursions, width, is_wide, may_have_blocks)


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
        i: own[0]
        for i, own in enumerate(children[:-1])
        if len(own) == 1 and mergeable[i] and mergeable[own[0]]
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
    children: list[list[int]],
    recursions: Sequence[LinearRecursion],
    width: float,
    is_wide: bool,
    may_have_blocks: bool,
) -> EliminationTree:
    """Number the nodes of a tree depth first; brothers keep their order. The last children are the roots."""
    nodes = list_depth_first(children)  # step -> node
    step_of = [0] * len(components)
    for step, node in enumerate(nodes):
        step_of[node] = step
    numbered = [[step_of[child] for child in children[node]] for node in nodes]
    ends = list(range(1, len(nodes) + 1))
    for step in range(len(nodes) - 1, -1, -1):
        if numbered[step]:  # the subtree ends with that of the last child
            ends[step] = ends[numbered[step][-1]]
    order = [components[node] for node in nodes]
    roots = [step_of[root] for root in children[-1]]
    return EliminationTree(order, numbered, roots, ends, recursions, width, is_wide, may_have_blocks)
