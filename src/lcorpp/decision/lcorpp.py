"""Algorithm 1, LCORPP: decide, add the reported labels to the data, retrain, until convergence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lcorpp.decision.dt_control import Robot, dt_control
from lcorpp.decision.stopping import check_stopping, choose_epsilon, compute_change
from lcorpp.errors import DecisionError
from lcorpp.protocols import Classifier, DomainInterface, Planner, Reasoner, World
from lcorpp.values import (
    ConfusionMatrix,
    Dataset,
    Distribution,
    Episode,
    Instance,
    Interval,
    LabelEvidence,
    track_hash,
)

CONFIDENCE = 0.95
"""Confidence with which the change of a confusion matrix is at most epsilon, by default."""


class Training(NamedTuple):
    """What a training returns; the values are those of `TrainedSense`."""

    classifier: Classifier
    confusion: ConfusionMatrix
    against_reports: ConfusionMatrix | None = None


Train = Callable[[str, Dataset], Training | tuple[Classifier, ConfusionMatrix]]
"""Trains and cross-validates the classifier of a sense; a pair is a training without the third value."""


@dataclass(frozen=True, eq=False)
class TrainedSense:
    """A sense after a (re)training.

    classifier: rho. confusion: C.
    previous: C of the training before; without any count before the first one.
    against_reports: if C is corrected for wrong reports, the matrix that takes them as the true classes.

    A matrix without any count, whose rates are uniform, is that of a classifier that is not trained yet.

    Examples:
        >>> from lcorpp import ConfusionMatrix
        >>> from lcorpp.decision import TrainedSense
        >>> before = ConfusionMatrix(("interested", "not_interested"), [[0, 0], [0, 0]])
        >>> after = ConfusionMatrix(("interested", "not_interested"), [[8, 2], [3, 7]])
        >>> TrainedSense(classifier=None, confusion=after, previous=before).is_trained
        True
    """

    classifier: Classifier
    confusion: ConfusionMatrix
    previous: ConfusionMatrix
    against_reports: ConfusionMatrix | None = None

    @property
    def is_trained(self) -> bool:
        """Whether the confusion matrix has counts."""
        return bool(self.confusion.counts.any())


Senses = Mapping[str, TrainedSense]
"""Name of a sense -> its classifier, for the senses that learn."""


@dataclass(frozen=True, eq=False, repr=False)
class Batch:
    """State of Algorithm 1 after one (re)training of the senses that learn.

    number: 0 for the initial training, then one more for every K decisions.
    datasets: sense -> Omega with the reported labels so far. senses: sense -> what was trained on it.
    instances, episodes: the decisions of this batch, without those of an earlier (resumed) run.
    changes: sense -> change of its confusion matrix with the training, see `compute_change`.
    converged: whether all senses are trained and no change, up to the end of its interval, exceeds epsilon,
        which ends the loop.
    """

    number: int
    datasets: Mapping[str, Dataset]
    senses: Senses
    instances: tuple[Instance, ...]
    episodes: tuple[Episode, ...]
    changes: Mapping[str, Interval]
    converged: bool

    @property
    def change(self) -> Interval:
        """The change of the confusion matrix that may have changed most."""
        return max(self.changes.values(), key=lambda change: change.high)

    def __repr__(self) -> str:
        state = "converged" if self.converged else "not converged"
        senses = "; ".join(
            f"{name}: {len(self.datasets[name])} cases, change {self.changes[name]:.4g}, {sense.confusion}"
            for name, sense in self.senses.items()
        )
        return f"Batch({self.number}: {len(self.episodes)} decisions, {state}; {senses})"


@dataclass(frozen=True, eq=False)
class ResumePoint:
    """State in which an earlier run of Algorithm 1 ended or was interrupted.

    number, senses: of the last complete batch, as in `Batch`.
    decided: number of decisions after that batch; the data sets contain their signals.

    Examples:
        >>> from lcorpp import ConfusionMatrix
        >>> from lcorpp.decision import ResumePoint, TrainedSense
        >>> matrix = ConfusionMatrix(("interested", "not_interested"), [[8, 2], [3, 7]])
        >>> ResumePoint(3, {"motion": TrainedSense(None, matrix, matrix)}, decided=12).decided
        12
    """

    number: int
    senses: Senses
    decided: int


def lcorpp(
    datasets: Mapping[str, Dataset],
    *,
    train: Train,
    make_reasoner: Callable[[Mapping[str, ConfusionMatrix]], Reasoner],
    planner: Planner,
    domain: DomainInterface,
    collect: Callable[[], tuple[Instance, World]],
    batch_size: int,
    epsilon: float | None = None,
    confidence: float = CONFIDENCE,
    other_classifiers: Mapping[str, Classifier] = {},
    change: Callable[[Robot], Robot] = lambda robot: robot,
    listener: Callable[[Instance, Episode], None] = lambda _instance, _episode: None,
    resume_point: ResumePoint | None = None,
) -> Iterator[Batch]:
    """Run the outer loop; every training yields a batch, so the caller may stop at any of them.

    The last training is followed by no decision: it determines whether the loop ends, and its classifiers are
    the result.

    To survive a crash, store each decision in `listener` and each batch when it is yielded, and pass both to
    the next run, as `runs.RunStore` does.

    Args:
        datasets: sense -> Omega, its initial training data, for each sense that learns.
        train: trains and cross-validates the classifier of a sense; returns it and its confusion matrix:
            lines 1 and 2, and again 14 and 15.
        make_reasoner: returns a reasoner whose rules contain the confusion matrix of each sense: lines 3
            and 16.
        planner: pi with its model M: line 4.
        domain: translates between the parts.
        collect: returns a new instance and the world in which to act on it: line 8.
        batch_size: K, the number of decisions between two trainings.
        epsilon: the loop ends when no confusion matrix changes by more than this; default: `choose_epsilon`.
        confidence: with this probability, see `compute_change`; 0 compares the estimates, as the paper does.
        other_classifiers: of the senses that do not learn.
        change: called before every decision; returns the robot that decides instead of one with these parts.
        listener: called after every decision.
        resume_point: state in which an earlier run ended; `datasets` are as of then. The first batch
            yielded is the last complete one of that run, without a training; its decisions are not repeated.

    Raises:
        DecisionError: no sense learns, K < 1, epsilon < 0 or the confidence is not from 0 and below 1; and
            whatever the parts raise.

    Source: Algorithm 1. As printed, line 17 sets C to C_hat in the same step that computes C_hat, and
    the test of line 7 would read 0 after the first batch. The intended comparison, implemented here, is of
    the new matrix with the previous one. C_hat starts uniform (line 5), as printed. The paper has one sense.
    Its supplement starts without data from a random classifier, whose matrix is uniform, too: the loop goes
    on until the classifiers are trained.

    Examples:
        >>> from types import SimpleNamespace
        >>> from lcorpp import ConfusionMatrix, Dataset, Instance, lcorpp, load_robot
        >>> from lcorpp.worlds import ScriptedWorld
        >>> robot, track = load_robot("intention").robot, [[0.0, 1.0], [2.0, 2.0]]
        >>> matrix = ConfusionMatrix(("interested", "not_interested"), [[80, 20], [30, 70]])
        >>> classifier = SimpleNamespace(classify=lambda signal: "interested")
        >>> batches = lcorpp(
        ...     {"motion": Dataset([track], ("interested",))},
        ...     train=lambda sense, dataset: (classifier, matrix),
        ...     make_reasoner=lambda confusions: robot.reasoner,
        ...     planner=robot.planner,
        ...     domain=robot.domain,
        ...     collect=lambda: (Instance({"motion": track}, {}), ScriptedWorld(["pos"] * 9)),
        ...     batch_size=2,
        ...     epsilon=0.1,
        ...     confidence=0,
        ... )
        >>> [(batch.number, len(batch.datasets["motion"]), batch.converged) for batch in batches]
        [(0, 1, False), (1, 3, True)]
    """
    if not datasets:
        raise DecisionError("no sense learns; expected a data set of at least one")
    if batch_size < 1:
        raise DecisionError(f"the batch size K must be at least 1, not {batch_size}")
    check_stopping(epsilon, confidence)
    if resume_point is None:
        resume_point = ResumePoint(0, _train_all(train, datasets, {}), 0)
    number, senses, decided = resume_point.number, resume_point.senses, resume_point.decided
    instances, episodes = list[Instance](), list[Episode]()
    while True:
        changes = {
            name: compute_change(sense.previous, sense.confusion, confidence)
            for name, sense in senses.items()
        }
        converged = has_converged(senses, changes, epsilon)
        yield Batch(number, datasets, senses, tuple(instances), tuple(episodes), changes, converged)
        if converged:
            return
        number += 1
        classifiers = {name: sense.classifier for name, sense in senses.items()}
        reasoner = make_reasoner({name: sense.confusion for name, sense in senses.items()})
        robot = Robot({**other_classifiers, **classifiers}, reasoner, planner, domain)
        instances, episodes = [], []
        while decided + len(episodes) < batch_size:
            instance, world = collect()
            episode = dt_control(change(robot), instance, world)
            instances.append(instance)
            episodes.append(episode)
            listener(instance, episode)
        decided = 0
        datasets = {
            name: augment(dataset, domain, name, instances, episodes) for name, dataset in datasets.items()
        }
        senses = _train_all(train, datasets, senses)


def _train_all(
    train: Train,
    datasets: Mapping[str, Dataset],
    before: Senses,
) -> dict[str, TrainedSense]:
    """Train each sense; `before`: after the last training, empty before the first one."""
    senses = {}
    for name, dataset in datasets.items():
        training = Training(*train(name, dataset))
        matrix = training.confusion
        untrained = ConfusionMatrix(matrix.classes, np.zeros_like(matrix.counts))
        previous = before[name].confusion if before else untrained
        senses[name] = TrainedSense(training.classifier, matrix, previous, training.against_reports)
    return senses


def has_converged(senses: Senses, changes: Mapping[str, Interval], epsilon: float | None) -> bool:
    """Return whether all classifiers are trained and every interval of a change ends by epsilon."""
    return all(
        sense.is_trained and changes[name].high <= choose_epsilon(epsilon, len(sense.confusion.classes))
        for name, sense in senses.items()
    )


def augment(
    dataset: Dataset,
    domain: DomainInterface,
    sense: str,
    instances: list[Instance],
    episodes: list[Episode],
) -> Dataset:
    """Return Omega with the (signal of a sense, reported class) pairs and their evidence appended.

    Each new case is its own group, but equal trajectories share a group: a repeated track must not be in
    both the training and the test part of a fold. A decision without a report or signal adds nothing.
    """
    new = [
        (instance.signals[sense], episode.report, find_evidence(domain, sense, instance, episode))
        for instance, episode in zip(instances, episodes, strict=True)
        if episode.report is not None and sense in instance.signals
    ]
    return dataset.append(
        [(signal, domain.class_of(sense, report)) for signal, report, _ in new],
        [track_hash(signal) for signal, _, _ in new],
        [evidence for _, _, evidence in new],
    )


def find_evidence(domain: DomainInterface, sense: str, instance: Instance, episode: Episode) -> LabelEvidence:
    """Return what the report of an episode, as the label of the signal of a sense, is based on."""
    belief = sum_by_class(domain, sense, domain.marginal(episode.steps[-1].belief))
    return LabelEvidence(belief, dict(instance.context), episode.answers)


def sum_by_class(domain: DomainInterface, sense: str, joint: Distribution) -> dict[str, float]:
    """Return class -> probability for what a sense should predict, given a distribution of shared values."""
    probabilities = dict[str, float]()
    for value, probability in joint:
        name = domain.class_of(sense, value)
        probabilities[name] = probabilities.get(name, 0.0) + probability
    return probabilities
