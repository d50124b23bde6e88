"""Algorithm 1, LCORPP: decide, add the reported labels to the data, retrain, until convergence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from lcorpp.decision.dt_control import Robot, dt_control
from lcorpp.errors import DecisionError
from lcorpp.protocols import Classifier, DomainInterface, Planner, Reasoner, World
from lcorpp.values import Array, ConfusionMatrix, Dataset, Episode, Instance, track_hash


@dataclass(frozen=True, eq=False, repr=False)
class Batch:
    """State of Algorithm 1 after one (re)training.

    number: 0 for the initial training, then one more for every K decisions.
    dataset: Omega with the reported labels so far. classifier: rho. confusion: C.
    change: SSUB, the sum of absolute differences between this confusion matrix and the previous one.
    instances, episodes: the decisions of this batch, without those of an earlier (resumed) run.
    converged: whether `change` is at most epsilon, which ends the loop.
    """

    number: int
    dataset: Dataset
    classifier: Classifier
    confusion: ConfusionMatrix
    change: float
    instances: tuple[Instance, ...]
    episodes: tuple[Episode, ...]
    converged: bool

    def __repr__(self) -> str:
        state = "converged" if self.converged else "not converged"
        return (
            f"Batch({self.number}: {len(self.dataset)} cases, {len(self.episodes)} decisions,"
            f" change {self.change:.4g}, {state}, {self.confusion})"
        )


@dataclass(frozen=True, eq=False)
class ResumePoint:
    """State in which an earlier run of Algorithm 1 ended or was interrupted.

    number, classifier, confusion, change: of the last complete batch, as in `Batch`.
    decided: number of decisions after that batch; the data set contains their tracks.
    """

    number: int
    classifier: Classifier
    confusion: ConfusionMatrix
    change: float
    decided: int


def lcorpp(
    dataset: Dataset,
    *,
    sense: str,
    train: Callable[[Dataset], tuple[Classifier, ConfusionMatrix]],
    make_reasoner: Callable[[ConfusionMatrix], Reasoner],
    planner: Planner,
    domain: DomainInterface,
    collect: Callable[[], tuple[Instance, World]],
    batch_size: int,
    epsilon: float,
    other_classifiers: Mapping[str, Classifier] = {},
    listener: Callable[[Instance, Episode], None] = lambda _instance, _episode: None,
    resume_point: ResumePoint | None = None,
) -> Iterator[Batch]:
    """Run the outer loop; every training yields a batch, so the caller may stop at any of them.

    To survive a crash, store each decision in `listener` and each batch when it is yielded, and pass both to
    the next run, as `experiments.run_store` does.

    Args:
        dataset: Omega, the initial training data.
        sense: the sense that learns.
        train: trains and cross-validates a classifier; returns it and its confusion matrix: lines 1 and 2,
            and again 14 and 15.
        make_reasoner: returns a reasoner whose rules contain a confusion matrix: lines 3 and 16.
        planner: pi with its model M: line 4.
        domain: translates between the parts.
        collect: returns a new instance and the world in which to act on it: line 8.
        batch_size: K, the number of decisions between two trainings.
        epsilon: the loop ends when the confusion matrix changes by at most this much.
        other_classifiers: of the senses that do not learn.
        listener: called after every decision.
        resume_point: state in which an earlier run ended; `dataset` is Omega as of then. The first batch
            yielded is the last complete one of that run, without a training; its decisions are not repeated.

    Raises:
        DecisionError: K < 1 or epsilon < 0; and whatever the parts raise.

    Source: Algorithm 1. As printed, line 17 sets C to C_hat in the same step that computes C_hat, and
    the test of line 7 would read 0 after the first batch. The intended comparison, implemented here, is of
    the new matrix with the previous one. C_hat starts uniform (line 5), as printed.
    """
    if batch_size < 1:
        raise DecisionError(f"the batch size K must be at least 1, not {batch_size}")
    if not epsilon >= 0:
        raise DecisionError(f"the threshold epsilon must be at least 0, not {epsilon}")
    if resume_point is None:
        classifier, confusion = train(dataset)
        n = len(confusion.classes)
        number, decided = 0, 0
        change = compute_ssub(np.full((n, n), 1 / n), confusion.probabilities)
    else:
        classifier, confusion = resume_point.classifier, resume_point.confusion
        number, change, decided = resume_point.number, resume_point.change, resume_point.decided
    yield Batch(number, dataset, classifier, confusion, change, (), (), change <= epsilon)
    while change > epsilon:
        number += 1
        classifiers = {**other_classifiers, sense: classifier}
        robot = Robot(classifiers, make_reasoner(confusion), planner, domain)
        instances, episodes = list[Instance](), list[Episode]()
        while decided + len(episodes) < batch_size:
            instance, world = collect()
            episode = dt_control(robot, instance, world)
            instances.append(instance)
            episodes.append(episode)
            listener(instance, episode)
        decided = 0
        dataset = augment(dataset, domain, sense, instances, episodes)
        previous = confusion
        classifier, confusion = train(dataset)
        change = compute_ssub(previous.probabilities, confusion.probabilities)
        converged = change <= epsilon
        yield Batch(
            number, dataset, classifier, confusion, change, tuple(instances), tuple(episodes), converged
        )


def compute_ssub(first: Array, second: Array) -> float:
    """Return the sum of absolute differences of two matrices of equal shape: SSUB of Algorithm 1."""
    return float(np.abs(first - second).sum())


def augment(
    dataset: Dataset,
    domain: DomainInterface,
    sense: str,
    instances: list[Instance],
    episodes: list[Episode],
) -> Dataset:
    """Return Omega with the (signal of a sense, reported class) pairs appended.

    Each new case is its own group, but equal trajectories share a group: a repeated track must not be in
    both the training and the test part of a fold. A decision without a report or signal adds nothing.
    """
    pairs = [
        (instance.signals[sense], domain.class_of(sense, episode.report))
        for instance, episode in zip(instances, episodes, strict=True)
        if episode.report is not None and sense in instance.signals
    ]
    return dataset.append(pairs, [track_hash(signal) for signal, _ in pairs])
