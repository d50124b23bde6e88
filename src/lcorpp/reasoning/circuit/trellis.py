"""Compilation, step 3: expand a transition system to a trellis, whose paths are the possible worlds.

Level k contains the states before step k. Each arc of step k leads to level k + 1 and carries an outcome of
the step's terms with its probability. The measure of a world is the product along its path, and sums over
worlds are sums over paths. Example: two fair coins that do not both show tails (c1 and c2, values heads and
tails):

    level_sizes  [1, 2, 1]
    arcs[0]      ([0, 0], [0, 1], [0, 1])           sources, targets, outcomes: c1=heads, c1=tails
    arcs[1]      ([0, 0, 1], [0, 0, 0], [2, 3, 2])  after tails (state 1) only c2=heads
    outcomes     [((0,), 1/2), ((1,), 1/2), ((0,), 1/2), ((1,), 1/2)]
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning.answers import format_world
from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.transitions.local_distribution import ConditionViolation
from lcorpp.reasoning.transitions.transition import Transition
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

MAX_ARCS = 2_000_000
"""A trellis has at most this many arcs."""

MAX_LEVEL_BITS = 2**32
"""The states of one level have at most this many bits together: half a gigabyte."""


Arcs = tuple[list[int], list[int], list[int]]
"""The arcs of a step, three lists of equal length: source state, target state, index of the outcome."""

_Choice = tuple[int, int, int, Mapping[int, int], int]
"""The effect of an outcome on the state (`transition.Effect`) and the index of the outcome."""


@dataclass(slots=True, eq=False)
class Trellis:
    """A decision diagram: one level of states before each step and one after the last.

    level_sizes: the number of states of each level; states are numbered within their level.
    arcs: the arcs of each step; steps with equal arcs share them.
    outcomes: the labels of the arcs: (outcome of each term of the step, probability).
    """

    system: TransitionSystem
    level_sizes: list[int]
    arcs: list[Arcs]
    outcomes: list[tuple[Sequence[int], Fraction]]

    def __repr__(self) -> str:
        n_arcs = sum(len(sources) for sources, _, _ in self.arcs)
        file = self.system.program.source.file
        return f"Trellis({file}: {len(self.arcs)} steps, {sum(self.level_sizes)} states, {n_arcs} arcs)"

    def compute_weights(self) -> list[float]:
        """Convert the probabilities of the outcomes to floating point."""
        # outcomes share their fractions
        weights = {id(p): float(p) for p in {id(p): p for _, p in self.outcomes}.values()}
        return [weights[id(p)] for _, p in self.outcomes]


def build_trellis(system: TransitionSystem, limit: int = MAX_ARCS) -> Trellis:
    """Expand the reachable states of a transition system, and drop states that lead to no world.

    Raises:
        TooLargeError: there are more than `limit` arcs.
        ProgramError: a world breaks a condition of the language, or a component has too many stable models.
    """
    with pause_gc():
        trellis, violations = _expand(system, limit)
        _prune(trellis)
    if violations:  # a violation on a path to no world was pruned
        for step, (_, _, outcomes) in enumerate(trellis.arcs):
            for arc, outcome in enumerate(outcomes):
                if outcome in violations:
                    raise _make_error(trellis, step, arc, violations[outcome])
    return trellis


def _expand(system: TransitionSystem, limit: int) -> tuple[Trellis, dict[int, ConditionViolation]]:
    """Expand level by level; return the trellis and the conditions that outcomes break."""
    level_sizes: list[int] = [1 if system.consistent else 0]
    arcs: list[Arcs] = []
    states: tuple[int, ...] = (0,) if system.consistent else ()
    expander = _Expander()
    known: dict[tuple[Transition, tuple[int, ...]], tuple[Arcs, tuple[int, ...]]] = {}
    total = 0
    for transition in system.transitions:
        max_arcs = min(limit - total, MAX_LEVEL_BITS // max(transition.live_mask.bit_length(), 1))
        expanded = known.get((transition, states)) if transition.is_shared else None
        if expanded is None:
            expanded = expander.expand(transition, states, max_arcs)
            if transition.is_shared:
                known[transition, states] = expanded
        if len(expanded[0][0]) > max_arcs:
            raise TooLargeError(
                f"{system.program.source.file}: more than {total + max_arcs} arcs in the decision diagram"
            )
        arcs.append(expanded[0])
        states = expanded[1]
        level_sizes.append(len(states))
        total += len(expanded[0][0])
    return Trellis(system, level_sizes, arcs, expander.outcomes), expander.violations


class _Expander:
    """Computes the arcs from the states of one level, and the states that they lead to."""

    def __init__(self) -> None:
        self.outcomes: list[tuple[Sequence[int], Fraction]] = []
        self.violations: dict[int, ConditionViolation] = {}
        self._choices: dict[Transition, dict[int, list[_Choice]]] = {}

    def expand(
        self, transition: Transition, states: Sequence[int], max_arcs: int
    ) -> tuple[Arcs, tuple[int, ...]]:
        """Return the arcs and the states of the next level; stop soon after `max_arcs` arcs."""
        input_mask, live_mask = transition.input_mask, transition.live_mask
        absorptions = transition.absorptions
        choices = self._list_choices(transition, {state & input_mask for state in states})
        numbers: dict[int, int] = {}  # state of the next level -> its number
        sources: list[int] = []
        targets: list[int] = []
        outcomes: list[int] = []
        for source, state in enumerate(states):
            for sets, requires, completes, satisfied_of, outcome in choices[state & input_mask]:
                if requires and state & requires != requires:
                    continue
                reached = state | sets
                if completes:
                    satisfied = completes & ~state
                    while satisfied:
                        lowest = satisfied & -satisfied
                        reached |= satisfied_of[lowest]
                        satisfied ^= lowest
                for true, redundant in absorptions:
                    if reached & true:
                        reached |= redundant
                reached &= live_mask
                target = numbers.get(reached)
                if target is None:
                    target = numbers[reached] = len(numbers)
                sources.append(source)
                targets.append(target)
                outcomes.append(outcome)
            if len(outcomes) > max_arcs:
                break
        return (sources, targets, outcomes), tuple(numbers)

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
                        own.append((*effect, len(self.outcomes)))
                        self.outcomes.append((outcome.values, outcome.weight))
                choices[bits] = own
            if transition.is_shared:
                self._choices[transition] = choices
        return choices


def _prune(trellis: Trellis) -> None:
    """Drop the states from which no path leads to the last level, and renumber the others."""
    numbers: list[int] | None = None  # state -> new number, -1 if dropped; None if the level is unchanged
    for step in range(len(trellis.arcs) - 1, -1, -1):
        sources, targets, outcomes = trellis.arcs[step]
        if numbers is not None:
            kept = [i for i, target in enumerate(targets) if numbers[target] >= 0]
            sources, outcomes = [sources[i] for i in kept], [outcomes[i] for i in kept]
            targets = [numbers[targets[i]] for i in kept]
        alive = set(sources)
        if len(alive) == trellis.level_sizes[step]:
            numbers = None
        else:
            numbers = [-1] * trellis.level_sizes[step]
            for number, source in enumerate(sorted(alive)):
                numbers[source] = number
            sources = [numbers[source] for source in sources]
            trellis.level_sizes[step] = len(alive)
        trellis.arcs[step] = sources, targets, outcomes


def _make_error(trellis: Trellis, step: int, arc: int, violation: ConditionViolation) -> ProgramError:
    """Make the error for a violated condition, with a world that contains the arc."""
    sources, targets, outcomes = trellis.arcs[step]
    path = {step: outcomes[arc]}
    state = sources[arc]
    for before in range(step - 1, -1, -1):
        own_sources, own_targets, own_outcomes = trellis.arcs[before]
        incoming = own_targets.index(state)
        path[before], state = own_outcomes[incoming], own_sources[incoming]
    state = targets[arc]
    for after in range(step + 1, len(trellis.arcs)):
        own_sources, own_targets, own_outcomes = trellis.arcs[after]
        outgoing = own_sources.index(state)
        path[after], state = own_outcomes[outgoing], own_targets[outgoing]
    world = decode_world(trellis.system, [trellis.outcomes[path[i]][0] for i in range(len(trellis.arcs))])
    program = trellis.system.program
    names = [program.names[term] for term in trellis.system.order[step]]
    message = violation.format(program.source.statements, names)
    return ProgramError(f"{message}, in the world {format_world(world)}")


def decode_world(system: TransitionSystem, outcomes: Iterable[Sequence[int]]) -> dict[str, str]:
    """Convert the outcomes of all steps to term -> value, sorted by term."""
    program = system.program
    world = {}
    for terms, values in zip(system.order, outcomes, strict=True):
        for term, value in zip(terms, values, strict=True):
            if value < len(program.values[term]):
                world[program.names[term]] = program.values[term][value]
    return dict(sorted(world.items()))
