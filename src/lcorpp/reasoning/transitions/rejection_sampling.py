"""Rejection sampling of possible worlds, for programs that are too large to be compiled.

A sampler decides the components in their order. It does not draw an observed term: it accepts the observed
value with the probability q / U, where q is the value's probability in the world drawn so far and U is an
upper bound of q in all worlds. So the worlds that pass all observations and constraints are independent
draws from the distribution given the evidence: their number is the effective sample size, and the share of a
value among them has a binomial interval. Weighting worlds by q instead, without U, underestimates the error:
if the evidence has a rare cause that no world has, all weights are small and equal, and seem reliable.

Source: von Neumann, "Various techniques used in connection with random digits", 1951 (rejection); Dagum and
Luby, "An optimal approximation algorithm for Bayesian inference", Artificial Intelligence 93, 1997 (bounds
of the probabilities of evidence).
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, product
from math import prod
from random import Random

from lcorpp.errors import ProgramError
from lcorpp.reasoning.grounding.ground_program import Clause, GroundProgram
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.transitions.local_distribution import Outcome, enumerate_outcomes
from lcorpp.reasoning.transitions.transition import Effect
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

DEFAULT_SAMPLES = 20_000
"""The default number of worlds drawn."""

MIN_EFFECTIVE_SAMPLES = 100
"""An estimate needs at least this many worlds that agree with the evidence."""

MAX_EXTENSION = 16
"""If too few worlds agree, up to this many times as many are drawn, if then enough can be expected."""

MAX_TABLE_ROWS = 4096
"""A larger conditional probability table is not searched for its maximum: the bound is 1."""

_Choice = tuple[float, Effect, Outcome]
"""(probability, effect on the state, outcome)"""


@dataclass(frozen=True)
class SampleCounts:
    """Accepted worlds.

    counts: value of the queried term -> the number of accepted worlds with it; the key "" is for no value.
    drawn: the number of worlds drawn.
    accepted: the number of worlds accepted; less than `MIN_EFFECTIVE_SAMPLES` if the evidence is too
        improbable for sampling.
    possible: False if it is certain that no world has the evidence.
    """

    counts: Mapping[str, int]
    drawn: int
    accepted: int
    possible: bool


def sample_worlds(
    ground: GroundProgram,
    system: TransitionSystem,
    query: str,
    evidence: Mapping[str, str],
    samples: int,
    seed: int,
) -> SampleCounts:
    """Draw worlds and count the values of a term among those that agree with the evidence.

    Accepted worlds are independent of how many were rejected before, so drawing until they suffice leaves
    their distribution as it is.

    Args:
        ground: the program.
        system: its transition system.

    Raises:
        ProgramError: a drawn world breaks a condition of the language.
    """
    sampler = _WorldSampler(ground, system, evidence, Random(seed))
    queried = system.term_numbers.get(query)
    values = next((own for name, own in zip(ground.names, ground.values, strict=True) if name == query), ())
    numbers: Counter[int] = Counter()
    drawn = accepted = 0
    while sampler.possible and (drawn < samples or _is_worth_drawing(drawn, accepted, samples)):
        drawn += 1
        value = sampler.draw(queried)
        if value is not None:
            numbers[value] += 1
            accepted += 1
    counts = {name: numbers.pop(i, 0) for i, name in enumerate(values)}
    return SampleCounts(counts | {"": numbers.total()}, drawn, accepted, sampler.possible)


def _is_worth_drawing(drawn: int, accepted: int, samples: int) -> bool:
    """Whether too few worlds are accepted, and enough can be expected within the limit."""
    limit = MAX_EXTENSION * samples
    return accepted < MIN_EFFECTIVE_SAMPLES <= accepted * limit / drawn and drawn < limit


class _WorldSampler:
    """Draws worlds and accepts those that agree with the evidence.

    possible: False if it is certain that there is no such world.
    """

    def __init__(
        self, ground: GroundProgram, system: TransitionSystem, evidence: Mapping[str, str], random: Random
    ) -> None:
        self._system, self._random = system, random
        # step -> state of the input bits -> (cumulative probabilities, choices)
        self._choices: list[dict[int, tuple[list[float], list[_Choice]]]] = [{} for _ in system.transitions]
        observed: dict[int, int] = {}
        self.possible = system.consistent
        for name, value in evidence.items():
            term = system.term_numbers.get(name)
            if term is None:
                self.possible = False
            else:
                observed[term] = system.program.values[term].index(value)
        self._observed = [
            [(i, observed[term]) for i, term in enumerate(terms) if term in observed]
            for terms in system.tree.order
        ]
        self._bounds = self._bound_steps(ground)  # step -> bound of the probability of its possible outcomes

    def draw(self, queried: int | None) -> int | None:
        """Draw a world: the outcome of a term, -1 without a term; None if the world is rejected."""
        tree, random, value = self._system.tree, self._random.random, -1
        states = dict.fromkeys(tree.roots, 0)  # step -> state before it
        for step, (transition, terms) in enumerate(zip(self._system.transitions, tree.order, strict=True)):
            state = states.pop(step)
            bits = state & transition.input_mask
            known = self._choices[step].get(bits)
            if known is None:
                known = self._choices[step][bits] = self._list_choices(step, bits)
            cumulative, choices = known
            bound = self._bounds[step]
            if not choices or (cumulative[-1] < bound and random() * bound >= cumulative[-1]):
                return None
            at = bisect_right(cumulative, random() * cumulative[-1]) if len(choices) > 1 else 0
            _, (sets, forbids, moves, targets_of), outcome = choices[min(at, len(choices) - 1)]
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
        return value

    def _list_choices(self, step: int, bits: int) -> tuple[list[float], list[_Choice]]:
        """List the choices of positive probability that neither evidence nor a constraint excludes."""
        transition = self._system.transitions[step]
        program = self._system.program
        choices: list[_Choice] = []
        for outcome in transition.distribution.list_outcomes((bits,))[bits]:
            if outcome.violation:
                names = [program.names[term] for term in self._system.tree.order[step]]
                message = outcome.violation.format(program.source.statements, names)
                raise ProgramError(f"{message}, in a world drawn at random")
            if outcome.weight and all(outcome.values[i] == value for i, value in self._observed[step]):
                effect = transition.find_effect(outcome.values)
                if effect is not None:
                    choices.append((float(outcome.weight), effect, outcome))
        return list(accumulate(choice[0] for choice in choices)), choices

    def _bound_steps(self, ground: GroundProgram) -> list[float]:
        """Bound the total probability of the choices of each step; 1 for components of several terms."""
        possible: dict[
            int, int
        ] = {}  # term -> mask of its outcomes, if evidence or a constraint excludes some
        for step, terms in enumerate(self._system.tree.order):
            if len(terms) == 1:
                outcomes = range(len(ground.values[terms[0]]) + 1)
                if self._observed[step]:
                    outcomes = range(self._observed[step][0][1], self._observed[step][0][1] + 1)
                find_effect = self._system.transitions[step].find_effect
                mask = sum([1 << value for value in outcomes if find_effect((value,)) is not None])
                if mask.bit_count() <= len(ground.values[terms[0]]):
                    possible[terms[0]] = mask
        if not possible:
            return [1.0] * len(self._system.transitions)
        clauses, masks = simplify(ground)
        clauses_of: dict[int, list[Clause]] = {term: [] for term in possible}
        for clause in clauses:
            if clause.term in possible:
                clauses_of[clause.term].append(clause)
        bounds = {
            term: _find_maximum(ground, term, clauses_of[term], masks, mask)
            for term, mask in possible.items()
        }
        return [bounds.get(terms[0], 1.0) if len(terms) == 1 else 1.0 for terms in self._system.tree.order]


def _find_maximum(
    ground: GroundProgram, term: int, clauses: Sequence[Clause], masks: Sequence[int], possible: int
) -> float:
    """Find an upper bound of the total probability of some outcomes of a term.

    It is the maximum over the rows of the term's conditional probability table, i.e. over the combinations of
    outcomes of the terms that its clauses name.

    Args:
        clauses: the clauses about the term.
        masks: the possible outcomes of each term.
        possible: the mask of the outcomes of the term.
    """
    tests: dict[int, set[int]] = {}  # parent -> the masks in literals about it
    for clause in clauses:
        for parent, allowed, _ in clause.body:
            tests.setdefault(parent, set()).add(allowed)
    # of outcomes that satisfy the same literals one suffices
    domains = []
    for parent, literals in tests.items():
        outcomes = [i for i in range(len(ground.values[parent]) + 1) if masks[parent] >> i & 1]
        domains.append({tuple([mask >> i & 1 for mask in literals]): 1 << i for i in outcomes}.values())
    if term in tests or prod(map(len, domains)) > MAX_TABLE_ROWS:
        return 1.0
    bound = 0.0
    for row in product(*domains):
        outcome_of = dict(zip(tests, row, strict=True))
        true = [c for c in clauses if all(outcome_of[parent] & allowed for parent, allowed, _ in c.body)]
        column = enumerate_outcomes(ground, term, true, {})
        if not any(violation for _, _, violation in column):
            bound = max(bound, float(sum(p for value, p, _ in column if possible >> value & 1)))
    return bound
