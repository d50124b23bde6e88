"""Active data augmentation: Algorithm 1 on simulated people, with an optional crash-safe store."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lcorpp.decision import STRATEGIES, Batch, lcorpp
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DecisionError, DomainError, check_type
from lcorpp.experiments.decision_log import DecisionLog
from lcorpp.experiments.robot_parts import ClassifierPart, RobotParts
from lcorpp.experiments.run_store import RunStore
from lcorpp.experiments.scoring.metrics import Scores, score_decisions
from lcorpp.experiments.setup import ProgressDisplay, TrainingOptions, no_progress
from lcorpp.experiments.training_data import FOLDS, TrainingData, choose_learner, make_estimator
from lcorpp.learning import train_and_validate
from lcorpp.protocols import Classifier, Planner
from lcorpp.reasoning import Reasoner
from lcorpp.simulation.people_stream import DecisionResult, PeopleStream
from lcorpp.simulation.simulated_classifier import NoisyChannel
from lcorpp.values import ConfusionMatrix, Dataset, Episode, Instance

Row = dict[str, float | int | str]


@dataclass(frozen=True)
class ActiveLearningOptions:
    """Options of Algorithm 1.

    training: the learner and the initial data.
    sense: the sense that learns; None takes the first one that classifies a shared variable. The others are
        noisy channels.
    soft: likelihoods instead of labels as evidence.
    batch_size: K, decisions between two trainings.
    epsilon: the run ends when the confusion matrix changes by at most this much.
    max_batches: the run ends after this many batches.
    seed: of all random numbers. jobs: processes for training.
    """

    training: TrainingOptions = field(default_factory=TrainingOptions)
    sense: str | None = None
    soft: bool = False
    batch_size: int = 100
    epsilon: float = 0.05
    max_batches: int = 20
    seed: int = 0
    jobs: int = 1


@dataclass(frozen=True, eq=False)
class BatchResult:
    """A batch with its scores.

    batch: the classifier, data set and confusion matrix after the training.
    scores: of the batch's decisions; None without decisions, and for a batch of an earlier run.
    rows: one table row per batch so far, of earlier runs too.
    resumed: whether an earlier run completed the batch.
    """

    batch: Batch
    scores: Scores | None
    rows: tuple[Row, ...]
    resumed: bool

    def summary(self) -> str:
        """Return the size of the data set, the recall of each class and the scores in one line."""
        batch = self.batch
        rates = np.diag(batch.confusion.probabilities)
        recall = ", ".join(
            f"{name} {rate:.3f}" for name, rate in zip(batch.confusion.classes, rates, strict=True)
        )
        text = f"{len(batch.dataset)} tracks; recall: {recall}; change {batch.change:.3f}"
        if self.scores is None:
            return text
        f1, cost, return_ = self.scores.f1, self.scores.cost, self.scores.return_
        return f"{text}; F1 {f1.estimate:.3f}, cost {cost.estimate:.2f}, return {return_.estimate:.2f}"

    def __repr__(self) -> str:
        return f"<BatchResult {self.batch.number}: {self.summary()}>"


def open_run_store(
    path: Path, domain: Domain, data: TrainingData, options: ActiveLearningOptions
) -> RunStore:
    """Open the store of a run, or create it; a checkpoint of other options is not used.

    Raises:
        FileError, DataError: as `RunStore`.
    """
    settings = {
        "domain": domain.name,
        "preset": domain.preset,
        "learner": choose_learner(options.training, data.dataset).learner,
        "evidence": "soft" if options.soft else "hard",
        "seed": options.seed,
        "epochs": options.training.epochs,
    }
    return RunStore(path, data.dataset, find_learning_sense(domain, options).classes, settings)


def find_learning_sense(domain: Domain, options: ActiveLearningOptions) -> Sense:
    """Return the sense that learns from the reports.

    Raises:
        DomainError: there is none of this name, or it classifies no shared variable.
    """
    if options.sense is not None:
        sense = domain.find_sense(options.sense)
        domain.class_of(sense.name, domain.values[0])
        return sense
    for sense in domain.senses:
        if sense.of in domain.reasoning.shared:
            return sense
    raise DomainError(
        f"{domain.folder}/domain.toml: no sense classifies a shared variable, so reports are no labels"
    )


def run_active_learning(
    domain: Domain,
    data: TrainingData,
    planner: Planner,
    options: ActiveLearningOptions,
    *,
    run_store: RunStore | None = None,
    log: DecisionLog | None = None,
    parts: RobotParts | None = None,
    progress: ProgressDisplay = no_progress,
) -> Iterator[BatchResult]:
    """Run Algorithm 1 and yield each batch after its training, the initial training first.

    Args:
        data: see `make_training_data`.
        run_store: stores every decision and a checkpoint of every batch; a run of the same options resumes
            where the last one ended, and its first batch is the last completed one.
        log: receives every decision. parts: the domain and the planner's policy, which a log needs.

    Raises:
        DataError, DecisionError: an option is wrong; and whatever the robot's parts raise.
    """
    check_type(domain, Domain, "the domain", DomainError)
    check_type(data, TrainingData, "the initial data", DecisionError)
    check_type(options, ActiveLearningOptions, "`options`", DecisionError)
    sense, estimator = (
        find_learning_sense(domain, options),
        make_estimator(data, options.training, options.seed),
    )
    channels = {
        other.name: NoisyChannel.from_domain(domain, other) for other in domain.senses if other is not sense
    }

    def train(dataset: Dataset) -> tuple[Classifier, ConfusionMatrix]:
        with progress(f"training on {len(dataset)} tracks", FOLDS + 1) as advance:
            trained, validation = train_and_validate(
                estimator, dataset, folds=FOLDS, seed=options.seed, jobs=options.jobs, progress=advance
            )
        return (trained.soft() if options.soft else trained), validation.confusion

    def make_reasoner(confusion: ConfusionMatrix) -> Reasoner:
        return Reasoner(
            domain.soft_program([sense.name]) if options.soft else domain.program_for({sense.name: confusion})
        )

    if log is not None and parts is None:
        raise DecisionError("a log needs the `parts`, which determine the decisions")
    dataset, resume_point, position = data.dataset, None, 0
    results, rows = list[DecisionResult](), list[Row]()  # the decisions since the last batch; all batches
    if run_store is not None:
        resume_point = run_store.resume(train)
        dataset, position, rows = run_store.dataset(), run_store.n_people, run_store.rows
        results = [result for track in run_store.pending if (result := DecisionResult.from_stored(track))]
    stream = PeopleStream(domain, {sense.name: data.signals, **channels}, options.seed, position=position)

    def record(instance: Instance, episode: Episode) -> None:
        result = stream.result(episode)
        results.append(result)
        if log is not None and current is not None:
            log.append(current, STRATEGIES[-1], instance.context, episode, stream.describe_truth())
        if run_store is not None:
            joint = domain.marginal(episode.steps[-1].belief if episode.steps else episode.prior)
            belief = domain.marginalise(joint, sense.of)
            label = None if episode.report is None else domain.class_of(sense.name, episode.report)
            run_store.append_decision(
                instance.signals[sense.name], instance.context, label, belief, result.to_extra()
            )

    batches = lcorpp(
        dataset,
        sense=sense.name,
        other_classifiers=channels,
        train=train,
        make_reasoner=make_reasoner,
        planner=planner,
        domain=domain,
        collect=stream.next,
        batch_size=options.batch_size,
        epsilon=options.epsilon,
        listener=record,
        resume_point=resume_point,
    )
    resumed = resume_point is not None  # true of the first batch only
    current: RobotParts | None = None
    for batch in batches:
        if parts is not None:
            current = replace(parts, classifiers=_describe_classifiers(batch, sense, channels, options))
        scores = _score_batch(domain, results) if results and not resumed else None
        if not resumed:
            results.clear()
            row: Row = {"batch": batch.number, "tracks": len(batch.dataset), "change": batch.change}
            if scores is not None:
                row |= {name: interval.estimate for name, interval in scores.metrics.items()}
            rows.append(row)
        if run_store is not None:
            run_store.save_checkpoint(batch, rows)
        yield BatchResult(batch, scores, tuple(rows), resumed)
        resumed = False
        if batch.number >= options.max_batches:
            return


def _describe_classifiers(
    batch: Batch, sense: Sense, channels: Mapping[str, NoisyChannel], options: ActiveLearningOptions
) -> dict[str, ClassifierPart]:
    """Return the classifiers of the decisions after a batch, for the log."""
    learner = choose_learner(options.training, batch.dataset).learner or ""
    return {
        **{name: ClassifierPart.of("channel", channel) for name, channel in channels.items()},
        sense.name: ClassifierPart.of(
            learner, batch.classifier, confusion=batch.confusion, soft=options.soft
        ),
    }


def _score_batch(domain: Domain, results: Sequence[DecisionResult]) -> Scores:
    values = domain.values
    counts = np.zeros((len(values), len(values) + 1))
    for result in results:
        reported = len(values) if result.report is None else values.index(result.report)
        counts[values.index(result.actual), reported] += 1
    cost = np.array([result.cost for result in results])
    return_ = np.array([result.return_ for result in results])
    return score_decisions(
        "LCORPP",
        counts,
        cost,
        return_,
        values=values,
        positive=domain.positive,
        variables=domain.reasoning.shared,
    )
