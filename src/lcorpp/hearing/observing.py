"""Measure the observation model of a domain: learn the confidence, choose the bins, check the value."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lcorpp.domains import Domain
from lcorpp.hearing.answers import SILENCE, SOUND, TALK, SaidModel, assume_said, check_answers
from lcorpp.hearing.bins import choose_bins, collect_cases, find_policy
from lcorpp.hearing.cases import RECORDED, Cases
from lcorpp.hearing.loop import simulate_loop
from lcorpp.hearing.measurement import Result, describe_recogniser, measure, score_results
from lcorpp.hearing.noises import Noise
from lcorpp.hearing.rates import HeardCases, find_row_intervals, make_model
from lcorpp.planning import Evaluation, Planner, Pomdp, evaluate, solve
from lcorpp.values import Array, Interval
from lcorpp.worlds.speech.confidence import ANSWER, SPEECH, Confidence
from lcorpp.worlds.speech.recogniser import Recogniser

WORK = 4e6
"""Work of SARSOP for the measured model, in the unit of `PacedSearch`: about a second."""

TRIALS = 10_000
"""Number of trials with the recogniser in the loop."""

Advance = Callable[[int, int], None]


def show_nothing(done: int, total: int) -> None:
    """Show no progress."""


@dataclass(frozen=True, eq=False)
class Observed:
    """A measured observation model.

    confidence: with its bins. model: the domain's, with the measured observations.
    said: what people say, by assumption. assumption: its text.
    row_intervals: ends (A, S, O) of 95 % intervals of the measured rows.
    tuning, test: what is heard in the two parts of the split.
    value: of the policy for the model, by the model. simulated: of the same policy, with the recogniser and
        the cases of the test in the loop.
    stated_value: of the policy for the stated model, by the stated model.
    seconds: (n,) CPU time of each case that was recognised.
    """

    domain: Domain
    confidence: Confidence
    model: Pomdp
    said: SaidModel
    assumption: Mapping[str, float]
    row_intervals: tuple[Array, Array]
    tuning: HeardCases
    test: HeardCases
    value: Evaluation
    simulated: Interval
    stated_value: float
    seconds: Array
    voices: tuple[str, ...]
    is_synthetic: bool

    @property
    def shortfall(self) -> float:
        """By which share of its value the simulated policy earns less than the model promises."""
        promised = self.value.interval.estimate
        return (promised - self.simulated.estimate) / abs(promised)


def observe(
    domain: Domain,
    cases: Cases,
    noises: Sequence[Noise],
    assumption: Mapping[str, float],
    folder: Path,
    *,
    seed: int = 0,
    trials: int = TRIALS,
    advance: Advance = show_nothing,
    advance_bins: Advance = show_nothing,
) -> Observed:
    """Measure the observation model of a domain.

    Half of the sentences are for tuning: the confidence is learnt from them, the bins are chosen for them,
    and the rates of the model are theirs, with confidences learnt from other sentences (cross-fitting). The
    other half is the test, for the recall and for the value with the recogniser in the loop.

    Args:
        noises: of the cases, with their shares; `recorded_noise` for recordings.
        assumption: see `assume_said`.
        folder: keeps what was recognised; a measurement that was interrupted continues.
        seed: of the split, the noise and the trials.
        advance, advance_bins: receive the finished and all cases; models.

    Raises:
        DomainError: the domain has an observation that no sentence gives.
        DataError: too few recognitions are right or wrong, a word is not in the dictionary, or the folder has
            another measurement.
        ActionFailedError: pocketsphinx is missing.
    """
    answers = check_answers(domain)
    utterances = {name: domain.planning.utterances[name] for name in answers}
    said = assume_said(domain, assumption, cases.kinds[len(answers) :])
    identity = describe_recogniser(utterances, seed, type(cases).__name__)
    results = measure(cases, Recogniser(utterances), folder, identity, advance)
    learnt, scores = score_results(results, weigh_factors(results, noises, answers))
    scored = collect_cases(results, scores, cases.kinds, answers, noises)
    bins, _ = choose_bins(domain.pomdp, scored, said, advance=advance_bins)
    tuning, test = scored.hear(bins, test=False), scored.hear(bins, test=True)
    model = make_model(domain.pomdp, tuning.observations, tuning.estimate(tuning.count()), said)
    policy = find_policy(model, WORK)
    return Observed(
        domain=domain,
        confidence=replace(learnt, bins=bins),
        model=model,
        said=said,
        assumption=assumption,
        row_intervals=find_row_intervals(tuning, said, np.random.default_rng([seed, 1])),
        tuning=tuning,
        test=test,
        value=evaluate(model, policy),
        simulated=simulate_loop(Planner(policy, model), said, test, trials, np.random.default_rng([seed, 2])),
        stated_value=solve(domain.pomdp).lower,
        seconds=np.array([result.seconds for result in results]),
        voices=tuple(sorted({case.voice for case in cases.cases} - {""})),
        is_synthetic=SILENCE in cases.kinds,
    )


def recorded_noise() -> tuple[Noise, ...]:
    """Return the only noise of recordings: what they contain."""
    return (Noise(RECORDED, np.nan, 1.0),)


def weigh_factors(
    results: Sequence[Result], noises: Sequence[Noise], answers: Sequence[str]
) -> dict[str, Array]:
    """Return factor of the confidence -> weights (n,) of the cases from which it is learnt.

    `ANSWER` is learnt from answers and from all else but sounds, each with half of the weight. `SPEECH` is
    learnt from answers, talk and sounds, each kind with the same weight. What people say is not used, so that
    the confidence is the same for each assumption.
    """
    kinds = {result.case.said for result in results}
    others = kinds - {*answers, SOUND}
    halves = {name: 0.5 / len(side) for side in (answers, others) for name in side}
    weights = {ANSWER: weigh_cases(results, noises, halves)}
    if SOUND in kinds:
        weights[SPEECH] = weigh_cases(results, noises, dict.fromkeys((*answers, TALK, SOUND), 1.0))
    return weights


def weigh_cases(results: Sequence[Result], noises: Sequence[Noise], shares: Mapping[str, float]) -> Array:
    """Return the weights (n,) of the cases: in proportion to the share of their kind, and of their noise.

    Args:
        shares: kind -> its share; other kinds have weight 0. The mean of positive weights is 1.
    """
    share = {noise.name: noise.share for noise in noises}
    keys = [(result.case.said, result.case.noise) for result in results]
    number = Counter(keys)
    weights = np.array([shares.get(kind, 0.0) * share[noise] / number[kind, noise] for kind, noise in keys])
    normalised: Array = weights / weights[weights > 0].mean()
    return normalised
