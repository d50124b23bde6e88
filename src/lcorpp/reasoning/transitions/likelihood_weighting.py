"""Answers by likelihood weighting, with error bars, for programs that have too many states to be compiled.

Worlds are drawn term by term in the order of the plan. A term that is observed is not drawn: the world is
weighted with the probability of what was observed instead. A world that breaks a constraint on its way has
the weight 0.

Source: Fung and Chang, "Weighing and integrating evidence for stochastic simulation in Bayesian networks",
UAI 1989; Shachter and Peot, UAI 1989. The standard error is that of a ratio of two means (Owen, "Monte
Carlo theory, methods and examples", 2013, section 9.2).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from math import sqrt
from random import Random

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning.transitions.selection import Outcome
from lcorpp.reasoning.transitions.transition import Effect
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

SAMPLES = 20_000
"""How many worlds are drawn if nobody says otherwise."""

_Way = tuple[float, Effect, Outcome]


@dataclass(frozen=True)
class SampleEstimates:
    """Estimated probabilities.

    values: value -> (probability, standard error); "" stands for no value.
    samples: how many worlds were drawn.
    effective: how many equally weighted worlds would tell as much (Kish).
    """

    values: Mapping[str, tuple[float, float]]
    samples: int
    effective: float


def estimate(
    prepared: TransitionSystem, query: str, evidence: Mapping[str, str], samples: int = SAMPLES, seed: int = 0
) -> SampleEstimates:
    """Estimate the distribution of a term given evidence.

    Raises:
        ProgramError: a condition of the language is broken in a world that was met.
        UndefinedError: no world with the evidence was met.
    """
    drawn = _Draws(prepared, evidence, Random(seed))
    ground = prepared.ground
    asked = prepared.index.get(query)
    names = ground.values[asked] if asked is not None else ()
    weights: dict[str, list[float]] = {}
    for _ in range(samples):
        found = drawn.world(asked)
        if found:
            weight, value = found
            weights.setdefault(names[value] if 0 <= value < len(names) else "", []).append(weight)
    total = sum(map(sum, weights.values()))
    file = ground.source.file
    if total == 0:
        raise UndefinedError(f"{file}: none of {samples} worlds drawn at random has the evidence")
    squares = {value: sum(w * w for w in found) for value, found in weights.items()}
    every = sum(squares.values())
    values = {}
    for name in (*names, ""):
        p = sum(weights.get(name, ())) / total
        own = squares.get(name, 0.0)
        values[name] = p, sqrt(own * (1 - p) ** 2 + (every - own) * p**2) / total
    return SampleEstimates(values, samples, total * total / every)


class _Draws:
    """Worlds drawn at random that have some evidence."""

    def __init__(self, prepared: TransitionSystem, evidence: Mapping[str, str], random: Random) -> None:
        self._plan, self._random = prepared, random
        self._known: list[dict[int, tuple[list[float], list[_Way]]]] = [{} for _ in prepared.steps]
        given: dict[int, int] = {}
        self._possible = prepared.consistent
        for name, value in evidence.items():
            term = prepared.index.get(name)
            if term is None:
                self._possible = False
            else:
                given[term] = prepared.ground.values[term].index(value)
        self._given = [
            [(i, given[term]) for i, term in enumerate(terms) if term in given] for terms in prepared.order
        ]

    def world(self, asked: int | None) -> tuple[float, int] | None:
        """The weight of a drawn world and the outcome of a term in it; None if it broke a constraint."""
        if not self._possible:
            return None
        state, weight, value = 0, 1.0, -1
        for position, (step, terms) in enumerate(zip(self._plan.steps, self._plan.order, strict=True)):
            bits = state & step.mask
            known = self._known[position].get(bits)
            if known is None:
                known = self._known[position][bits] = self._ways(position, bits)
            cumulative, ways = known
            if not ways or cumulative[-1] == 0:
                return None
            at = bisect_right(cumulative, self._random.random() * cumulative[-1]) if len(ways) > 1 else 0
            _, (sets, must, finished, true_of), outcome = ways[min(at, len(ways) - 1)]
            weight *= cumulative[-1]
            if must and state & must != must:
                return None
            reached = state | sets
            open_bodies = finished & ~state
            while open_bodies:
                lowest = open_bodies & -open_bodies
                reached |= true_of[lowest]
                open_bodies ^= lowest
            state = reached & step.keep
            if asked is not None and asked in terms:
                value = outcome.values[terms.index(asked)]
        return weight, value

    def _ways(self, position: int, bits: int) -> tuple[list[float], list[_Way]]:
        step = self._plan.steps[position]
        ways: list[_Way] = []
        for outcome in step.decision.outcomes((bits,))[bits]:
            if outcome.violation:
                names = [self._plan.ground.names[term] for term in self._plan.order[position]]
                told = outcome.violation.told(self._plan.ground.source.statements, names)
                raise ProgramError(f"{told}, in a world drawn at random")
            if all(outcome.values[i] == value for i, value in self._given[position]):
                effect = step.effect(outcome.values)
                if effect is not None:
                    ways.append((float(outcome.weight), effect, outcome))
        return list(accumulate(way[0] for way in ways)), ways
