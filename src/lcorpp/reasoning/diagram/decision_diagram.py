"""Compilation, step 3: expand a transition system to a decision diagram, an AND/OR graph of possible worlds.

The nodes of a step are the states before it. Each arc of a node carries an outcome of the step's terms with
its probability, and leads to one node of each branch that follows the step. So a world is a tree of arcs:
one arc of each step. Its measure is the product of their probabilities, and a sum over worlds is a sum over
the arcs of a node (OR) of products over the branches (AND). Example: two fair coins that do not both show
tails (c1 and c2, values heads and tails):

    sizes     [1, 2]
    arcs[0]   Arcs([0, 0], ([0, 1],), [0, 1])   sources, targets in the only branch, outcomes
    arcs[1]   Arcs([0, 0, 1], (), [2, 3, 2])    after tails (node 1) only c2=heads
    outcomes  c1=heads, c1=tails, c2=heads, c2=tails, each with probability 1/2

Source: Mateescu, Dechter and Marinescu, "AND/OR multi-valued decision diagrams", JAIR 33, 2008.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning._diagram import Diagram
from lcorpp.reasoning.answers import format_world
from lcorpp.reasoning.conditions import ConditionViolation
from lcorpp.reasoning.questions import QUERY_TERM
from lcorpp.reasoning.transitions.local_distribution import Outcome
from lcorpp.reasoning.transitions.transition import Transition
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

MAX_BYTES = 2**30
"""Maximum memory of the arcs of a decision diagram with the states of a step, and of the layers of a circuit.
Steps with equal arcs share them."""

TRIALS = ((2**21, 1e7), (2**26, 2e8))
"""(maximum memory, work of the search for a better order if the diagram takes more), see `improve_order`."""

MAX_LOG_STATES = 30
"""Maximum estimate of the states of a program with recursions, as a logarithm to base 2. Estimates of other
programs may be far too high, as probabilities of 0 and deterministic rules exclude most states."""

MAX_LABELS = 2_000_000
"""Maximum number of different outcomes of all steps."""

MAX_LISTED_ARCS = 5_000_000
"""Maximum number of arcs for queries about whole worlds, and for fractions."""


class Arcs(NamedTuple):
    """The arcs of a step, as lists of equal length, sorted by source.

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


@dataclass(eq=False)
class DecisionDiagram:
    """The possible worlds of a program.

    system: whose steps are expanded: that of the caller, or one with a better order.
    graph: the nodes and arcs, in C++.
    """

    system: TransitionSystem
    graph: Diagram

    def __repr__(self) -> str:
        file, sizes = self.system.program.source.file, self.sizes
        return f"DecisionDiagram({file}: {len(sizes)} steps, {sum(sizes)} nodes, {self.graph.n_arcs} arcs)"

    @cached_property
    def sizes(self) -> list[int]:
        """The number of nodes of each step, which are numbered within it. All are 0 without worlds."""
        return self.graph.sizes

    @cached_property
    def arcs(self) -> list[Arcs]:
        """The arcs of each step.

        Raises:
            TooLargeError: they are more than `MAX_LISTED_ARCS`.
        """
        if self.graph.n_arcs > MAX_LISTED_ARCS:
            file, n_arcs = self.system.program.source.file, self.graph.n_arcs
            raise TooLargeError(
                f"{file}: {n_arcs} arcs in the decision diagram; fractions, single worlds and samples need at"
                f" most {MAX_LISTED_ARCS}"
            )
        return [self.list_arcs(step) for step in range(len(self.sizes))]

    def list_arcs(self, step: int) -> Arcs:
        """List the arcs of a step."""
        sources, targets, outcomes = self.graph.list_arcs(step)
        return Arcs(sources, tuple(targets), outcomes)

    @property
    def outcomes(self) -> list[Outcome]:
        """The labels of the arcs."""
        return self.system.outcomes

    @property
    def has_worlds(self) -> bool:
        """Whether there is a possible world, maybe of measure 0."""
        return self.system.consistent and all(self.sizes[root] for root in self.system.tree.roots)


