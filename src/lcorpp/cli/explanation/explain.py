"""`lcorpp explain`: one decision, step by step."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Collection, Iterable, Mapping
from contextlib import nullcontext, suppress
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.explanation.cases import Case, ask_case, describe_simulation, simulate_case
from lcorpp.cli.options import common as options, decision
from lcorpp.cli.options.recordings import (
    GapOption,
    LabelFileOption,
    RepairOption,
    RobotOption,
)
from lcorpp.cli.options.senses import (
    ClassifiersOption,
    DataOption,
    EvidenceOption,
    LearnersOption,
    choose_classifiers,
    choose_soft_senses,
)
from lcorpp.errors import DecisionError, DomainError, NoValueError

if TYPE_CHECKING:
    from lcorpp.decision import Robot
    from lcorpp.domains import Domain
    from lcorpp.experiments.setup import ClassifierOptions
    from lcorpp.values import Episode, Label, Step


def explain(
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    fact: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="An observed fact; repeatable.")
    ] = None,
    label: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[SENSE=]VALUE",
            help="The classifier's label: a value of the attribute that it feeds; one for each sense.",
        ),
    ] = None,
    likelihood: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[SENSE:]VALUE=NUMBER",
            help="Soft evidence instead of a label: the likelihood of a value, by default 1; repeatable.",
        ),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE,...",
            help="The person's true value, one for each shared variable; by default it is drawn.",
        ),
    ] = None,
    answers: Annotated[
        str | None,
        typer.Option(metavar="A,B,...", help="The person's answers in order; by default they are drawn."),
    ] = None,
    seed: options.SeedOption = 0,
    interactive: Annotated[
        bool, typer.Option("--interactive", help="You are the person: type the facts and answers.")
    ] = False,
    strategy: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help=f"{options.STRATEGIES}. By default all parts decide, as in LCORPP."
        ),
    ] = None,
    world: options.WorldOption = None,
    classifier: ClassifiersOption = None,
    learner: LearnersOption = None,
    evidence: EvidenceOption = None,
    data: DataOption = None,
    label_file: LabelFileOption = None,
    repair: RepairOption = None,
    robot: RobotOption = None,
    gap: GapOption = None,
    tracks: options.TracksOption = None,
    epochs: options.EpochsOption = None,
    device: options.DeviceOption = "cpu",
    features: options.FeaturesOption = "x,y",
    jobs: options.JobsOption = None,
    log: options.LogOption = None,
    solver: options.SolverOption = None,
    precision: options.PrecisionOption = None,
    time_limit: options.TimeLimitOption = None,
    no_cache: options.NoCacheOption = False,
) -> None:
    """Print one decision, step by step.

    The steps are label, evidence, posterior, prior, then every action with its observation and belief.
    The person is simulated; values that are not given are drawn. With --interactive you are the person.
    A classifier is a noisy channel, unless --learner, --classifier or --data asks for a trained one.
    Ctrl-C stops the solver; the command continues with the best policy so far.
    """
    from lcorpp.cli.robot_output import print_classifier, print_domain, print_solution
    from lcorpp.decision import STRATEGIES
    from lcorpp.decision.dt_control import log_decision
    from lcorpp.domains import load_domain, with_world
    from lcorpp.experiments.comparison import ComparisonOptions, describe_classifiers, set_up_senses
    from lcorpp.experiments.decision_log import DecisionLog
    from lcorpp.experiments.robot_parts import RobotParts
    from lcorpp.experiments.scoring.trial_chunks import make_generator
    from lcorpp.experiments.setup import (
        EvidenceOptions,
        ReadingOptions,
        explain_missing_reports,
        make_robot,
        solve_domain,
    )
    from lcorpp.experiments.strategies.baselines import find_strategies
    from lcorpp.planning import Planner
    from lcorpp.planning.policy_cache import find_cache_folder

    if interactive and sys.stdin is None:
        raise DecisionError("--interactive needs an input to read your answers from; it is closed")
    if interactive and (truth is not None or answers is not None):
        raise DomainError("--truth and --answers describe a simulated person; --interactive has none")
    if world is not None and (interactive or answers is not None):
        other = "--interactive" if interactive else "--answers"
        raise DomainError(f"--world {world} and {other} both answer the robot; expected one")
    loaded = load_domain(domain, preset=preset)
    if world is not None:
        loaded = with_world(loaded, world)
    row = STRATEGIES[-1]
    if strategy is not None:
        (row,) = find_strategies([strategy], [sense.name for sense in loaded.senses])
    chosen = options.choose_solver(loaded.planning.solver, solver, precision, time_limit)
    cache = None if no_cache else find_cache_folder()
    facts = decision.parse_facts(loaded, fact or [])
    value = None if truth is None else decision.parse_truth(loaded, truth)
    script = None if answers is None else decision.parse_answers(loaded, answers)
    labels = decision.parse_labels(loaded, label or [])
    likelihoods = decision.parse_likelihoods(loaded, likelihood or [])
    for sense in labels.keys() & likelihoods.keys():
        raise DomainError(
            f"--label and --likelihood are both evidence of the classifier {sense}; expected one"
        )
    predicted: dict[str, Label] = {**labels, **likelihoods}
    used = [sense for sense in loaded.senses if row.uses(sense.name)]
    for name in predicted.keys() - {sense.name for sense in used}:
        raise DomainError(f"the strategy {row.name} does not use the classifier {name}, whose label is given")
    sources = choose_classifiers(
        loaded,
        used,
        classifiers=classifier or [],
        learners=learner or [],
        data=data or [],
        reading=ReadingOptions({}, label_file, tuple(repair or ()), robot, gap),
        training=options.choose_training(tracks=tracks, epochs=epochs, device=device, features=features),
        by_channel=True,
    )
    soft = choose_soft_senses(loaded, sources, evidence or [])
    _check_evidence(sources, soft, labels, likelihoods, interactive=interactive)
    ready = ComparisonOptions(
        (row,), sources, EvidenceOptions(soft), seed=seed, jobs=console.count_processes(jobs)
    )
    with nullcontext() if log is None else DecisionLog(log) as decisions:
        print_domain(loaded)
        senses = set_up_senses(loaded, used, ready, console.show_progress)
        for name, setup in senses.items():
            print_classifier(setup, name if len(senses) > 1 else "")
            for text in setup.notes:
                console.print_note(text)
        with console.show_progress("solving the POMDP") as advance:
            solution = solve_domain(loaded, chosen, cache=cache, advance=advance)
        print_solution(solution)
        parts = RobotParts(loaded, solution.policy, describe_classifiers(senses), solver=chosen)
        given = {
            name: replace(parts.classifiers[name], source="given", fingerprint="", soft=name in likelihoods)
            for name in predicted
        }
        parts = replace(parts, classifiers={**parts.classifiers, **given})
        full_robot = make_robot(loaded, senses, parts.program, Planner(solution))
        if interactive:
            case = ask_case(loaded, used, facts, predicted)
        else:
            case = simulate_case(loaded, senses, facts, predicted, value, script, seed)
        with explain_missing_reports(solution), row.locate_failures():
            episode = _decide_and_print(loaded, row.robot(full_robot, make_generator(seed, 0)), case)
        log_decision(episode)
        if decisions is not None:
            known = describe_simulation(case)
            decisions.append(parts, row, case.facts, episode, known, seed=(seed, 0))


def _check_evidence(
    sources: Mapping[str, ClassifierOptions],
    soft: Collection[str],
    labels: Collection[str],
    likelihoods: Collection[str],
    *,
    interactive: bool,
) -> None:
    """Reject two kinds of evidence of one sense.

    Raises:
        DomainError: a likelihood and a trained classifier, or a label and soft evidence.
    """
    for name in likelihoods:
        if sources[name] is not None:
            raise DomainError(
                f"--likelihood is the evidence of {name}, expected no --learner, --classifier, --data of it"
            )
    for name in soft:
        if interactive or name in labels:
            other = f"a label of {name} is given" if name in labels else "--interactive asks for labels"
            raise DomainError(f"--evidence soft: {other}; expected the likelihood of a simulated person")


def _decide_and_print(domain: Domain, robot: Robot, case: Case) -> Episode:
    """Run Algorithm 2 and print each of its steps."""
    from lcorpp.decision.dt_control import act_until_report, infer_prior
    from lcorpp.decision.strategies import LabelOnlyReasoner
    from lcorpp.values import Episode, format_value

    labels = {name: label for name, label in case.predicted.items() if name in robot.classifiers}
    began = perf_counter()
    evidence, marginal, prior = infer_prior(robot, case.facts, labels)
    seconds = {"reason": perf_counter() - began}
    for name, predicted in labels.items():
        owner = f"{name}'s classifier's" if len(labels) > 1 else "the classifier's"
        if isinstance(predicted, str):
            attribute = domain.find_sense(name).attribute
            console.print_heading(1, "learning", f"{owner} label")
            console.out.print(f"     {predicted} ({attribute} = {evidence[attribute]})")
        else:
            console.print_heading(1, "learning", f"{owner} likelihood, scaled to a maximum of 1")
            _print_bars(predicted)
    subtitle = "given " + ", ".join(f"{name} = {value}" for name, value in evidence.items())
    console.print_heading(2, "reasoning", subtitle)
    hidden = [
        name
        for name, attribute in domain.program.attributes.items()
        if not attribute.arguments and name not in evidence and name != domain.shared
    ]
    if isinstance(robot.reasoner, LabelOnlyReasoner):
        hidden = []
    answers = {}
    for name in hidden:
        with suppress(NoValueError):  # an attribute that may have no value has no distribution
            answers[name] = robot.reasoner.posterior(name, evidence)
    for title, answer in (*answers.items(), (", ".join(domain.reasoning.shared), marginal)):
        if answer is not None:
            console.out.print(f"   {title}")
            _print_bars([(format_value(value), p) for value, p in answer], possible=answer is marginal)
    console.print_heading(3, "planning", "the prior belief")
    states = domain.pomdp.states
    _print_bars(zip(states, prior.tolist(), strict=True), possible=True)
    numbers = itertools.count(4)

    def print_step(step: Step) -> None:
        if step.observation is None:
            console.print_heading(next(numbers), step.action, "the decision")
            return
        console.print_heading(next(numbers), step.action, f"observes {step.observation}")
        _print_bars(zip(states, step.belief.tolist(), strict=True), possible=True)

    steps, report, plan_seconds = act_until_report(robot, prior, case.world, listener=print_step)
    verdict = " (correct)" if case.truth == report else f" (wrong: {format_value(case.truth or '')})"
    console.out.print()
    shared = ", ".join(domain.reasoning.shared)
    console.out.print(
        f"{shared} = {format_value(report or '')}{'' if case.truth is None else verdict}", style="bold"
    )
    seconds["plan"] = plan_seconds
    return Episode(labels, evidence, marginal, prior, steps, report, seconds)


def _print_bars(pairs: Iterable[tuple[str, float]], *, possible: bool = False) -> None:
    """Print names with their probabilities; `possible`: only those of positive probability."""
    shown = list(pairs)
    width = max(len(name) for name, _ in shown)
    for name, probability in shown:
        if probability > 0 or not possible:
            console.print_probability(name, probability, width)
