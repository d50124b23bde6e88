"""`lcorpp run`: the paper's comparison of strategies on any domain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.groups import take_options
from lcorpp.cli.options.robot import RobotGroup
from lcorpp.cli.options.senses import reject_given
from lcorpp.cli.options.training import TracksOption
from lcorpp.errors import DomainError

if TYPE_CHECKING:
    from pathlib import Path

    from lcorpp.domains import Domain
    from lcorpp.experiments.comparison import Comparison, ComparisonOptions
    from lcorpp.planning import Policy

MAX_MISSED = 0.01
"""Probability of the decisions that exact scores leave out, above which a note recommends trials."""

TRIALS, SEARCHED_TRIALS = 5000, 200
"""Number of simulated people without --trials; of a generative model, as the robot searches at each step."""


@take_consent
@take_options
def run(
    given: RobotGroup,
    strategy: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help=f"{options.STRATEGIES}; repeatable.")
    ] = None,
    trials: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=options.MAX_TRIALS,
            help=f"Number of simulated people; by default {TRIALS}, {SEARCHED_TRIALS} for a simulated model.",
        ),
    ] = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="Enumerate people and answers instead of sampling (channel only).")
    ] = False,
    trial: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="NUMBER",
            help="Instead of scores, print this trial of the same command step by step; the first is 0.",
        ),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            metavar="DOMAIN",
            help="Simulate the people of this domain, its answers and rewards, e.g. to score a learnt one.",
        ),
    ] = None,
    tracks: TracksOption = None,
    ask_budget: options.AskBudgetOption = None,
) -> None:
    """Compare strategies on simulated people; by default the paper's.

    Trains or loads the classifier, solves the POMDP, simulates the strategies and prints their scores. L+P
    and, in simulated trials, LCORPP+trust are compared, too.
    Ctrl-C stops the solver, and the command continues with the best policy so far; during the trials Ctrl-C
    keeps the complete ones.
    """
    from lcorpp.cli.robot_output import note_storage_problems, print_domain
    from lcorpp.experiments.comparison import compare_strategies
    from lcorpp.logs.decision_log import DecisionLog

    if exact:
        _reject_sampling(given, trials)
        reject_given("people of another domain are sampled, not enumerated with --exact", truth=truth)
    loaded = given.load_domain()
    people = None if truth is None else options.load_domain(truth, None, None, None)
    number = trials or (TRIALS if loaded.planning.search is None else SEARCHED_TRIALS)
    if trial is not None:
        _check_trial(trial, number, given, exact=exact)
    chosen = _choose_comparison(
        loaded, given, strategy or [], None if exact else number, tracks, people, ask_budget=ask_budget
    )
    policy = given.read_policy(loaded)
    with output_files.lock_results(given.out, given.formats):
        if given.log is not None:
            DecisionLog(given.log).close()  # raises an error before the work
        print_domain(loaded)
        if trial is not None:
            _print_trial(loaded, chosen, trial, policy)
            return
        noted = given.out is not None and note_storage_problems(chosen.classifiers.values())
        comparison = compare_strategies(
            loaded, chosen, policy=policy, policy_file=given.policy, progress=console.show_progress
        )
        _print_comparison(loaded, comparison, chosen)
        if given.out is not None:
            _write_results(given.out, loaded, given, chosen, comparison, noted=noted)
        if comparison.trials is not None and comparison.trials < number:
            console.err.print(f"interrupted: {comparison.trials} of {number} trials are kept")


def _reject_sampling(given: RobotGroup, trials: int | None) -> None:
    """Reject options without effect on --exact."""
    reason = "--exact needs the probabilities of the answers, which a world of your own does not state"
    reject_given(f"{reason}; expected one of them", world=given.world)
    reject_given("nothing is sampled with --exact", trials=trials)
    reject_given("no single decisions are made with --exact", log=given.log)


def _check_trial(trial: int, trials: int, given: RobotGroup, *, exact: bool) -> None:
    """Reject a trial that the command does not have, and options without effect on --trial."""
    reason = "one trial is printed with --trial, nothing is scored"
    reject_given(reason, exact=exact or None, log=given.log, out=given.out, format=given.formats)
    if trial >= trials:
        raise DomainError(f"--trial {trial}: expected 0 to {trials - 1}, as there are {trials} trials")


def _choose_comparison(
    domain: Domain,
    given: RobotGroup,
    strategies: list[str],
    trials: int | None,
    tracks: int | None,
    people: Domain | None,
    *,
    ask_budget: float | None,
) -> ComparisonOptions:
    """Return the options of the comparison; without trials it is exact."""
    from lcorpp.assembly.strategies.baselines import find_strategies
    from lcorpp.assembly.strategies.limits import require_limits
    from lcorpp.assembly.strategies.trust import TRUST, check_dialogue, set_ask_budget
    from lcorpp.experiments.comparison import ComparisonOptions
    from lcorpp.planning import SolverOptions

    rows = find_strategies(strategies, [sense.name for sense in domain.all_senses])
    solver = given.solving.choose_solver(domain)
    if not strategies and trials is not None:
        try:
            check_dialogue(domain, [TRUST], solver if given.policy is None else SolverOptions())
            rows = (*rows, TRUST)
        except DomainError as error:
            console.print_note(f"{TRUST.name} is left out: {error}")
    require_limits(domain, rows)
    if ask_budget is not None:
        rows = set_ask_budget(rows, ask_budget)
    used = [sense for sense in domain.all_senses if any(row.uses(sense.name) for row in rows)]
    sources = given.choose_classifiers(domain, used, tracks, by_channel=trials is None or people is not None)
    if trials is None and any(sources.values()):
        raise DomainError(
            "--exact needs --classifier channel: the error rates of a trained classifier are known from"
            " trials only"
        )
    return ComparisonOptions(
        strategies=rows,
        classifiers=sources,
        evidence=given.choose_evidence(domain, sources),
        trials=trials,
        seed=given.seed,
        jobs=console.count_processes(given.jobs),
        solver=solver,
        cache=given.solving.find_cache(),
        log=given.log,
        people=people,
    )


def _print_comparison(domain: Domain, comparison: Comparison, chosen: ComparisonOptions) -> None:
    from lcorpp.cli.robot_output import (
        print_classifiers,
        print_limits,
        print_scores,
        print_search,
        print_solution,
    )

    print_scores(comparison.scores, domain.positive, comparison.trials)
    print_limits(domain, comparison)
    for name, reason in comparison.failures.items():
        console.warn(f"{name} has no exact scores: {reason}")
    if comparison.trials is None:
        _note_bounds(comparison)
    print_classifiers(domain, comparison.senses)
    if domain.planning.search is not None:
        print_search(domain)
    if comparison.solution is not None:
        solver = chosen.solver or domain.planning.solver
        print_solution(comparison.solution, comparison.gap, precision=solver.precision)


def _note_bounds(comparison: Comparison) -> None:
    """Name the strategies of which too few decisions are enumerated."""
    missed = {row.strategy: row.accuracy.high - row.accuracy.low for row in comparison.scores}
    wide = [f"{name} {share:.1%}" for name, share in missed.items() if share > MAX_MISSED]
    if wide:
        console.print_note(
            f"too many decisions are possible; not enumerated are {', '.join(wide)}: their bounds are wide;"
            " --trials estimates their scores"
        )


def _write_results(
    out: Path,
    domain: Domain,
    given: RobotGroup,
    chosen: ComparisonOptions,
    comparison: Comparison,
    *,
    noted: bool,
) -> None:
    """Write the files of a comparison. noted: whether a note says that a classifier cannot be saved."""
    from lcorpp.cli.robot_output import print_written
    from lcorpp.experiments.results import describe_run, write_comparison

    configuration = describe_run(domain, chosen, comparison, given.policy)
    written = write_comparison(out, comparison, configuration, formats=given.formats)
    print_written(written, noted=noted)


def _print_trial(domain: Domain, chosen: ComparisonOptions, number: int, policy: Policy | None) -> None:
    """Set up the comparison and print one of its trials."""
    from lcorpp.assembly.solving import explain_missing_reports
    from lcorpp.cli.explanation.trials import print_trial
    from lcorpp.cli.robot_output import print_classifiers, print_solution
    from lcorpp.experiments.comparison import set_up_experiment

    experiment, senses, solution = set_up_experiment(
        domain, chosen, policy=policy, progress=console.show_progress
    )
    print_classifiers(domain, senses)
    if solution is not None:
        print_solution(solution)
    assert chosen.trials is not None
    with explain_missing_reports(solution):
        print_trial(experiment, number, chosen.trials)
