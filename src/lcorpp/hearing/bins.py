"""Bins of the confidence as observations, chosen by the value of the policy for the model that they give."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from lcorpp.hearing.answers import SaidModel
from lcorpp.hearing.measurement import Result
from lcorpp.hearing.noises import Noise
from lcorpp.hearing.rates import HeardCases, make_model
from lcorpp.planning import Policy, Pomdp
from lcorpp.planning.sarsop.paced_search import PacedSearch
from lcorpp.values import Array, Flags, Indices
from lcorpp.worlds.speech.confidence import NONE, Bins

EDGES = (0.99, 0.98, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.02)
"""Lowest confidences among which those of the bins are chosen."""

MIN_GAIN = 0.05
"""Value, in reward units, that counts: a second bin of an answer must add it, and a single bin is as strict
as it can be without losing it, since fewer answers are then heard that nobody gave, in noise of any kind."""

WORK = 4e4
"""Work of SARSOP for each model that is compared, in the unit of `PacedSearch`: about 10 milliseconds. The
lower bound is then within hundredths of its limit, long before the gap is closed."""

PRECISION = 1e-3
"""At which a search ends early, in reward units."""

MAX_ROUNDS = 4
"""Maximum number of times that the bins of each answer are chosen anew, given those of the others."""

UNSURE = "_unsure"
"""End of the name of an answer's second bin; the surest one keeps the answer's name."""


@dataclass(frozen=True, eq=False)
class ScoredCases:
    """What was recognised in n cases, at most M utterances each, with confidences.

    answer: (n, M) index of the answer, -1 without. confidence: (n, M).
    said, noise, sentence: (n,) as in `HeardCases`. is_test: (n,) the part of the split.
    kinds, answers, noises: names; the answers come first among the kinds. shares: (W,) of the noises.
    """

    answer: Indices
    confidence: Array
    said: Indices
    noise: Indices
    sentence: Indices
    is_test: Flags
    kinds: tuple[str, ...]
    answers: tuple[str, ...]
    noises: tuple[str, ...]
    shares: Array

    def hear(self, bins: Bins, *, test: bool) -> HeardCases:
        """Return what is heard with these bins, in the cases of the tuning or the test.

        As `lcorpp.worlds.speech.listener.choose_heard`: the first utterance whose bin is not `NONE`.
        """
        chosen = self.is_test == test
        observations = list_observations(self.answers, bins)
        heard = np.full(self.answer.shape, len(observations) - 1)
        for place, answer in enumerate(self.answers):
            for name, edge in reversed(bins.get(answer, ())):
                at = (self.answer == place) & (self.confidence >= edge)
                heard[at] = observations.index(name)
        first = np.argmax(heard < len(observations) - 1, axis=1)
        return HeardCases(
            self.said[chosen],
            self.noise[chosen],
            self.sentence[chosen],
            heard[np.arange(len(heard)), first][chosen],
            self.kinds,
            self.noises,
            self.shares,
            observations,
        )


def collect_cases(
    results: Sequence[Result],
    scores: Sequence[Array],
    kinds: Sequence[str],
    answers: Sequence[str],
    noises: Sequence[Noise],
) -> ScoredCases:
    """Return the results of a measurement as arrays."""
    names = [noise.name for noise in noises]
    width = max(1, max(len(result.recognitions) for result in results))
    answer = np.full((len(results), width), -1)
    confidence = np.zeros((len(results), width))
    for row, (result, own) in enumerate(zip(results, scores, strict=True)):
        for column, found in enumerate(result.recognitions):
            if found.answer is not None:
                answer[row, column] = answers.index(found.answer)
                confidence[row, column] = own[column]
    cases = [result.case for result in results]
    return ScoredCases(
        answer,
        confidence,
        np.array([kinds.index(case.said) for case in cases]),
        np.array([names.index(case.noise) for case in cases]),
        np.unique([case.sentence for case in cases], return_inverse=True)[1],
        np.array([case.is_test for case in cases]),
        tuple(kinds),
        tuple(answers),
        tuple(names),
        np.array([noise.share for noise in noises]),
    )


def list_observations(answers: Sequence[str], bins: Bins) -> tuple[str, ...]:
    """Return the observations of a measured model: the bins of each answer, then `NONE`."""
    return (*[name for answer in answers for name, _ in bins.get(answer, ())], NONE)


def choose_bins(
    stated: Pomdp,
    cases: ScoredCases,
    said: SaidModel,
    *,
    levels: Sequence[float] = EDGES,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[dict[str, tuple[tuple[str, float], ...]], float]:
    """Choose the bins of each answer by the value of the policy that SARSOP finds for the model they give.

    The bins of one answer after another are the best of all pairs of `levels`, given those of the others,
    until none changes.

    Args:
        levels: lowest confidences, from high to low. advance: receives the solved and all models.

    Returns:
        The bins, and the value at the model's initial belief.
    """
    pairs = list(combinations_with_replacement(levels, 2))
    edges: dict[str, tuple[float, float]] = dict.fromkeys(cases.answers, (0.5, 0.5))
    best, done, total = -np.inf, 0, MAX_ROUNDS * len(pairs) * len(cases.answers)
    for _ in range(MAX_ROUNDS):
        before = dict(edges)
        for answer in cases.answers:
            gains = {}
            for pair in pairs:
                gains[pair] = _find_value(stated, cases, said, name_bins({**edges, answer: pair}))
                done += 1
                advance(done, total)
            edges[answer] = _choose_pair(gains)
            best = gains[edges[answer]]
        if edges == before:
            break
    return name_bins(edges), best


def _choose_pair(gains: Mapping[tuple[float, float], float]) -> tuple[float, float]:
    """Return the best pair of edges; of single bins that are equally good up to `MIN_GAIN`, the strictest."""
    best = max(gains, key=gains.__getitem__)
    single = {pair: gain for pair, gain in gains.items() if pair[0] == pair[1]}
    most = max(single.values())
    if gains[best] > most + MIN_GAIN:
        return best
    return max(pair for pair, gain in single.items() if gain >= most - MIN_GAIN)


def name_bins(edges: Mapping[str, tuple[float, float]]) -> dict[str, tuple[tuple[str, float], ...]]:
    """Return the bins of lowest confidences: (sure, unsure) of each answer; equal ones are a single bin."""
    return {
        answer: ((answer, sure),) if sure == unsure else ((answer, sure), (answer + UNSURE, unsure))
        for answer, (sure, unsure) in edges.items()
    }


def _find_value(stated: Pomdp, cases: ScoredCases, said: SaidModel, bins: Bins) -> float:
    heard = cases.hear(bins, test=False)
    model = make_model(stated, heard.observations, heard.estimate(heard.count()), said)
    return find_policy(model, WORK).value(model.start)


def find_policy(model: Pomdp, work: float) -> Policy:
    """Return SARSOP's policy for a model's initial belief after a bounded work, which needs no clock."""
    search = PacedSearch(model, model.start[None], PRECISION)
    search.advance(work=work)
    return search.make_policy()
