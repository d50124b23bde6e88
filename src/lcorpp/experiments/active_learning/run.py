"""Active data augmentation: Algorithm 1 on simulated people, with an optional crash-safe store."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from lcorpp.arguments import check_arguments
from lcorpp.decision import lcorpp
from lcorpp.domains import Domain
from lcorpp.errors import DataError, DecisionError, DomainError, check_type
from lcorpp.experiments.active_learning.batches import BatchResult, Row, make_row, score_batch
from lcorpp.experiments.active_learning.drift import DriftMonitor
from lcorpp.experiments.active_learning.recording import DecisionRecorder
from lcorpp.experiments.active_learning.run_store import RunStore
from lcorpp.experiments.active_learning.senses import ActiveLearningOptions, LearningSenses
from lcorpp.experiments.active_learning.session import LearningSession
from lcorpp.experiments.active_learning.training import SenseTrainer
from lcorpp.experiments.decision_log import DecisionLog
from lcorpp.experiments.robot_parts import RobotParts
from lcorpp.experiments.setup import ProgressDisplay, TrainingOptions, no_progress
from lcorpp.protocols import Planner
from lcorpp.simulation.people_stream import PeopleStream
from lcorpp.values import Dataset

DEFAULTS = TrainingOptions()


@check_arguments
def open_run_store(
    path: Path, domain: Domain, senses: LearningSenses, options: ActiveLearningOptions
) -> RunStore:
    """Open the store of a run, or create it; a checkpoint of other options is not used.

    Raises:
        FileError, DataError: as `RunStore`.
        DataError: its decisions were made with trust and this run is without it, or vice versa.
    """
    settings = {"domain": domain.name, "preset": domain.preset, "seed": options.seed}
    for number, (name, training) in enumerate(senses.training.items()):
        own = {
            "learner": training.learner,
            "evidence": str(options.evidence.kind(name)),
            "epochs": training.epochs,
            "labels": options.labels,
        }
        for key in ("features", "rate", "threshold", "prevalence"):  # older checkpoints have the default ones
            if (value := getattr(training, key)) != getattr(DEFAULTS, key):
                own[key] = str(value)
        settings |= {key if number == 0 else f"{name} {key}": value for key, value in own.items()}
    if options.trust:
        settings["trust"] = True
    datasets = {name: data.dataset for name, data in senses.data.items()}
    classes = {name: domain.find_sense(name).classes for name in datasets}
    run_store = RunStore(path, datasets, classes, settings)
    if run_store.has_evidence not in (None, options.trust):
        run_store.close()
        before, now = ("with", "without") if run_store.has_evidence else ("without", "with")
        raise DataError(
            f"{path}: the run of this store was begun {before} --trust, and this one is {now} it; expected"
            " the same, or another store"
        )
    return run_store


@check_arguments
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
        DataError, DecisionError: an option is wrong, or uncertain labels are for a learner without
            `sample_weight`; and whatever the robot's parts raise.
    """
    check_type(domain, Domain, "the domain", DomainError)
    check_type(senses, LearningSenses, "the senses", DecisionError)
    check_type(options, ActiveLearningOptions, "`options`", DecisionError)
    if log is not None and parts is None:
        raise DecisionError("a log needs the `parts`, which determine the decisions")
    trainer = SenseTrainer(domain, senses, options, progress)
    datasets: Mapping[str, Dataset] = {name: data.dataset for name, data in senses.data.items()}
    resume_point, position, rows = None, 0, list[Row]()
    if run_store is not None:
        resume_point = run_store.resume(trainer.train)
        datasets, position, rows = run_store.datasets(), run_store.n_people, run_store.rows
    sources = {name: data.signals for name, data in senses.data.items()}
    sources |= {name: setup.signals for name, setup in senses.fixed.items()}
    stream = PeopleStream(domain, sources, options.seed, position=position)
    monitor = DriftMonitor(tuple(senses.data), options.seed)
    if run_store is not None:
        monitor.restore(run_store)
    session = LearningSession(domain, planner, trainer, run_store, trust=options.trust)
    recorder = DecisionRecorder(domain, tuple(senses.data), stream, monitor, run_store, log, session)
    batches = lcorpp(
        datasets,
        other_classifiers={name: setup.classifier for name, setup in senses.fixed.items()},
        train=trainer.train,
        make_reasoner=session.make_reasoner,
        planner=planner,
        domain=domain,
        collect=stream.next,
        change=session.change,
        batch_size=options.batch_size,
        epsilon=options.epsilon,
        confidence=options.confidence,
        listener=recorder.record,
        resume_point=resume_point,
    )
    resumed = resume_point is not None  # true of the first batch only
    for batch in batches:
        if log is not None and parts is not None:
            classifiers = trainer.describe_classifiers(batch)
            recorder.parts = replace(parts, classifiers=classifiers, smoothing=options.evidence.smoothing)
        decisions = () if resumed else recorder.take_results()
        scores = score_batch(domain, decisions, session.strategy) if decisions else None
        if not resumed:
            drift = monitor.test_batch(batch.number, rows)
            rows.append(make_row(batch, scores) | drift | session.describe())
        recorder.trained = [name for name, sense in batch.senses.items() if sense.is_trained]
        if run_store is not None:
            run_store.save_checkpoint(batch, rows, session.state())
        yield BatchResult(batch, scores, tuple(rows), resumed, decisions)
        resumed = False
        if batch.number >= options.max_batches:
            return
