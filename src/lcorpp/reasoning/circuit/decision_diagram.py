"""Compilation, step 3: expand a transition system to a decision diagram, an AND/OR graph of possible worlds.

The nodes of a step are the states before it. Each arc of a node carries an outcome of the step's terms with
its probability, and leads to one node of each branch that follows the step. So a world is a tree of arcs:
one arc of each step. Its measure is the product of their probabilities, and a sum over worlds is a sum over
the arcs of a node (OR) of products over the branches (AND). Example: two fair coins that do not both show
tails (c1 and c2, values heads and tails):

    sizes     [1, 2]
    arcs[0]   Arcs([0, 0], ([0, 1],), [0, 1])   sources, targets in the only branch, outcomes
    arcs[1]   Arcs([0, 0, 1], (), [2, 3, 2])    after tails (node 1) only c2=heads
    outcomes  [((0,), 1/2), ((1,), 1/2), ((0,), 1/2), ((1,), 1/2)]

Source: Mateescu, Dechter and Marinescu, "AND/OR multi-valued decision diagrams", JAIR 33, 2008.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning.answers import format_world
from lcorpp.reasoning.conditions import ConditionViolation
from lcorpp.reasoning.questions import QUERY_TERM
from lcorpp.reasoning.transitions.transition import Effect, Transition
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

MAX_ARCS = 2_000_000
"""A decision diagram has at most this many arcs."""

MAX_LEVEL_BITS = 2**32
"""The states of one step have at most this many bits together: half a gigabyte."""


class Arcs(NamedTuple):
    """The arcs of a step, as lists of equal length.

    sources: the node of each arc.
    targets: for each branch the node to which each arc leads.
    outcomes: the index of the outcome of each arc.
    """

    sources: list[int]
    targets: tuple[list[int], ...]
    outcomes: list[int]

    def select(self, kept: Sequence[int]) -> Arcs:
        """Return some of the arcs."""
        return Arcs(
            [self.sources[i] for i in kept],
            tuple([[branch[i] for i in kept] for branch in self.targets]),
            [self.outcomes[i] for i in kept],
        )


_Choice = tuple[Effect, int]
"""An outcome: its effect on the state, and its index."""

_Levels = tuple[Arcs, tuple[tuple[int, ...], ...]]
"""The arcs of a step, and the states to which they lead in each branch."""


@dataclass(slots=True, eq=False)
class DecisionDiagram:
    """The possible worlds of a program.

    sizes: the number of nodes of each step; nodes are numbered within their step. All are 0 if there is no
        world.
    arcs: the arcs of each step; steps with equal arcs share them.
    outcomes: the labels of the arcs: (outcome of each term of the step, probability).
    """

    system: TransitionSystem
    sizes: list[int]
    arcs: list[Arcs]
    outcomes: list[tuple[Sequence[int], Fraction]]

    def __repr__(self) -> str:
        n_arcs = sum(len(arcs.sources) for arcs in self.arcs)
        file = self.system.program.source.file
        return f"DecisionDiagram({file}: {len(self.arcs)} steps, {sum(self.sizes)} nodes, {n_arcs} arcs)"

    @property
    def has_worlds(self) -> bool:
        """Whether there is a possible world, maybe of measure 0."""
        return self.system.consistent and all(self.sizes[root] for root in self.system.tree.roots)

    def compute_weights(self) -> list[float]:
        """Convert the probabilities of the outcomes to floating point."""
        # outcomes share their fractions
        weights = {id(p): float(p) for p in {id(p): p for _, p in self.outcomes}.values()}
        return [weights[id(p)] for _, p in self.outcomes]


def build_decision_diagram(system: TransitionSystem, limit: int = MAX_ARCS) -> DecisionDiagram:
    """Expand the reachable states of a transition system, and drop nodes that are in no world.

    Raises:
        TooLargeError: there are more than `limit` arcs.
        ProgramError: a world breaks a condition of the language, or a component has too many stable models.
    """
    expander = _Expander()
    diagram = _expand(system, expander, limit)
    if expander.has_dead_ends:
        _prune(diagram)
    if expander.violations:  # a violation in no world was pruned
        for step, arcs in enumerate(diagram.arcs):
            for arc, outcome in enumerate(arcs.outcomes):
                if outcome in expander.violations:
                    raise _make_error(diagram, step, arc, expander.violations[outcome])
    return diagram


def _expand(system: TransitionSystem, expander: _Expander, limit: int) -> DecisionDiagram:
    """Expand step by step."""
    states: list[tuple[int, ...]] = [()] * len(system.transitions)
    if system.consistent:
        for root in system.tree.roots:
            states[root] = (0,)
    arcs: list[Arcs] = []
    known: dict[tuple[Transition, tuple[int, ...]], _Levels] = {}
    total = 0
    for step, transition in enumerate(system.transitions):
        max_arcs = min(limit - total, MAX_LEVEL_BITS // transition.n_bits)
        key = transition, states[step]
        levels = known.get(key) if transition.is_shared else None
        if levels is None:
            levels = expander.expand(transition, states[step], max_arcs)
            if transition.is_shared:
                known[key] = levels
        own, following = levels
        n_arcs = len(own.sources)
        if n_arcs > max_arcs:
            raise TooLargeError(
                f"{system.program.source.file}: more than {total + max_arcs} arcs in the decision diagram"
            )
        total += n_arcs
        arcs.append(own)
        for child, reached in zip(system.tree.children[step], following, strict=True):
            states[child] = reached
    return DecisionDiagram(system, [len(own) for own in states], arcs, expander.outcomes)


class _Expander:
    """Computes the arcs from the states of one step, and the states that they lead to.

    outcomes: as in `DecisionDiagram`.
    violations: outcome -> the condition that it breaks.
    has_dead_ends: whether there is a state without arcs.
    """

    def __init__(self) -> None:
        self.outcomes: list[tuple[Sequence[int], Fraction]] = []
        self.violations: dict[int, ConditionViolation] = {}
        self.has_dead_ends = False
        self._choices: dict[Transition, dict[int, list[_Choice]]] = {}

    def expand(self, transition: Transition, states: Sequence[int], max_arcs: int) -> _Levels:
        """Return the arcs and the states after the step; stop soon after `max_arcs` arcs."""
        input_mask, advance = transition.input_mask, transition.advance
        choices = self._list_choices(transition, {state & input_mask for state in states})
        sources: list[int] = []
        reached_states: list[int] = []
        outcomes: list[int] = []
        for source, state in enumerate(states):
            for effect, outcome in choices[state & input_mask]:
                reached = advance(state, effect)
                if reached is None:
                    continue
                sources.append(source)
                reached_states.append(reached)
                outcomes.append(outcome)
            if len(outcomes) > max_arcs:
                break
        self.has_dead_ends |= len(set(sources)) < len(states)
        targets, following = [], []
        for mask in transition.live_masks:
            own = [reached & mask for reached in reached_states]
            distinct = tuple(dict.fromkeys(own))
            numbers = {state: number for number, state in enumerate(distinct)}
            targets.append([numbers[state] for state in own])
            following.append(distinct)
        return Arcs(sources, tuple(targets), outcomes), tuple(following)

    def _list_choices(self, transition: Transition, inputs: set[int]) -> Mapping[int, list[_Choice]]:
        """List the outcomes with their effects, for each state of the input bits."""
        choices = self._choices.get(transition, {})
        if not choices.keys() >= inputs:
            missing = inputs.difference(choices)
            for bits, outcomes in transition.distribution.list_outcomes(missing).items():
                own: list[_Choice] = []
                for outcome in outcomes:
                    effect = transition.find_effect(outcome.values)
                    if effect is not None:
                        if outcome.violation:
                            self.violations[len(self.outcomes)] = outcome.violation
                        own.append((effect, len(self.outcomes)))
                        self.outcomes.append((outcome.values, outcome.weight))
                choices[bits] = own
            if transition.is_shared:
                self._choices[transition] = choices
        return choices


def _prune(diagram: DecisionDiagram) -> None:
    """Drop nodes without a world and arcs to them, bottom up; then nodes that no arc reaches any more."""
    children, arcs_of, sizes = diagram.system.tree.children, diagram.arcs, diagram.sizes
    sources_of: list[set[int] | None] = [None] * len(arcs_of)  # the nodes with a world, None for all
    shared: dict[
        int, tuple[Arcs, set[int]]
    ] = {}  # id of arcs -> (arcs, so that the id stays theirs; sources)
    for step in range(len(arcs_of) - 1, -1, -1):
        arcs = arcs_of[step]
        for branch, child in enumerate(children[step]):
            if (nodes := sources_of[child]) is not None:
                targets = arcs.targets[branch]
                arcs = arcs.select([i for i, target in enumerate(targets) if target in nodes])
        arcs_of[step] = arcs
        _, sources = shared.get(id(arcs)) or shared.setdefault(id(arcs), (arcs, set(arcs.sources)))
        if len(sources) < sizes[step]:
            sources_of[step] = sources
    if not all(arcs_of[root].sources for root in diagram.system.tree.roots):
        arcs_of[:] = [Arcs([], tuple([[] for _ in own]), []) for own in children]
        sizes[:] = [0] * len(sizes)
    numbers_of: dict[int, dict[int, int]] = {}  # step -> node that is reached -> its new number
    for step, own in enumerate(children):
        arcs = arcs_of[step]
        if step in numbers_of:
            numbers = numbers_of[step]
            arcs = arcs.select([i for i, source in enumerate(arcs.sources) if source in numbers])
            arcs = arcs._replace(sources=[numbers[source] for source in arcs.sources])
        for branch, child in enumerate(own):
            reached = set(arcs.targets[branch])
            if len(reached) < sizes[child]:
                sizes[child] = len(reached)
                numbers = numbers_of[child] = {node: number for number, node in enumerate(sorted(reached))}
                new = [numbers[target] for target in arcs.targets[branch]]
                arcs = arcs._replace(targets=(*arcs.targets[:branch], new, *arcs.targets[branch + 1 :]))
        arcs_of[step] = arcs


def _make_error(diagram: DecisionDiagram, step: int, arc: int, violation: ConditionViolation) -> ProgramError:
    """Make the error for a violated condition, with a world that contains the arc."""
    tree = diagram.system.tree
    parents = {child: parent for parent, own in enumerate(tree.children) for child in own}
    chosen = {step: arc}  # step -> arc, for the step and those above it
    below = step
    while below in parents:
        above = parents[below]
        node = diagram.arcs[below].sources[chosen[below]]
        branch = diagram.arcs[above].targets[tree.children[above].index(below)]
        chosen[above], below = branch.index(node), above
    nodes = dict.fromkeys(tree.roots, 0)
    path: list[int] = []
    for current, arcs in enumerate(diagram.arcs):
        own = chosen[current] if current in chosen else arcs.sources.index(nodes[current])
        path.append(arcs.outcomes[own])
        for child, targets in zip(tree.children[current], arcs.targets, strict=True):
            nodes[child] = targets[own]
    world = decode_world(diagram.system, [diagram.outcomes[outcome][0] for outcome in path])
    program = diagram.system.program
    names = [program.names[term] for term in tree.order[step]]
    message = violation.format(program.source.statements, names)
    return ProgramError(f"{message}, in the world {format_world(world)}")


def iterate_arcs(arcs: Arcs) -> Iterator[tuple[int, tuple[int, ...], int]]:
    """Yield the source, the target in each branch and the outcome of each arc."""
    branches = zip(*arcs.targets, strict=True) if arcs.targets else [()] * len(arcs.sources)
    return zip(arcs.sources, branches, arcs.outcomes, strict=True)


def decode_world(system: TransitionSystem, outcomes: Iterable[Sequence[int]]) -> dict[str, str]:
    """Convert the outcomes of all steps to term -> value, sorted by term, without terms of queries."""
    program = system.program
    outcome_of = dict(system.facts)
    outcome_of |= {
        term: value
        for terms, values in zip(system.tree.order, outcomes, strict=True)
        for term, value in zip(terms, values, strict=True)
    }
    if system.derived:
        from lcorpp.reasoning.transitions.stratified import derive_values
    for component, clauses in system.derived:
        outcome_of |= derive_values(program, component, clauses, outcome_of)
    world = {
        program.names[term]: program.values[term][value]
        for term, value in outcome_of.items()
        if value < len(program.values[term]) and not program.names[term].startswith(QUERY_TERM)
    }
    return dict(sorted(world.items()))
