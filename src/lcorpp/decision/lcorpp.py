"""Algorithm 1, LCORPP: decide, store what was reported, retrain, until the classifier settles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from lcorpp.decision.dt_control import Robot, dt_control
from lcorpp.errors import DecisionError
from lcorpp.protocols import Classifier, Planner, Reasoner, Vocabulary, World
from lcorpp.values import ConfusionMatrix, Dataset, Episode, Instance, fingerprint


@dataclass(frozen=True, eq=False)
class Batch:
    """What stands after one (re)training of Algorithm 1.

    number: 0 for the initial training, then one more for every K decisions.
    dataset: Omega, grown by the reported labels. classifier: rho. confusion: C.
    change: SSUB, the sum of absolute differences between this confusion matrix and the one before.
    episodes: the decisions of this batch, with the instances in `instances`; those of this run alone.
    settled: whether `change` is at most epsilon, so that the loop ends here.
    """

    number: int
    dataset: Dataset
    classifier: Classifier
    confusion: ConfusionMatrix
    change: float
    instances: tuple[Instance, ...]
    episodes: tuple[Episode, ...]
    settled: bool


@dataclass(frozen=True, eq=False)
class Resumed:
    """Where an earlier run of Algorithm 1 came to its end, however it did.

    number, classifier, confusion, change: of the last batch it completed, as in `Batch`.
    decided: the decisions it had made since; their tracks are in the data set.
    """

    number: int
    classifier: Classifier
    confusion: ConfusionMatrix
    change: float
    decided: int


def lcorpp(
    dataset: Dataset,
    *,
    learn: Callable[[Dataset], tuple[Classifier, ConfusionMatrix]],
    reason: Callable[[ConfusionMatrix], Reasoner],
    planner: Planner,
    domain: Vocabulary,
    collect: Callable[[], tuple[Instance, World]],
    batch_size: int,
    epsilon: float,
    listener: Callable[[Instance, Episode], None] = lambda _instance, _episode: None,
    resumed: Resumed | None = None,
) -> Iterator[Batch]:
    """Run the outer loop; every training yields a batch, so the caller may stop at any of them.

    A run that is to survive a crash keeps each decision in its listener and each batch when it is yielded,
    and the next run is given both: `experiments.memory` does.

    Args:
        dataset: Omega, the training data to begin with.
        learn: trains and cross-validates: lines 1 and 2, and again 14 and 15.
        reason: the reasoner whose rules hold a confusion matrix: lines 3 and 16.
        planner: pi with its model M: line 4.
        domain: the words between the parts.
        collect: a new instance and the world in which to act on it: line 8.
        batch_size: K, decisions between two trainings.
        epsilon: the loop ends when the confusion matrix changes by at most this much.
        listener: called after every decision.
        resumed: where an earlier run ended, `dataset` being Omega as it was then. The first batch yielded
            is the one completed there, without a training; its decisions are not repeated.

    Raises:
        DecisionError: K < 1 or epsilon < 0; and whatever the parts raise.

    Source: Algorithm 1. As printed, line 17 sets C to C_hat in the same step that computes C_hat, and
    the test of line 7 would read 0 after the first batch; meant, and done here, is to compare the new
    matrix with the one before it. C_hat starts uniform (line 5), as printed.
    """
    if batch_size < 1:
        raise DecisionError(f"the batch size K must be at least 1, not {batch_size}")
    if not epsilon >= 0:
        raise DecisionError(f"the threshold epsilon must be at least 0, not {epsilon}")
    if resumed is None:
        classifier, confusion = learn(dataset)
        n = len(confusion.classes)
        number, decided = 0, 0
        change = ssub(np.full((n, n), 1 / n), confusion.probabilities)
    else:
        classifier, confusion, change = resumed.classifier, resumed.confusion, resumed.change
        number, decided = resumed.number, resumed.decided
    yield Batch(number, dataset, classifier, confusion, change, (), (), change <= epsilon)
    while change > epsilon:
        number += 1
        robot = Robot(classifier, reason(confusion), planner, domain)
        instances, episodes = list[Instance](), list[Episode]()
        while decided + len(episodes) < batch_size:
            instance, world = collect()
            episode = dt_control(robot, instance, world)
            instances.append(instance)
            episodes.append(episode)
            listener(instance, episode)
        decided = 0
        dataset = augmented(dataset, instances, episodes)
        previous = confusion
        classifier, confusion = learn(dataset)
        change = ssub(previous.probabilities, confusion.probabilities)
        settled = change <= epsilon
        yield Batch(
            number, dataset, classifier, confusion, change, tuple(instances), tuple(episodes), settled
        )


def ssub(first: np.ndarray, second: np.ndarray) -> float:
    """Sum of the absolute element-wise differences of two matrices of one shape; SSUB of Algorithm 1."""
    return float(np.abs(first - second).sum())


def augmented(dataset: Dataset, instances: list[Instance], episodes: list[Episode]) -> Dataset:
    """Omega with the (instance, reported label) pairs added.

    Each new case is a group of its own, but equal trajectories share one: a recorded track that is met twice
    must not stand on both sides of a fold. A decision that ended without a report adds nothing.
    """
    pairs = [
        (i.trajectory, e.report) for i, e in zip(instances, episodes, strict=True) if e.report is not None
    ]
    return dataset.extended(pairs, [fingerprint(trajectory) for trajectory, _ in pairs])
