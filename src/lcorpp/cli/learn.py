"""`lcorpp learn`: Algorithm 1, active learning from the robot's own reports."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.groups import take_options
from lcorpp.cli.options.learning import LearningGroup
from lcorpp.cli.options.robot import RobotGroup

if TYPE_CHECKING:
    from lcorpp.assembly.robot_parts import RobotParts
    from lcorpp.domains import Domain
    from lcorpp.experiments.result_folder import WrittenFiles
    from lcorpp.planning import Policy, Solution, SolverOptions
    from lcorpp.runs.batches import BatchResult
    from lcorpp.runs.run_store import RunStore
    from lcorpp.runs.senses import ActiveLearningOptions, LearningSenses
    from lcorpp.trust import Finding


@take_consent
@take_options
def learn(given: RobotGroup, learning: LearningGroup) -> None:
    """Run Algorithm 1: decide, store the reports, retrain.

    The senses whose class a report names are retrained after each batch; the others stay as they are.
    Each batch is written to --out when it is complete; Ctrl-C keeps the complete batches. Ctrl-C in the
    solver stops only the solver; the command continues with the best policy so far. With --store every
    decision survives any interruption, and the same command resumes the run.
    """
    from lcorpp.assembly.solving import explain_missing_reports
    from lcorpp.cli.robot_output import note_storage_problems, print_domain
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.runs.run import open_run_store, run_active_learning
    from lcorpp.runs.senses import set_up_learning

    loaded = given.load_domain()
    chosen = learning.choose_options(loaded, given)
    policy, solving = given.read_policy(loaded), given.solving.choose_solver(loaded)
    store = learning.store
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
            parts, outcome.solution = _make_parts(loaded, policy, given, solving)
            stack.enter_context(explain_missing_reports(outcome.solution))
            results = run_active_learning(
                loaded,
                senses,
                parts.make_planner(),
                chosen,
                run_store=run_store,
                log=log,
                parts=parts,
                on_alarm=partial(_print_alarm, loaded),
                progress=console.show_progress,
            )
            for result in _print_batches(results, chosen, run_store):
                outcome.add(result, trust=chosen.learns_from_people)
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
        """Write all batches so far; formats: as of `write_batches`."""
        from lcorpp.experiments.batch_results import write_batches

        self.written = write_batches(folder, domain, result, solution=self.solution, formats=formats)


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


def _make_parts(
    domain: Domain, policy: Policy | None, given: RobotGroup, solver: SolverOptions
) -> tuple[RobotParts, Solution | None]:
    """Return the domain with a given policy, or solve the POMDP and print how well."""
    from lcorpp.assembly.robot_parts import RobotParts
    from lcorpp.assembly.solving import solve_domain
    from lcorpp.cli.robot_output import print_search, print_solution

    if policy is not None:
        return RobotParts(domain, policy, policy_file=given.policy), None
    if domain.planning.search is not None:
        print_search(domain)
        return RobotParts(domain, None), None
    with console.show_progress("solving the POMDP") as advance:
        cache = given.solving.find_cache()
        solution = solve_domain(domain, solver, any_prior=True, cache=cache, advance=advance)
    print_solution(solution)
    return RobotParts(domain, solution.policy, solver=solver), solution


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