def build_decision_diagram(
    system: TransitionSystem,
    max_bytes: int = MAX_BYTES,
    *,
    progress: Callable[[float, str], None] | None = None,
) -> DecisionDiagram:
    """Expand the reachable states of a transition system, and drop nodes that are in no world.

    If the diagram is large, better orders are searched for, and the diagram is that of another system.

    Args:
        max_bytes: the limit of memory.
        progress: called while a large diagram is expanded, with the share of its steps and a text.

    Raises:
        TooLargeError: the diagram takes more memory.
        ProgramError: a world breaks a condition of the language, or a component has too many stable models.
    """
    file, graph, log_states = system.program.source.file, None, 0.0
    for limit, work in TRIALS:
        if limit < max_bytes:
            graph = _expand(system, limit, progress if limit > TRIALS[0][0] else None)
            if graph is not None:
                break
            better, log_states = system.reorder(work)
            system = better or system
    if graph is None:
        if system.tree.recursions and log_states > MAX_LOG_STATES:
            raise TooLargeError(
                f"{file}: about 2^{log_states:.1f} states of the decision diagram; expected at most"
                f" 2^{MAX_LOG_STATES}"
            )
        graph = _expand(system, max_bytes, progress)
    if graph is None:
        raise TooLargeError(f"{file}: more than {max_bytes / 2**20:.4g} MiB of arcs in the decision diagram")
    return _complete(system, graph)


def find_small_diagram(system: TransitionSystem) -> DecisionDiagram | None:
    """Expand a transition system if its diagram is so small that no better order is needed, see `TRIALS`.

    Raises:
        ProgramError: as `build_decision_diagram`.
    """
    graph = _expand(system, TRIALS[0][0])
    return None if graph is None else _complete(system, graph)


def _complete(system: TransitionSystem, graph: Diagram) -> DecisionDiagram:
    """Drop nodes that are in no world; raise an error if a world breaks a condition of the language."""
    if graph.has_dead_ends:
        graph.prune()
    diagram = DecisionDiagram(system, graph)
    if any(outcome.violation for outcome in system.outcomes):  # a violation in no world was pruned
        for step in range(len(system.transitions)):
            for label in graph.list_labels(step):
                if violation := system.outcomes[label].violation:
                    raise _make_error(diagram, step, label, violation)
    return diagram


def _expand(
    system: TransitionSystem, max_bytes: int, progress: Callable[[float, str], None] | None = None
) -> Diagram | None:
    """Expand step by step; return None if the diagram takes more memory."""
    tree = system.tree
    n_words = system.transitions[0].n_words if system.transitions else 1
    graph = Diagram(tree.children, tree.roots, n_words, system.consistent)
    with system.expansion:
        for step, transition in enumerate(system.transitions):
            if progress:
                progress(step / len(system.transitions), f"{graph.n_arcs} arcs of the decision diagram")
            if missing := graph.enter(transition.compiled, transition.is_shared):
                _add_choices(system, transition, missing)
            if not graph.expand(max_bytes):
                return None
    return graph


def _add_choices(system: TransitionSystem, transition: Transition, inputs: Iterable[bytes]) -> None:
    """Add the outcomes of a transition with their effects, for each state of the input bits."""
    outcomes = system.outcomes
    packed = {int.from_bytes(bits, "little"): bits for bits in inputs}
    for state, own in transition.distribution.list_outcomes(packed).items():
        choices: list[tuple[int, int]] = []
        for outcome in own:
            effect = transition.find_effect(outcome.values)
            if effect is not None:
                choices.append((effect.number, len(outcomes)))
                outcomes.append(outcome)
        transition.compiled.add_choices(packed[state], choices)
    if len(outcomes) > MAX_LABELS:
        file = system.program.source.file
        raise TooLargeError(f"{file}: more than {MAX_LABELS} labels of arcs in the decision diagram")


def _make_error(
    diagram: DecisionDiagram, step: int, label: int, violation: ConditionViolation
) -> ProgramError:
    """Make the error for a violated condition, with a world that has an arc of this label."""
    tree = diagram.system.tree
    parents = {child: parent for parent, own in enumerate(tree.children) for child in own}
    chosen = {step: diagram.list_arcs(step).outcomes.index(label)}  # step -> arc, for it and those above it
    below = step
    while below in parents:
        above = parents[below]
        node = diagram.list_arcs(below).sources[chosen[below]]
        branch = diagram.list_arcs(above).targets[tree.children[above].index(below)]
        chosen[above], below = branch.index(node), above
    nodes = dict.fromkeys(tree.roots, 0)
    path: list[int] = []
    for current, children in enumerate(tree.children):
        arcs = diagram.list_arcs(current)
        own = chosen[current] if current in chosen else arcs.sources.index(nodes[current])
        path.append(arcs.outcomes[own])
        for child, targets in zip(children, arcs.targets, strict=True):
            nodes[child] = targets[own]
    world = decode_world(diagram.system, [diagram.outcomes[outcome].values for outcome in path])
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
