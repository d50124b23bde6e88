"""`lcorpp run`: the paper's comparison of strategies on any domain."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options import common as options
from lcorpp.cli.options.recordings import (
    GapOption,
    LabelFileOption,
    LabelOption,
    RepairOption,
    RobotOption,
    parse_written_labels,
)
from lcorpp.cli.options.senses import (
    ClassifiersOption,
    DataOption,
    EvidenceOption,
    LearnersOption,
    choose_classifiers,
    choose_evidence,
    reject_given,
)
from lcorpp.errors import DomainError

if TYPE_CHECKING:
    from lcorpp.domains import Domain
    from lcorpp.experiments.comparison import ComparisonOptions
    from lcorpp.planning import Policy

TRIALS = 5000
"""Number of simulated people without --trials."""


def run(
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    strategy: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help=f"{options.STRATEGIES}; repeatable.")
    ] = None,
    world: options.WorldOption = None,
    trials: Annotated[
        int | None,
        typer.Option(min=1, max=options.MAX_TRIALS, help=f"Number of simulated people; {TRIALS} by default."),
    ] = None,
    seed: options.SeedOption = 0,
    classifier: ClassifiersOption = None,
    learner: LearnersOption = None,
    evidence: EvidenceOption = None,
    data: DataOption = None,
    label: LabelOption = None,
    label_file: LabelFileOption = None,
    repair: RepairOption = None,
    robot: RobotOption = None,
    gap: GapOption = None,
    tracks: options.TracksOption = None,
    epochs: options.EpochsOption = None,
    device: options.DeviceOption = "cpu",
    features: options.FeaturesOption = None,
    rate: options.RateOption = None,
    seconds: options.SecondsOption = None,
    smoothing: options.SmoothingOption = options.Smoothing.jeffreys,
    threshold: Annotated[
        str | None,
        typer.Option(
            help="Decision threshold of the positive class: a number, the metric to optimise (accuracy, f1,"
            " youden) or the costs MISS:ALARM; by default the most probable class is predicted."
        ),
    ] = None,
    prevalence: Annotated[
        float | None,
        typer.Option(
            min=1e-6,
            max=1 - 1e-6,
            help="Prevalence of the positive class, for thresholds; by default from the knowledge.",
        ),
    ] = None,
    policy: Annotated[
        Path | None, typer.Option(help="A policy for the domain's POMDP, instead of solving it.")
    ] = None,
    solver: options.SolverOption = None,
    precision: options.PrecisionOption = None,
    time_limit: options.TimeLimitOption = None,
    no_cache: options.NoCacheOption = False,
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
    log: options.LogOption = None,
    out: options.OutOption = None,
    formats: options.FormatOption = None,
    jobs: options.JobsOption = None,
) -> None:
    """Compare strategies on simulated people; by default the paper's.

    Trains or loads the classifier, solves the POMDP, simulates the strategies and prints their scores.
    Ctrl-C stops the solver, and the command continues with the best policy so far; during the trials Ctrl-C
    keeps the complete ones.
    """
    from lcorpp.cli.robot_output import (
        print_classifiers,
        print_domain,
        print_scores,
        print_solution,
        print_storage_problem,
    )
    from lcorpp.domains import load_domain, with_world
    from lcorpp.experiments.comparison import ComparisonOptions, compare_strategies
    from lcorpp.experiments.decision_log import DecisionLog
    from lcorpp.experiments.results import FORMATS, describe_run, write_comparison
    from lcorpp.experiments.setup import EvidenceOptions, ReadingOptions, TrainingOptions
    from lcorpp.experiments.strategies.baselines import find_strategies
    from lcorpp.planning.policy_cache import find_cache_folder
    from lcorpp.values import JEFFREYS, LAPLACE

    if exact:
        reason = "--exact needs the probabilities of the answers, which a world of your own does not state"
        reject_given(f"{reason}; expected one of them", world=world)
    loaded = load_domain(domain, preset=preset)
    if world is not None:
        loaded = with_world(loaded, world)
    laplace = smoothing is options.Smoothing.laplace
    rows = find_strategies(strategy or [], [sense.name for sense in loaded.senses])
    used = [sense for sense in loaded.senses if any(row.uses(sense.name) for row in rows)]
    training = options.choose_training(
        tracks=tracks,
        epochs=epochs,
        device=device,
        features=features,
        rate=rate,
        seconds=seconds,
        threshold=threshold,
        prevalence=prevalence,
    )
    reading = ReadingOptions(parse_written_labels(label), label_file, tuple(repair or ()), robot, gap)
    sources = choose_classifiers(
        loaded,
        used,
        classifiers=classifier or [],
        learners=learner or [],
        data=data or [],
        reading=reading,
        training=training,
    )
    if policy is not None:
        limits = {"precision": precision, "time-limit": time_limit}
        reject_given("nothing is solved, as --policy gives a policy", solver=solver, **limits)
    if exact:
        reject_given("nothing is sampled with --exact", trials=trials)
        reject_given("no single decisions are made with --exact", log=log)
    kinds = choose_evidence(loaded, sources, evidence or [])
    trained = [name for name, source in sources.items() if source is not None]
    only_soft = bool(trained) and set(trained) <= set(kinds)
    _check_combination(not trained, exact=exact, soft=only_soft, laplace=laplace, threshold=threshold)
    number = TRIALS if trials is None else trials
    if trial is not None:
        reason = "one trial is printed with --trial, nothing is scored"
        reject_given(reason, exact=exact or None, log=log, out=out, format=formats)
        if trial >= number:
            raise DomainError(f"--trial {trial}: expected 0 to {number - 1}, as there are {number} trials")
    chosen = ComparisonOptions(
        strategies=rows,
        classifiers=sources,
        evidence=EvidenceOptions(kinds, LAPLACE if laplace else JEFFREYS),
        trials=None if exact else number,
        seed=seed,
        jobs=console.count_processes(jobs),
        solver=options.choose_solver(loaded.planning.solver, solver, precision, time_limit),
        cache=None if no_cache else find_cache_folder(),
        log=log,
    )
    output_files.check_results(out, formats)
    if log is not None:
        DecisionLog(log).close()  # raises an error before the work
    print_domain(loaded)
    announced = False
    for source in sources.values():
        if out is not None and isinstance(source, TrainingOptions):
            announced |= print_storage_problem(source) is not None
    given_policy = None
    if policy is not None:
        from lcorpp.cli.model_files import read_policy

        given_policy = read_policy(policy, loaded.pomdp)
    if trial is not None:
        _print_trial(loaded, chosen, trial, given_policy)
        return
    comparison = compare_strategies(
        loaded, chosen, policy=given_policy, policy_file=policy, progress=console.show_progress
    )
    print_scores(comparison.scores, loaded.positive, comparison.trials)
    print_classifiers(loaded, comparison.senses)
    if comparison.solution is not None:
        print_solution(comparison.solution)
    if out is not None:
        configuration = describe_run(loaded, chosen, comparison, policy)
        written = write_comparison(out, comparison, configuration, formats=formats or FORMATS)
        if written.problem is not None and not announced:
            console.print_note(f"the classifier is not saved: {written.problem}")
        console.out.print("wrote " + ", ".join(str(path) for path in written.paths))
    if comparison.trials is not None and comparison.trials < number:
        console.err.print(f"interrupted: {comparison.trials} of {number} trials are kept")


def _print_trial(domain: Domain, chosen: ComparisonOptions, number: int, policy: Policy | None) -> None:
    """Set up the comparison and print one of its trials."""
    from lcorpp.cli.explanation.trials import print_trial
    from lcorpp.cli.robot_output import print_classifiers, print_solution
    from lcorpp.experiments.comparison import set_up_experiment
    from lcorpp.experiments.setup import explain_missing_reports

    experiment, senses, solution = set_up_experiment(
        domain, chosen, policy=policy, progress=console.show_progress
    )
    print_classifiers(domain, senses)
    if solution is not None:
        print_solution(solution)
    assert chosen.trials is not None
    with explain_missing_reports(solution):
        print_trial(experiment, number, chosen.trials)


def _check_combination(
    channels_only: bool, *, exact: bool, soft: bool, laplace: bool, threshold: str | None
) -> None:
    """Reject options that exclude each other."""
    if exact and not channels_only:
        raise DomainError(
            "--exact needs --classifier channel: the error rates of a trained classifier are known from"
            " trials only"
        )
    if soft and threshold is not None:
        raise DomainError("--threshold determines labels; evidence by likelihoods or sets uses none")
    if laplace and (soft or channels_only):
        raise DomainError("--smoothing applies to the labels of a trained classifier only")
