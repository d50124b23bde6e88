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
from lcorpp.reasoning.circuit.choice import Breach
from lcorpp.reasoning.circuit.collection import without_collection
from lcorpp.reasoning.circuit.plan import Plan, Step
from lcorpp.reasoning.circuit.steps import Outcome

MOST_EDGES = 2_000_000
"""How many edges a trellis may have."""

MOST_BITS = 2**32
"""How many bits the states of one layer may take together, half a gigabyte."""


@dataclass(slots=True, eq=False)
class Trellis:
    """Layers of states, one layer before each step and one after the last.

    layers: how many states each layer has; states are numbered within their layer.
    edges: for each step, three lists of equal length: source, target, move.
    moves: for each move the outcomes of the terms of its step, and its probability.
    """

    plan: Plan
    layers: list[int]
    edges: list[tuple[list[int], list[int], list[int]]]
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


def trellis(prepared: Plan, limit: int = MOST_EDGES) -> Trellis:
    """Go through all states of a program.

    Raises:
        TooLargeError: there are more than `limit` edges.
        ProgramError: a condition of the language is broken in a world, or a circle has too many models.
    """
    with without_collection():
        built, breaches = _forward(prepared, limit)
        _prune(built)
    if breaches:  # those that no world meets were pruned
        for step, (_, _, moves) in enumerate(built.edges):
            for number, move in enumerate(moves):
                if move in breaches:
                    raise _broken(built, step, number, breaches[move])
    return built


def _forward(prepared: Plan, limit: int) -> tuple[Trellis, dict[int, Breach]]:
    moves: list[tuple[Sequence[int], Fraction]] = []
    breaches: dict[int, Breach] = {}
    layers: list[int] = [1 if prepared.consistent else 0]
    edges: list[tuple[list[int], list[int], list[int]]] = []
    current: dict[int, int] = {0: 0} if prepared.consistent else {}
    total = 0
    for step in prepared.steps:
        mask, keep, absorb = step.mask, step.keep, step.absorb
        if mask:
            outcomes = step.decision.outcomes({state & mask for state in current})
        else:
            outcomes = step.decision.outcomes((0,) if current else ())
        ways = {bits: _ways(step, found, moves, breaches) for bits, found in outcomes.items()}
        most = min(limit - total, MOST_BITS // max(keep.bit_length(), 1))
        following: dict[int, int] = {}
        sources: list[int] = []
        targets: list[int] = []
        taken: list[int] = []
        for state, number in current.items():
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
                raise TooLargeError(
                    f"{prepared.ground.program.file}: more than {total + most} edges in the circuit"
                )
        edges.append((sources, targets, taken))
        layers.append(len(following))
        current = following
        total += len(sources)
    return Trellis(prepared, layers, edges, moves), breaches


def _ways(
    step: Step,
    outcomes: Iterable[Outcome],
    moves: list[tuple[Sequence[int], Fraction]],
    breaches: dict[int, Breach],
) -> list[tuple[int, int, int, Mapping[int, int], int]]:
    """What a step may do under some bits: its effect on a state (see `Effect`) and the number of the move."""
    ways = []
    for outcome in outcomes:
        effect = step.effect(outcome.values)
        if effect is not None:
            if outcome.breach:
                breaches[len(moves)] = outcome.breach
            ways.append((*effect, len(moves)))
            moves.append((outcome.values, outcome.weight))
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


def _broken(built: Trellis, step: int, edge: int, breach: Breach) -> ProgramError:
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
    world = world_of(built.plan, [built.moves[chosen[i]][0] for i in range(len(built.edges))])
    shown = ", ".join(f"{term}={value}" for term, value in world.items())
    told = breach.told(built.plan.ground.program.statements)
    return ProgramError(f"{told}, in the world {{{shown}}}")


def world_of(prepared: Plan, outcomes: Iterable[Sequence[int]]) -> dict[str, str]:
    """The terms and values of a world, given the outcomes of all steps, sorted by term."""
    ground = prepared.ground
    found = {}
    for step, values in zip(prepared.steps, outcomes, strict=True):
        for term, value in zip(step.terms, values, strict=True):
            if value < len(ground.values[term]):
                found[ground.names[term]] = ground.values[term][value]
    return dict(sorted(found.items()))
