"""All worlds of a program as paths through layers of states.

Each step decides a term. An edge carries the probability of the outcome, so that the measure of a world is
the product along its path and sums over worlds are sums over paths. The trellis is the raw form of the
arithmetic circuit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning.gc_pause import gc_paused
from lcorpp.reasoning.transitions.selection import ConditionViolation
from lcorpp.reasoning.transitions.transition import Transition
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

MAX_ARCS = 2_000_000
"""How many edges a trellis may have."""

MOST_BITS = 2**32
"""How many bits the states of one layer may take together, half a gigabyte."""


Edges = tuple[list[int], list[int], list[int]]
"""The edges of a step, three lists of equal length: source, target, move."""

_Way = tuple[int, int, int, Mapping[int, int], int]


@dataclass(slots=True, eq=False)
class Trellis:
    """Layers of states, one layer before each step and one after the last.

    layers: how many states each layer has; states are numbered within their layer.
    edges: those of each step; steps that are the same share theirs.
    moves: for each move the outcomes of the terms of its step, and its probability.
    """

    plan: TransitionSystem
    layers: list[int]
    edges: list[Edges]
    moves: list[tuple[Sequence[int], Fraction]]

    def floats(self) -> list[float]:
        """The probability of each move in floating point."""
        known: dict[int, float] = {}  # by identity, as moves share their numbers
        found = []
        for _, weight in self.moves:
            number = known.get(id(weight))
            if number is None:
                number = known[id(weight)] = float(weight)
            found.append(number)
        return found


def build_trellis(prepared: TransitionSystem, limit: int = MAX_ARCS) -> Trellis:
    """Go through all states of a program.

    Raises:
        TooLargeError: there are more than `limit` edges.
        ProgramError: a condition of the language is broken in a world, or a circle has too many models.
    """
    with gc_paused():
        built, violations = _forward(prepared, limit)
        _prune(built)
    if violations:  # those that no world meets were pruned
        for step, (_, _, moves) in enumerate(built.edges):
            for number, move in enumerate(moves):
                if move in violations:
                    raise _broken(built, step, number, violations[move])
    return built


def _forward(prepared: TransitionSystem, limit: int) -> tuple[Trellis, dict[int, ConditionViolation]]:
    layers: list[int] = [1 if prepared.consistent else 0]
    edges: list[Edges] = []
    states: tuple[int, ...] = (0,) if prepared.consistent else ()
    walk = _Walk()
    known: dict[tuple[Transition, tuple[int, ...]], tuple[Edges, tuple[int, ...]]] = {}
    total = 0
    for step in prepared.steps:
        most = min(limit - total, MOST_BITS // max(step.keep.bit_length(), 1))
        found = known.get((step, states)) if step.again else None
        if found is None:
            found = walk.on(step, states, most)
            if step.again:
                known[step, states] = found
        if len(found[0][0]) > most:
            raise TooLargeError(
                f"{prepared.ground.source.file}: more than {total + most} edges in the circuit"
            )
        edges.append(found[0])
        states = found[1]
        layers.append(len(states))
        total += len(found[0][0])
    return Trellis(prepared, layers, edges, walk.moves), walk.violations


class _Walk:
    """From the states before a step to those after it."""

    def __init__(self) -> None:
        self.moves: list[tuple[Sequence[int], Fraction]] = []
        self.violations: dict[int, ConditionViolation] = {}
        self._known: dict[Transition, dict[int, list[_Way]]] = {}

    def on(self, step: Transition, states: Sequence[int], most: int) -> tuple[Edges, tuple[int, ...]]:
        """The edges of a step and the states that they lead to; it stops soon after the limit on edges."""
        mask, keep, absorb = step.mask, step.keep, step.absorb
        ways = self._ways(step, {state & mask for state in states})
        following: dict[int, int] = {}
        sources: list[int] = []
        targets: list[int] = []
        taken: list[int] = []
        for number, state in enumerate(states):
            for sets, must, finished, true_of, move in ways[state & mask]:
                if must and state & must != must:
                    continue
                reached = state | sets
                if finished:
                    open_bodies = finished & ~state
                    while open_bodies:
                        lowest = open_bodies & -open_bodies
                        reached |= true_of[lowest]
                        open_bodies ^= lowest
                for true, pending in absorb:
                    if reached & true:
                        reached |= pending
                reached &= keep
                target = following.get(reached)
                if target is None:
                    target = following[reached] = len(following)
                sources.append(number)
                targets.append(target)
                taken.append(move)
            if len(taken) > most:
                break
        return (sources, targets, taken), tuple(following)

    def _ways(self, step: Transition, bits: set[int]) -> Mapping[int, list[_Way]]:
        """What a step may do under some bits: its `Effect` on a state and the number of the move."""
        ways = self._known.get(step, {})
        if not ways.keys() >= bits:
            for own, outcomes in step.decision.outcomes(bits.difference(ways)).items():
                found: list[_Way] = []
                for outcome in outcomes:
                    effect = step.effect(outcome.values)
                    if effect is not None:
                        if outcome.violation:
                            self.violations[len(self.moves)] = outcome.violation
                        found.append((*effect, len(self.moves)))
                        self.moves.append((outcome.values, outcome.weight))
                ways[own] = found
            if step.again:
                self._known[step] = ways
        return ways


def _prune(built: Trellis) -> None:
    """Drop the states from which no path leads to the end, and number the others anew."""
    numbers: list[int] | None = None  # state -> its new number, -1 if dropped; None while nothing was
    for position in range(len(built.edges) - 1, -1, -1):
        sources, targets, moves = built.edges[position]
        if numbers is not None:
            kept = [i for i, target in enumerate(targets) if numbers[target] >= 0]
            sources, moves = [sources[i] for i in kept], [moves[i] for i in kept]
            targets = [numbers[targets[i]] for i in kept]
        alive = set(sources)
        if len(alive) == built.layers[position]:
            numbers = None
        else:
            numbers = [-1] * built.layers[position]
            for number, source in enumerate(sorted(alive)):
                numbers[source] = number
            sources = [numbers[source] for source in sources]
            built.layers[position] = len(alive)
        built.edges[position] = sources, targets, moves


def _broken(built: Trellis, step: int, edge: int, violation: ConditionViolation) -> ProgramError:
    """The error that names a world in which a condition is broken."""
    sources, targets, moves = built.edges[step]
    chosen = {step: moves[edge]}
    state = sources[edge]
    for position in range(step - 1, -1, -1):
        sources_, targets_, moves_ = built.edges[position]
        found = targets_.index(state)
        chosen[position], state = moves_[found], sources_[found]
    state = targets[edge]
    for position in range(step + 1, len(built.edges)):
        sources_, targets_, moves_ = built.edges[position]
        found = sources_.index(state)
        chosen[position], state = moves_[found], targets_[found]
    world = decode_world(built.plan, [built.moves[chosen[i]][0] for i in range(len(built.edges))])
    shown = ", ".join(f"{term}={value}" for term, value in world.items())
    names = [built.plan.ground.names[term] for term in built.plan.order[step]]
    told = violation.told(built.plan.ground.source.statements, names)
    return ProgramError(f"{told}, in the world {{{shown}}}")


def decode_world(prepared: TransitionSystem, outcomes: Iterable[Sequence[int]]) -> dict[str, str]:
    """The terms and values of a world, given the outcomes of all steps, sorted by term."""
    ground = prepared.ground
    found = {}
    for terms, values in zip(prepared.order, outcomes, strict=True):
        for term, value in zip(terms, values, strict=True):
            if value < len(ground.values[term]):
                found[ground.names[term]] = ground.values[term][value]
    return dict(sorted(found.items()))
