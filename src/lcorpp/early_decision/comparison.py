"""The policy that may watch against other rules of when to decide, on held-out simulated people.

All use the same classifier, trained on simulated tracks. Every other rule has the dialogue's policy of the
domain, and its evidence in the form that is best for it on the people scored: a likelihood calibrated at the
age of the track, or a label with the error rates at that age. So they are chosen in hindsight, the policy is
not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lcorpp.assembly.solving import solve_domain
from lcorpp.domains import Domain
from lcorpp.early_decision.evaluation import (
    EarlyReturns,
    ObservedPeople,
    score_evidence,
    score_policy,
)
from lcorpp.early_decision.extension import DISCOUNT, extend_domain
from lcorpp.early_decision.stream_model import BINS, STAGES, fit_stream_model
from lcorpp.learning import (
    PredictionTimeline,
    cross_predict_over_time,
    learner,
    predict_over_time,
    search_trigger,
    train,
    with_prefix_ensemble,
)
from lcorpp.learning.streaming.timeline import PrefixCalibration, calibrate_prefixes
from lcorpp.learning.streaming.trigger import Trigger, list_ages
from lcorpp.planning import Planner
from lcorpp.simulation.people import Population, SimulatedSignals, simulate_dataset
from lcorpp.values import Array, Dataset, Indices

QUARTER = 0.25

WAITING_COSTS = (0.0015, 0.006, 0.025, None)
"""Of the triggers to choose from: of a second from .24 to 4, where a wrong report costs 160; and none."""

LABEL_SMOOTHING = 0.5
"""Pseudo-count of the error rates of labels."""


@dataclass(frozen=True, eq=False)
class Study:
    """Simulated people of a domain.

    timeline: the out-of-fold predictions for those that the classifier is trained on. people: held out.
    """

    domain: Domain
    timeline: PredictionTimeline
    people: ObservedPeople

    @cached_property
    def calibration(self) -> PrefixCalibration:
        """The calibration for each number of points."""
        return calibrate_prefixes(self.timeline)


def simulate_study(
    domain: Domain, seed: int, *, tracks: int = 1600, people: int = 1000, kind: str = "summaries"
) -> Study:
    """Train a classifier of prefixes on simulated people, and let it predict for others over time.

    The training set is balanced; the others are drawn from the domain's true program with their facts.

    Args:
        kind: the learner, in a prefix ensemble.
    """
    (sense,) = domain.senses
    source = SimulatedSignals.from_domain(domain, sense)
    training, held_out = (np.random.default_rng([seed, part]) for part in range(2))
    data = simulate_dataset(domain, sense, source, tracks, training)
    estimator = with_prefix_ensemble(learner(kind, interval=data.interval))
    timeline = cross_predict_over_time(estimator, data, folds=5, seed=seed)
    drawn = Population(domain).sample(people, held_out)
    walks = source.simulate(drawn, held_out)
    test = Dataset(walks, tuple(p[sense.of] for p in drawn), interval=data.interval, channels=data.channels)
    predicted = predict_over_time(train(estimator, data).estimator, test)
    return Study(domain, timeline, ObservedPeople.of(domain, drawn, predicted))


def score_watching(
    study: Study,
    cost: float,
    *,
    stages: int | Sequence[float] = STAGES,
    bins: int = BINS,
    discount: float | None = DISCOUNT,
) -> EarlyReturns:
    """Fit the stream to the training people, solve the extended domain, and score it on the others."""
    stream = fit_stream_model(study.timeline, stages=stages, bins=bins)
    extended = extend_domain(study.domain, stream, cost=cost, discount=discount)
    planner = Planner(solve_domain(extended, any_prior=True))
    return score_policy(study.domain, extended, planner, stream, study.people)


def score_rules(study: Study, *, discount: float | None = DISCOUNT) -> dict[str, list[EarlyReturns]]:
    """Return rule -> what its variants earn; a cost of watching chooses between them, see `choose_best`.

    Args:
        discount: of the policy of the dialogue; None keeps that of the domain.

    The rules: "never", without watching; "quarter" and "whole" of the track; "one age", of the stages of the
    policy, for all people; "trigger", a threshold of the calibrated probability (`search_trigger`).
    """
    domain, timeline = study.domain, study.timeline
    stages = fit_stream_model(timeline).points
    column_of = {timeline.points[column]: column for column in list_ages(timeline)}
    quarter_age = QUARTER * timeline.seconds[-1]
    quarter = min(column_of, key=lambda points: abs(timeline.seconds[column_of[points]] - quarter_age))
    n = len(study.people.values)
    ages = {points: np.full(n, points) for points in (*stages, quarter)}
    labels_of = {points: np.full(len(timeline.labels), points) for points in ages}
    model = domain if discount is None else _change_discount(domain, discount)
    planner = Planner(solve_domain(model, any_prior=True))
    nothing = np.ones((n, len(domain.values)))
    by_age = {
        points: _score_at(study, model, planner, labels_of[points], own) for points, own in ages.items()
    }
    rules = {
        "never": [score_evidence(model, planner, study.people, nothing, 0.0)],
        "quarter": by_age[quarter],
        "whole": by_age[stages[-1]],
        "one age": [each for variants in by_age.values() for each in variants],
        "trigger": [],
    }
    for trigger in _list_triggers(timeline):
        trained, own = (
            np.array([timeline.points[-1] if each is None else each.points for each in trigger.decide(part)])
            for part in (timeline, study.people.timeline)
        )
        rules["trigger"] += _score_at(study, model, planner, trained, own)
    return rules


def choose_best(variants: Sequence[EarlyReturns], cost: float) -> Array:
    """(n,) the returns of the variant with the highest mean return at a cost of a second."""
    return max((own.subtract_cost(cost) for own in variants), key=lambda returns: float(returns.mean()))


def _change_discount(domain: Domain, discount: float) -> Domain:
    pomdp = replace(domain.pomdp, discount=discount)
    return replace(domain, planning=replace(domain.planning, model=pomdp))


def _list_triggers(timeline: PredictionTimeline) -> list[Trigger]:
    """Return the different thresholds that are best at one of `WAITING_COSTS`, as triggers."""
    search = search_trigger(timeline)
    best = {
        max(range(len(search.scores)), key=lambda number: search.scores[number].value(cost))
        for cost in WAITING_COSTS
    }
    return [
        replace(search.trigger, floors=np.full_like(search.trigger.floors, search.candidates[number][0]))
        for number in sorted(best)
    ]


def _score_at(
    study: Study, model: Domain, planner: Planner, trained: Indices, points: Indices
) -> list[EarlyReturns]:
    """Score the evidence after so many points of each held-out track (n,), and of each training track.

    Returns:
        With likelihoods, and with labels whose error rates are those of the training tracks at these points.
    """
    people, calibration = study.people, study.calibration
    sense = model.senses[0]
    classes = [model.class_of(sense.name, value) for value in model.values]
    order = [people.timeline.classes.index(name) for name in classes]
    own, seconds = _calibrate_at(people.timeline, calibration, points)
    before, _ = _calibrate_at(study.timeline, calibration, trained)
    truth = np.array([study.timeline.classes.index(name) for name in study.timeline.labels])
    k = len(classes)
    counts = np.full((k, k), LABEL_SMOOTHING)
    np.add.at(counts, (truth, before.argmax(axis=1)), 1)
    rates = counts / counts.sum(axis=1, keepdims=True)
    soft = own / calibration.calibrations[0].shares
    hard = rates[:, own.argmax(axis=1)].T
    return [
        score_evidence(model, planner, people, likelihoods[:, order], seconds) for likelihoods in (soft, hard)
    ]


def _calibrate_at(
    timeline: PredictionTimeline, calibration: PrefixCalibration, points: Indices
) -> tuple[Array, Array]:
    """(n, K) the calibrated prediction for each track after so many points (n,), and (n,) its age."""
    column_of: Mapping[int, int] = {timeline.points[column]: column for column in list_ages(timeline)}
    columns = np.array([column_of[number] for number in points.tolist()])
    raw = timeline.probabilities[np.arange(len(columns)), columns]
    calibrated = np.empty_like(raw)
    for number in np.unique(points).tolist():
        rows = points == number
        calibrated[rows] = calibration.at(number).calibrate(raw[rows])
    return calibrated, timeline.seconds[columns]
