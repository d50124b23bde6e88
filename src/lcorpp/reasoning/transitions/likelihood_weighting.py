"""Likelihood weighting: estimates with standard errors, for programs that are too large to be compiled.

A sampler decides the components in their order. It does not draw observed terms but multiplies the
weight of the world by the probability of the observed value. A world that violates a constraint has weight 0.

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
from lcorpp.reasoning.transitions.local_distribution import Outcome
from lcorpp.reasoning.transitions.transition import Effect
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

DEFAULT_SAMPLES = 20_000
"""The default number of worlds."""

_Choice = tuple[float, Effect, Outcome]
"""(probability, effect on the state, outcome)"""


@dataclass(frozen=True)
class SampleEstimates:
    """Estimated probabilities.

    values: value -> (probability, standard error); the key "" is for no value.
    samples: the number of worlds drawn.
    effective: the effective sample size (Kish).
    """

    values: Mapping[str, tuple[float, float]]
    samples: int
    effective: float


def estimate(
    system: TransitionSystem,
    query: str,
    evidence: Mapping[str, str],
    samples: int = DEFAULT_SAMPLES,
    seed: int = 0,
) -> SampleEstimates:
    """Estimate the distribution of a term given evidence.

    Raises:
        ProgramError: a drawn world breaks a condition of the language.
        UndefinedError: no drawn world agrees with the evidence.
    """
    sampler = _WorldSampler(system, evidence, Random(seed))
    program = system.program
    queried = system.term_numbers.get(query)
    names = program.values[queried] if queried is not None else ()
    weights: dict[str, list[float]] = {}
    for _ in range(samples):
        world = sampler.draw(queried)
        if world:
            weight, value = world
            weights.setdefault(names[value] if 0 <= value < len(names) else "", []).append(weight)
    total = sum(map(sum, weights.values()))
    file = program.source.file
    if total == 0:
        raise UndefinedError(f"{file}: none of {samples} worlds drawn at random has the evidence")
    squares = {value: sum(w * w for w in own) for value, own in weights.items()}
    all_squares = sum(squares.values())
    values = {}
    for name in (*names, ""):
        p = sum(weights.get(name, ())) / total
        own_squares = squares.get(name, 0.0)
        values[name] = p, sqrt(own_squares * (1 - p) ** 2 + (all_squares - own_squares) * p**2) / total
    return SampleEstimates(values, samples, total * total / all_squares)


class _WorldSampler:
    """Draws weighted worlds that agree with the evidence."""

    def __init__(self, system: TransitionSystem, evidence: Mapping[str, str], random: Random) -> None:
        self._system, self._random = system, random
        # step -> state of the input bits -> (cumulative probabilities, choices)
        self._choices: list[dict[int, tuple[list[float], list[_Choice]]]] = [{} for _ in system.transitions]
        observed: dict[int, int] = {}
        self._possible = system.consistent
        for name, value in evidence.items():
            term = system.term_numbers.get(name)
            if term is None:
                self._possible = False
            else:
                observed[term] = system.program.values[term].index(value)
        self._observed = [
            [(i, observed[term]) for i, term in enumerate(terms) if term in observed]
            for terms in system.tree.order
        ]

    def draw(self, queried: int | None) -> tuple[float, int] | None:
        """Draw a world: its weight and the outcome of a term; None if the world violates a constraint."""
        if not self._possible:
            return None
        tree, weight, value = self._system.tree, 1.0, -1
        states = dict.fromkeys(tree.roots, 0)  # step -> state before it
        for step, (transition, terms) in enumerate(zip(self._system.transitions, tree.order, strict=True)):
            state = states.pop(step)
            bits = state & transition.input_mask
            known = self._choices[step].get(bits)
            if known is None:
                known = self._choices[step][bits] = self._list_choices(step, bits)
            cumulative, choices = known
            if not choices or cumulative[-1] == 0:
                return None
            at = bisect_right(cumulative, self._random.random() * cumulative[-1]) if len(choices) > 1 else 0
            _, (sets, forbids, moves, targets_of), outcome = choices[min(at, len(choices) - 1)]
            weight *= cumulative[-1]
            if state & forbids:
                return None
            following = state | sets
            moved = moves & state
            while moved:
                lowest = moved & -moved
                following |= targets_of[lowest]
                moved ^= lowest
            for closure in transition.closures:
                following = closure.apply(following)
            for child, mask in zip(tree.children[step], transition.live_masks, strict=True):
                states[child] = following & mask
            if queried is not None and queried in terms:
                value = outcome.values[terms.index(queried)]
        return weight, value

    def _list_choices(self, step: int, bits: int) -> tuple[list[float], list[_Choice]]:
        transition = self._system.transitions[step]
        program = self._system.program
        choices: list[_Choice] = []
        for outcome in transition.distribution.list_outcomes((bits,))[bits]:
            if outcome.violation:
                names = [program.names[term] for term in self._system.tree.order[step]]
                message = outcome.violation.format(program.source.statements, names)
                raise ProgramError(f"{message}, in a world drawn at random")
            if all(outcome.values[i] == value for i, value in self._observed[step]):
                effect = transition.find_effect(outcome.values)
                if effect is not None:
                    choices.append((float(outcome.weight), effect, outcome))
        return list(accumulate(choice[0] for choice in choices)), choices
