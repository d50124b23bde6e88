"""Active data augmentation: Algorithm 1 on simulated people, with an optional crash-safe store."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from lcorpp.arguments import check_arguments
from lcorpp.assembly.options import TrainingOptions
from lcorpp.assembly.progress import ProgressDisplay, no_progress
from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.assembly.strategies.trust import TRUST, find_ask_budget
from lcorpp.decision import LCORPP, Strategy, lcorpp
from lcorpp.decision.lcorpp import Batch
from lcorpp.domains import Domain
from lcorpp.errors import DataError, DecisionError
from lcorpp.logs.decision_log import DecisionLog
from lcorpp.protocols import Planner
from lcorpp.runs.batches import BatchResult, Row, make_row, score_batch
from lcorpp.runs.drift import DriftMonitor
from lcorpp.runs.recording import DecisionRecorder
from lcorpp.runs.run_store import EVIDENCE, STRATEGY, RunStore
from lcorpp.runs.senses import ActiveLearningOptions, LearningSenses
from lcorpp.runs.session import LearningSession
from lcorpp.runs.training import SenseTrainer
from lcorpp.simulation.people_stream import PeopleStream
from lcorpp.trust import Finding
from lcorpp.values import Dataset

DEFAULTS = TrainingOptions()


@check_arguments
def open_run_store(
    path: Path, domain: Domain, senses: LearningSenses, options: ActiveLearningOptions
) -> RunStore:
    """Open the store of a run, or create it; a checkpoint of other options is not used.

    Raises:
        FileError, DataError: as `RunStore`.
        DataError: another strategy made its decisions; or the run has the alarm and these no evidence.
    """
    settings = {"domain": domain.name, "preset": domain.preset, "seed": options.seed}
    for number, (name, training) in enumerate(senses.training.items()):
        own = {
            "learner": training.learner,
            "evidence": str(options.evidence.kind(name)),
            "epochs": training.epochs,
            "labels": options.labels,
        }
        for key in (
            "features",
            "rate",
            "threshold",
            "prevalence",
            "balance",
        ):  # older checkpoints have the default ones
            if (value := getattr(training, key)) != getattr(DEFAULTS, key):
                own[key] = str(value)
        settings |= {key if number == 0 else f"{name} {key}": value for key, value in own.items()}
    if options.strategy.name == TRUST.name:
        settings["trust"] = True
    elif options.strategy is not LCORPP:
        settings["strategy"] = options.strategy.name
    if (budget := find_ask_budget(options.strategy)) is not None:
        settings["ask_budget"] = str(budget)
    datasets = {name: data.dataset for name, data in senses.data.items()}
    classes = {name: domain.find_sense(name).classes for name in datasets}
    run_store = RunStore(path, datasets, classes, settings)
    try:
        _check_decisions(run_store, options)
    except DataError:
        run_store.close()
        raise
    return run_store


def _check_decisions(run_store: RunStore, options: ActiveLearningOptions) -> None:
    """Check that the earlier decisions are of the same strategy, and have what the run needs."""
    path, decisions = run_store.store.path, [t.extra for t in run_store.store.snapshot() if "met" in t.extra]
    before = [extra.get(STRATEGY, LCORPP.name) for extra in decisions]
    if before and before[-1] != options.strategy.name:
        raise DataError(
            f"{path}: {before[-1]} decided in the run of this store, and {options.strategy.name} does in"
            " this one; expected the same --strategy, or another store"
        )
    if options.watch and not all(EVIDENCE in extra for extra in decisions):
        raise DataError(
            f"{path}: it has decisions of a run without --watch, which lack their evidence; expected another"
            " store"
        )


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
    on_alarm: Callable[[int, int, Finding], None] = lambda batch, person, finding: None,
    progress: ProgressDisplay = no_progress,
) -> Iterator[BatchResult]:
    """Run Algorithm 1 and yield each batch after its training, the initial training first.

    A sense whose initial data set is empty has a random classifier, and rules with uniform error rates, until
    each class has a case for each fold of the cross-validation.

    Args:
        senses: see `set_up_learning`.
        run_store: stores every decision and a checkpoint of every batch; a run of the same options resumes
            where the last one ended, and its first batch is the last completed one.
        on_alarm: called with the batch, the number of people and the finding when an alarm is raised.
        log: receives every decision. parts: the domain and the planner's policy, which a log needs.
        progress: displays long steps; called with a title and the number of parts, it returns a context that
            yields a callback with (parts done, parts).

    Raises:
        DataError, DecisionError: an option is wrong, or uncertain labels are for a learner without
            `sample_weight`; and whatever the robot's parts raise.

    Examples:
        >>> from lcorpp import load_robot
        >>> from lcorpp.assembly import TrainingOptions
        >>> from lcorpp.runs import ActiveLearningOptions, run_active_learning, set_up_learning
        >>> full = load_robot("intention", cache=False)
        >>> training = TrainingOptions("summaries", tracks=20)
        >>> options = ActiveLearningOptions({"motion": training}, batch_size=10, max_batches=1)
        >>> senses = set_up_learning(full.domain, options)
        >>> results = list(run_active_learning(full.domain, senses, full.robot.planner, options))
        >>> [len(result.batch.datasets["motion"]) for result in results]  # the second with 10 reports
        [20, 30]
        >>> results[1].scores.counts.sum().astype(int).tolist()  # decisions
        10
    """
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
    next_batch = 1

    def report_alarm(person: int, finding: Finding) -> None:
        on_alarm(next_batch, person, finding)

    session = LearningSession(
        domain,
        planner,
        trainer,
        run_store,
        strategy=options.strategy,
        watch=options.watch,
        listener=report_alarm,
    )
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
    for batch in _locate_failures(session.strategy, batches):
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
        resumed, next_batch = False, batch.number + 1
        if batch.number >= options.max_batches:
            return


def _locate_failures(strategy: Strategy, batches: Iterator[Batch]) -> Iterator[Batch]:
    """Yield the batches; errors of an own strategy name its file and line."""
    while True:
        with strategy.locate_failures():
            batch = next(batches, None)
        if batch is None:
            return
        yield batch
