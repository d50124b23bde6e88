"""`lcorpp learn`: Algorithm 1, active learning from the robot's own reports."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.groups import take_options
from lcorpp.cli.options.robot import RobotGroup
from lcorpp.cli.options.senses import reject_given
from lcorpp.errors import DataError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.domains import Domain
    from lcorpp.experiments.result_folder import WrittenFiles
    from lcorpp.planning import Planner, Policy, Solution, SolverOptions
    from lcorpp.runs.batches import BatchResult
    from lcorpp.runs.run_store import RunStore
    from lcorpp.runs.senses import ActiveLearningOptions, LearningSenses
    from lcorpp.trust import Finding

TRACKS, MIN_TRACKS = 100, 20
"""Simulated training tracks of a sense that learns, without --tracks; and the minimum, if there are any."""


class Labels(StrEnum):
    """How far a report is trusted as the label of a track."""

    hard = "hard"
    soft = "soft"
    corrected = "corrected"


DEVICES = ("cpu", "cuda")
"""The devices of the LSTM; a learner of your own may know others."""


@take_consent
@take_options
def learn(
    given: RobotGroup,
    batch_size: Annotated[
        int, typer.Option(min=1, max=options.MAX_TRACKS, help="K: decisions between two trainings.")
    ] = 100,
    epsilon: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Stop when no confusion matrix changes by more than this, which is the sum of the absolute"
            " differences of its rates.",
            show_default=".09 for each class",
        ),
    ] = None,
    confidence: Annotated[
        float,
        typer.Option(
            min=0,
            help="Probability, below 1, with which the change is at most epsilon; 0 compares the estimates"
            " alone, as the paper does.",
        ),
    ] = 0.95,
    max_batches: Annotated[int, typer.Option(min=1, help="Stop after this many batches.")] = 20,
    tracks: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=options.MAX_TRACKS,
            help="Simulated training tracks before the first batch, at least 20; or 0: the labels of the"
            " classifier are random until the robot's reports suffice to train it.",
            show_default=str(TRACKS),
        ),
    ] = None,
    labels: Annotated[
        Labels,
        typer.Option(
            help="hard: a reported label is taken as certain; soft: a track counts for each class with the"
            " weight of the robot's belief when it reported; corrected: with the probability of the class"
            " that the answers and the classifier's predictions imply; the confusion matrix is corrected too."
        ),
    ] = Labels.hard,
    trust: Annotated[
        bool,
        typer.Option(
            "--trust",
            help="Decide by LCORPP+trust: learn from each person's answers how far knowledge, classifiers and"
            " the observation model can be relied on.",
        ),
    ] = False,
    watch: Annotated[
        bool,
        typer.Option(
            "--watch",
            help="Raise an alarm if knowledge, classifiers or hearing are not as stated, as `lcorpp watch`.",
        ),
    ] = False,
    store: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Store every decision in this file (suffix .tracks), of further senses in FILE-SENSE. If it"
            " exists, the run resumes.",
        ),
    ] = None,
) -> None:
    """Run Algorithm 1: decide, store the reports, retrain.

    The senses whose class a report names are retrained after each batch; the others stay as they are.
    Each batch is written to --out when it is complete; Ctrl-C keeps the complete batches. Ctrl-C in the
    solver stops only the solver; the command continues with the best policy so far. With --store every
    decision survives any interruption, and the same command resumes the run.
    """
    from lcorpp.assembly.robot_parts import RobotParts
    from lcorpp.assembly.solving import explain_missing_reports
    from lcorpp.cli.robot_output import note_storage_problems, print_domain
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.runs.run import open_run_store, run_active_learning
    from lcorpp.runs.senses import ActiveLearningOptions, set_up_learning

    loaded = given.load_domain()
    sources = _choose_sources(loaded, given, tracks)
    chosen = ActiveLearningOptions(
        sources,
        given.choose_evidence(loaded, sources),
        labels=labels.value,
        batch_size=batch_size,
        epsilon=epsilon,
        confidence=confidence,
        max_batches=max_batches,
        trust=trust,
        watch=watch,
        seed=given.seed,
        jobs=console.count_processes(given.jobs),
    )
    _check_options(loaded, chosen, tracks)
    policy, solving = given.read_policy(loaded), given.solving.choose_solver(loaded)
    if store is not None and not store.exists():
        output_files.check_writable(store)
    with ExitStack() as stack:
        stack.enter_context(output_files.lock_results(given.out, given.formats))
        log = None if given.log is None else stack.enter_context(DecisionLog(given.log))
        print_domain(loaded)
        senses = set_up_learning(loaded, chosen, progress=console.show_progress)
        _print_senses(loaded, senses)
        run_store = None
        if store is not None:
            run_store = stack.enter_context(open_run_store(store, loaded, senses, chosen))
            _print_run_store(run_store)
        noted = given.out is not None and note_storage_problems(senses.training.values())
        outcome = _Outcome()
        with _keep_on_interrupt(outcome, store):
            planner, outcome.solution = _make_planner(loaded, policy, solving, given.solving.find_cache())
            stack.enter_context(explain_missing_reports(outcome.solution))
            solver = None if outcome.solution is None else solving
            results = run_active_learning(
                loaded,
                senses,
                planner,
                chosen,
                run_store=run_store,
                log=log,
                parts=RobotParts(loaded, planner.policy, solver=solver, policy_file=given.policy),
                on_alarm=partial(_print_alarm, loaded),
                progress=console.show_progress,
            )
            for result in _print_batches(results, chosen, run_store):
                outcome.add(result, trust=trust)
                if given.out is not None:
                    outcome.write(given.out, loaded.name, result, given.formats)
    _print_outcome(outcome, solving.precision, noted=noted)


@dataclass
class _Outcome:
    """What the batches of a run leave.

    gaps: of the priors of the decisions, unless each POMDP is estimated (with trust).
    """

    solution: Solution | None = None
    gaps: list[float] = field(default_factory=list)
    n_batches: int = 0
    written: WrittenFiles | None = None

    def add(self, result: BatchResult, *, trust: bool) -> None:
        """Count a batch, and keep the gaps of its priors."""
        self.n_batches += 1
        if self.solution is not None and not trust:
            self.gaps += [self.solution.gap(episode.prior) for episode in result.batch.episodes]

    def write(self, folder: Path, domain: str, result: BatchResult, formats: Sequence[str] | None) -> None:
        """Write all batches so far; formats: of the figure, None for the default ones."""
        from lcorpp.experiments.batch_results import write_batches
        from lcorpp.experiments.result_folder import FORMATS

        self.written = write_batches(
            folder, domain, result, solution=self.solution, formats=formats or FORMATS
        )


@contextmanager
def _keep_on_interrupt(outcome: _Outcome, store: Path | None) -> Iterator[None]:
    """Return a context that prints on Ctrl-C what is kept; the command ends if there is nothing."""
    try:
        yield
    except KeyboardInterrupt:
        kept = "the batches above are kept" if outcome.n_batches else "no batch is complete"
        kept += "" if store is None else f"; the decisions so far are kept in {store}"
        console.err.print(f"interrupted: {kept}")
        if not outcome.n_batches and store is None:
            raise typer.Exit(130) from None


def _print_outcome(outcome: _Outcome, precision: float, *, noted: bool) -> None:
    """Print the gap of the policy and the files. noted: as of `print_written`."""
    from lcorpp.cli.robot_output import print_gap, print_written

    if outcome.solution is not None:
        print_gap(outcome.solution, max(outcome.gaps, default=None), precision)
    if outcome.written is not None:
        print_written(outcome.written, noted=noted)


def _choose_sources(domain: Domain, given: RobotGroup, tracks: int | None) -> dict[str, ClassifierOptions]:
    """Return the options of the classifier of each sense; `tracks` is for those that learn."""
    from lcorpp.assembly.options import TrainingOptions
    from lcorpp.runs.senses import find_learning_senses

    sources = given.choose_classifiers(
        domain, domain.senses, tracks, trained=find_learning_senses(domain, {})
    )
    learning = find_learning_senses(domain, sources)
    for name, training in learning.items():
        if training.tracks is None and not (training.data or domain.find_sense(name).data):
            sources[name] = replace(training, tracks=TRACKS)
    others = [sources[name] for name in sources if name not in learning]
    if given.threshold is None and not any(isinstance(source, TrainingOptions) for source in others):
        reject_given("it is for thresholds; expected --threshold, too", prevalence=given.prevalence)
    if tracks == 0:  # the other senses are trained now, on the number of tracks of the domain
        for name, source in sources.items():
            if name not in learning and isinstance(source, TrainingOptions):
                sources[name] = replace(source, tracks=None)
    return sources


def _make_planner(
    domain: Domain, policy: Policy | None, solver: SolverOptions, cache: Path | None
) -> tuple[Planner, Solution | None]:
    """Return the planner of a given policy, or solve the POMDP and print how well."""
    from lcorpp.assembly.solving import solve_domain
    from lcorpp.cli.robot_output import print_solution
    from lcorpp.planning import Planner

    if policy is not None:
        return Planner(policy, domain.pomdp), None
    with console.show_progress("solving the POMDP") as advance:
        solution = solve_domain(domain, solver, any_prior=True, cache=cache, advance=advance)
    print_solution(solution)
    return Planner(solution), solution


def _print_batches(
    results: Iterable[BatchResult], chosen: ActiveLearningOptions, run_store: RunStore | None
) -> Iterator[BatchResult]:
    """Print each batch, the new notes of the store and the reason of the end; and yield the batch."""
    from lcorpp.runs.batches import explain_end

    printed = len(run_store.notes) if run_store else 0
    for result in results:
        for text in run_store.notes[printed:] if run_store else []:
            console.print_note(text)
        printed = len(run_store.notes) if run_store else 0
        batch = result.batch
        title = "resumed" if result.resumed else f"batch {batch.number}"
        console.out.print(f"{title}: {result.summary()}")
        yield result
        if batch.converged or batch.number >= chosen.max_batches:
            console.out.print(explain_end(batch, chosen.epsilon))


def _print_alarm(domain: Domain, batch: int, person: int, finding: Finding) -> None:
    from lcorpp.logs.watching import describe_finding

    console.print_note(f"batch {batch}, person {person}: {describe_finding(finding, domain)}")


def _check_options(domain: Domain, chosen: ActiveLearningOptions, tracks: int | None) -> None:
    """Reject before the work what the training would reject after it.

    Raises:
        DataError: the change that ends the run or its confidence is out of range, there are too few tracks, a
            learner or the device is unknown, or a learner cannot learn from weighted cases.
        DomainError: trust cannot follow the dialogue of the domain.
    """
    from lcorpp.assembly.estimators import make_untrained
    from lcorpp.assembly.options import TrainingOptions
    from lcorpp.assembly.strategies.trust import TRUST, check_dialogue
    from lcorpp.learning.classifiers.learner_table import DEFAULTS
    from lcorpp.learning.classifiers.registry import check_weighted

    if chosen.epsilon is not None and math.isnan(chosen.epsilon):
        raise DataError("--epsilon nan: expected a number from 0")
    if not chosen.confidence < 1:
        raise DataError(f"--confidence {chosen.confidence:g}: expected a number from 0, below 1")
    if tracks is not None and 0 < tracks < MIN_TRACKS:
        raise DataError(f"--tracks {tracks}: expected 0, or at least {MIN_TRACKS}")
    if chosen.trust or chosen.watch:
        check_dialogue(domain, [TRUST])
    for training in chosen.classifiers.values():
        if isinstance(training, TrainingOptions):
            name = training.learner or DEFAULTS["motion"]
            if ":" not in name and training.device.split(":")[0] not in DEVICES:
                raise DataError(f"--device {training.device}: {expected_one_of(DEVICES)}")
            estimator = make_untrained(training)
            if chosen.labels != Labels.hard:
                check_weighted(name, estimator)


def _print_senses(domain: Domain, senses: LearningSenses) -> None:
    """Print the notes about the data, and which senses learn if there are several."""
    from lcorpp.cli.robot_output import print_classifier

    for data in senses.data.values():
        for text in data.dataset.notes:
            console.print_note(text)
    if len(domain.senses) == 1:
        return
    console.out.print(f"the reports label {', '.join(senses.data)}")
    for name, setup in senses.fixed.items():
        console.out.print(f"{name} stays as it is:")
        print_classifier(setup, name)
        for text in setup.notes:
            console.print_note(text)


def _print_run_store(run_store: RunStore) -> None:
    """Print the content of the stores, their notes and the batch after which the run resumes."""
    for store in run_store.stores.values():
        console.out.print(f"{store.path}: {store.snapshot().summary()}")
    for text in run_store.notes:
        console.print_note(text)
    if run_store.number is not None:
        count = len(run_store.pending)
        pending = f", {count} decisions of the next batch are stored" if count else ""
        console.out.print(f"resumes after batch {run_store.number}{pending}")
