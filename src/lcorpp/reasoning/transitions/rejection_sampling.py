"""Rejection sampling of possible worlds, for programs that are too large to be compiled.

A sampler decides the components in their order. It does not draw observed terms: it accepts the world with
the probability q / U, where q is the probability of all observed values in the world, and U is an upper bound
of q (`evidence_bound`). So the worlds accepted are independent draws from the distribution given the
evidence: their number is the effective sample size, and the share of a value among them has a binomial
interval. Weighting worlds by q instead, without U, underestimates the error: if the evidence has a rare cause
that no world has, all weights are small and equal, and seem reliable. The evidence are constraints of the
ground program.

Source: von Neumann, "Various techniques used in connection with random digits", 1951 (rejection); Dagum and
Luby, "An optimal approximation algorithm for Bayesian inference", Artificial Intelligence 93, 1997 (bounds
of the probabilities of evidence).
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from math import inf, log
from random import Random

from lcorpp.errors import ProgramError
from lcorpp.reasoning.grounding.ground_program import GroundProgram
from lcorpp.reasoning.transitions.evidence_bound import bound_evidence, compute_log
from lcorpp.reasoning.transitions.local_distribution import Outcome
from lcorpp.reasoning.transitions.transition import Effect
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

MIN_EFFECTIVE_SAMPLES = 100
"""An estimate needs at least this many worlds that agree with the evidence."""

MAX_EXTENSION = 16
"""If too few worlds agree, up to this many times as many are drawn, if then enough can be expected."""

BATCH = 1000
"""Number of worlds drawn together, so that a step computes the outcomes of all their states at once."""

MAX_STATES = 100_000
"""Maximum number of states before a step whose following states are cached."""

Progress = Callable[[float, str], None]

_Choices = tuple[float, list[float], list[tuple[Effect, Outcome]]]
"""(logarithm of the total probability, cumulative shares of it, effects on the state with their outcomes)"""


@dataclass(frozen=True)
class SampleCounts:
    """Accepted worlds.

    counts: value of the queried term -> the number of accepted worlds with it; the key "" is for no value.
    drawn: the number of worlds drawn.
    possible: False if it is certain that no world has the evidence.
    """

    counts: Mapping[str, int]
    drawn: int
    possible: bool

    @property
    def accepted(self) -> int:
        """The number of worlds accepted."""
        return sum(self.counts.values())


def sample_worlds(
    ground: GroundProgram,
    system: TransitionSystem,
    query: str,
    samples: int,
    seed: int,
    progress: Progress | None = None,
) -> SampleCounts:
    """Draw worlds and count the values of a term among those that are accepted.

    Up to `MAX_EXTENSION` times as many worlds are drawn if too few of the first ones are accepted, but enough
    can be expected. Accepted worlds are independent of how many were rejected before, so drawing until they
    suffice leaves their distribution as it is.

    Args:
        ground: the program, with the evidence.
        system: its transition system, without guesses: built with a maximal frontier of 0.
        samples: the number of worlds to draw.
        progress: a function of the share of the worlds that is drawn, and a text with the numbers of worlds.

    Raises:
        ProgramError: a drawn world breaks a condition of the language.
    """
    sampler = _WorldSampler(ground, system, Random(seed))
    queried = system.term_numbers.get(query)
    limit = MAX_EXTENSION * samples
    numbers: Counter[int] = Counter()
    drawn = 0
    while system.consistent and (
        drawn < samples
        or (drawn < limit and numbers.total() < MIN_EFFECTIVE_SAMPLES <= numbers.total() * limit / drawn)
    ):
        target = samples if drawn < samples else limit
        count = min(BATCH, target - drawn)
        is_extension = drawn >= samples
        for world, value in sampler.draw(count, queried):
            numbers[value] += 1
            if is_extension and numbers.total() == MIN_EFFECTIVE_SAMPLES:
                count = world + 1  # those after it are not needed
                break
        drawn += count
        if progress:
            progress(drawn / target, f"{drawn} worlds, {numbers.total()} accepted")
    values = next((own for name, own in zip(ground.names, ground.values, strict=True) if name == query), ())
    counts = {name: numbers.pop(i, 0) for i, name in enumerate(values)}
    return SampleCounts(counts | {"": numbers.total()}, drawn, system.consistent)


class _WorldSampler:
    """Draws worlds and accepts those that agree with the evidence."""

    def __init__(self, ground: GroundProgram, system: TransitionSystem, random: Random) -> None:
        self._system, self._random = system, random
        # step -> state of the input bits -> choices
        self._choices: list[dict[int, _Choices]] = [{} for _ in system.transitions]
        # step -> (state, effect) -> the state after it
        self._reached: list[dict[tuple[int, int], int | None]] = [{} for _ in system.transitions]
        self._bound, self._following_bounds = self._bound_evidence(ground)  # logarithms

    def draw(self, count: int, queried: int | None) -> list[tuple[int, int]]:
        """Draw worlds, all step by step; return (number, outcome of a term) of those that are accepted.

        Args:
            queried: the term; without one the outcomes are -1.
        """
        tree, random, values = self._system.tree, self._random.random, [-1] * count
        # logarithms of the probability of the evidence so far, and of that at which a world is accepted
        weights = [0.0] * count
        thresholds = [log(1 - random()) + self._bound for _ in range(count)]
        states = {root: [0] * count for root in tree.roots}  # step -> state of each world before it
        accepted: Sequence[int] = range(count)
        for step, (transition, terms) in enumerate(zip(self._system.transitions, tree.order, strict=True)):
            own, known, mask = states.pop(step), self._choices[step], transition.input_mask
            if unknown := {own[world] & mask for world in accepted} - known.keys():
                self._list_choices(step, unknown)
            place = terms.index(queried) if queried is not None and queried in terms else None
            children = list(zip(tree.children[step], transition.live_masks, strict=True))
            if place is None and self._is_idle(step):
                states.update((child, [state & live for state in own]) for child, live in children)
                continue
            branches = [(states.setdefault(child, [0] * count), live) for child, live in children]
            least, reached = self._following_bounds[step], self._reached[step]
            survivors = []
            for world in accepted:
                state = own[world]
                log_total, cumulative, choices = known[state & mask]
                weight = weights[world] = weights[world] + log_total
                if weight + least < thresholds[world]:
                    continue
                effect, outcome = choices[bisect_right(cumulative, random()) if len(choices) > 1 else 0]
                key = state, effect[0]  # faster than by name
                try:
                    following = reached[key]
                except KeyError:
                    if len(reached) >= MAX_STATES:
                        reached.clear()
                    following = reached[key] = transition.advance(state, effect)
                if following is None:
                    continue
                for column, live in branches:
                    column[world] = following & live
                if place is not None:
                    values[world] = outcome.values[place]
                survivors.append(world)
            accepted = survivors
        return [(world, values[world]) for world in accepted]

    def _is_idle(self, step: int) -> bool:
        """Whether neither evidence nor other steps depend on a step, as on a term that no rule reads."""
        transition = self._system.transitions[step]
        if transition.input_mask or transition.absorptions or transition.closures:
            return False
        log_total, _, choices = self._choices[step][0]
        return log_total == 0 and not any(
            effect.sets or effect.forbids or effect.moves for effect, _ in choices
        )

    def _list_choices(self, step: int, states: Collection[int]) -> None:
        """List the choices of positive probability that no constraint excludes, for some input bits."""
        transition = self._system.transitions[step]
        program = self._system.program
        for state, outcomes in transition.distribution.list_outcomes(states).items():
            choices: list[tuple[Effect, Outcome]] = []
            for outcome in outcomes:
                if outcome.violation:
                    names = [program.names[term] for term in self._system.tree.order[step]]
                    message = outcome.violation.format(program.source.statements, names)
                    raise ProgramError(f"{message}, in a world drawn at random")
                effect = transition.find_effect(outcome.values) if outcome.weight else None
                if effect is not None:
                    choices.append((effect, outcome))
            sums = list(accumulate([outcome.weight for _, outcome in choices], initial=Fraction(0)))
            # the last share is exactly 1, above each random number
            shares = [float(part / sums[-1]) for part in sums[1:]]
            self._choices[step][state] = compute_log(sums[-1]), shares, choices

    def _bound_evidence(self, ground: GroundProgram) -> tuple[float, list[float]]:
        """Bound the probability of the evidence in all worlds, and its part from the next step on."""
        order, n_steps = self._system.tree.order, len(self._system.transitions)
        possible: dict[int, int] = {}  # constrained term -> mask of its outcomes
        step_of: dict[int, int] = {}
        for step, terms in enumerate(order):
            step_of.update(dict.fromkeys(terms, step))
            if len(terms) == 1:
                transition, n_values = self._system.transitions[step], len(ground.values[terms[0]])
                outcomes = [i for i in range(n_values + 1) if transition.find_effect((i,)) is not None]
                if len(outcomes) <= n_values:
                    possible[terms[0]] = sum([1 << i for i in outcomes])
        if not possible:
            return 0.0, [0.0] * n_steps
        bounds, total = bound_evidence(ground, possible, step_of)
        own = [bounds.get(terms[0], 0.0) if len(terms) == 1 else 0.0 for terms in order]
        following = list(accumulate(reversed(own), initial=0.0))[-2::-1]
        return (total, following) if total > -inf else (0.0, [0.0] * n_steps)  # -inf: all are rejected
