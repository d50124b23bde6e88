"""Active data augmentation: Algorithm 1 on simulated people, with an optional crash-safe store."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from lcorpp.decision import STRATEGIES, Batch, lcorpp
from lcorpp.decision.lcorpp import sum_by_class
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError, check_type
from lcorpp.experiments.active_learning.batches import BatchResult, Row, make_row, score_batch
from lcorpp.experiments.active_learning.run_store import RunStore
from lcorpp.experiments.active_learning.senses import ActiveLearningOptions, LearningSenses
from lcorpp.experiments.active_learning.untrained import RandomClassifier, is_trainable
from lcorpp.experiments.decision_log import DecisionLog
from lcorpp.experiments.robot_parts import ClassifierPart, RobotParts
from lcorpp.experiments.sense_setup import describe_classifiers
from lcorpp.experiments.setup import EvidenceOptions, ProgressDisplay, no_progress
from lcorpp.experiments.training_data import FOLDS, make_estimator
from lcorpp.learning import train_and_validate
from lcorpp.learning.classifiers.registry import check_weighted
from lcorpp.protocols import Classifier, Planner
from lcorpp.reasoning import Reasoner
from lcorpp.simulation.people_stream import DecisionResult, PeopleStream
from lcorpp.values import ConfusionMatrix, Dataset, Distribution, Episode, Instance


def open_run_store(
    path: Path, domain: Domain, senses: LearningSenses, options: ActiveLearningOptions
) -> RunStore:
    """Open the store of a run, or create it; a checkpoint of other options is not used.

    Raises:
        FileError, DataError: as `RunStore`.
    """
    settings = {"domain": domain.name, "preset": domain.preset, "seed": options.seed}
    for number, (name, training) in enumerate(senses.training.items()):
        own = {
            "learner": training.learner,
            "evidence": "soft" if options.evidence.is_soft(name) else "hard",
            "epochs": training.epochs,
            "labels": "soft" if options.soft_labels else "hard",
        }
        settings |= {key if number == 0 else f"{name} {key}": value for key, value in own.items()}
    datasets = {name: data.dataset for name, data in senses.data.items()}
    classes = {name: domain.find_sense(name).classes for name in datasets}
    return RunStore(path, datasets, classes, settings, soft_labels=options.soft_labels)


def run_active_learning(
    domain: Domain,
    senses: LearningSenses,
    planner: Planner,
    options: ActiveLearningOptions,
    *,
    run_store: RunStore | None = None,
    log: DecisionLog | None = None,
    parts: RobotParts | None = None,
    progress: ProgressDisplay = no_progress,
) -> Iterator[BatchResult]:
    """Run Algorithm 1 and yield each batch after its training, the initial training first.

    A sense whose initial data set is empty has a random classifier, and rules with uniform error rates, until
    each class has a case for each fold of the cross-validation.

    Args:
        senses: see `set_up_learning`.
        run_store: stores every decision and a checkpoint of every batch; a run of the same options resumes
            where the last one ended, and its first batch is the last completed one.
        log: receives every decision. parts: the domain and the planner's policy, which a log needs.

    Raises:
        DataError, DecisionError: an option is wrong, or soft labels are for a learner without
            `sample_weight`; and whatever the robot's parts raise.
    """
    check_type(domain, Domain, "the domain", DomainError)
    check_type(senses, LearningSenses, "the senses", DecisionError)
    check_type(options, ActiveLearningOptions, "`options`", DecisionError)
    evidence = options.evidence
    estimators = {
        name: make_estimator(data, senses.training[name], options.seed) for name, data in senses.data.items()
    }
    if options.soft_labels:
        for name, estimator in estimators.items():
            check_weighted(senses.training[name].learner or "", estimator)
    fixed_confusions = {
        name: setup.confusion for name, setup in senses.fixed.items() if setup.confusion is not None
    }

    def train(name: str, dataset: Dataset) -> tuple[Classifier, ConfusionMatrix]:
        classes = domain.find_sense(name).classes
        if not len(senses.data[name].dataset) and not is_trainable(dataset, classes, FOLDS):
            untrained = RandomClassifier(classes, options.seed, evidence.is_soft(name))
            return untrained, untrained.confusion
        sense = f"{name}: " if len(estimators) > 1 else ""
        with progress(f"{sense}training on {dataset.n_people:g} {dataset.unit}", FOLDS + 1) as advance:
            trained, validation = train_and_validate(
                estimators[name],
                dataset,
                folds=FOLDS,
                seed=options.seed,
                jobs=options.jobs,
                progress=advance,
            )
        return (trained.soft() if evidence.is_soft(name) else trained), validation.confusion

    def make_reasoner(learned: Mapping[str, ConfusionMatrix]) -> Reasoner:
        confusions = {**fixed_confusions, **learned}
        soft = [name for name in confusions if evidence.is_soft(name)]
        return Reasoner(domain.program_for(confusions, evidence.smoothing, soft=soft))

    if log is not None and parts is None:
        raise DecisionError("a log needs the `parts`, which determine the decisions")
    datasets: Mapping[str, Dataset] = {name: data.dataset for name, data in senses.data.items()}
    resume_point, position = None, 0
    results, rows = list[DecisionResult](), list[Row]()  # the decisions since the last batch; all batches
    if run_store is not None:
        resume_point = run_store.resume(train)
        datasets, position, rows = run_store.datasets(), run_store.n_people, run_store.rows
        results = [result for track in run_store.pending if (result := DecisionResult.from_stored(track))]
    sources = {name: data.signals for name, data in senses.data.items()}
    sources |= {name: setup.signals for name, setup in senses.fixed.items()}
    stream = PeopleStream(domain, sources, options.seed, position=position)

    def record(instance: Instance, episode: Episode) -> None:
        result = stream.result(episode)
        results.append(result)
        if log is not None and current is not None:
            log.append(current, STRATEGIES[-1], instance.context, episode, stream.describe_truth())
        if run_store is not None:
            joint = domain.marginal(episode.steps[-1].belief if episode.steps else episode.prior)
            report = episode.report
            run_store.append_decision(
                instance.signals,
                instance.context,
                {name: None if report is None else domain.class_of(name, report) for name in estimators},
                {name: find_class_marginal(domain, name, joint) for name in estimators},
                result.to_extra(),
            )

    batches = lcorpp(
        datasets,
        other_classifiers={name: setup.classifier for name, setup in senses.fixed.items()},
        train=train,
        make_reasoner=make_reasoner,
        planner=planner,
        domain=domain,
        collect=stream.next,
        batch_size=options.batch_size,
        epsilon=options.epsilon,
        listener=record,
        soft_labels=options.soft_labels,
        resume_point=resume_point,
    )
    resumed = resume_point is not None  # true of the first batch only
    current: RobotParts | None = None
    for batch in batches:
        if parts is not None:
            classifiers = _describe_classifiers(batch, senses, evidence)
            current = replace(parts, classifiers=classifiers, smoothing=evidence.smoothing)
        decisions = () if resumed else tuple(results)
        scores = score_batch(domain, decisions) if decisions else None
        if not resumed:
            results.clear()
            rows.append(make_row(batch, scores))
        if run_store is not None:
            run_store.save_checkpoint(batch, rows)
        yield BatchResult(batch, scores, tuple(rows), resumed, decisions)
        resumed = False
        if batch.number >= options.max_batches:
            return


def _describe_classifiers(
    batch: Batch, senses: LearningSenses, evidence: EvidenceOptions
) -> dict[str, ClassifierPart]:
    """Return the classifiers of the decisions after a batch, for the log."""
    learned = {
        name: ClassifierPart.of(
            (senses.training[name].learner or "") if sense.is_trained else "random",
            sense.classifier,
            confusion=sense.confusion,
            soft=evidence.is_soft(name),
        )
        for name, sense in batch.senses.items()
    }
    return {**describe_classifiers(senses.fixed), **learned}


def find_class_marginal(domain: Domain, sense: str, joint: Distribution) -> Distribution:
    """Return the distribution of the class that a sense should predict, from that of the shared variables."""
    classes = domain.find_sense(sense).classes
    probabilities = sum_by_class(domain, sense, joint)
    return Distribution(classes, np.array([probabilities.get(name, 0.0) for name in classes]))
