"""`lcorpp explain`: one decision, step by step."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping
from contextlib import nullcontext
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.explanation.cases import ask_case, describe_simulation, print_person
from lcorpp.cli.explanation.steps import decide_and_print
from lcorpp.cli.options import common as options, decision
from lcorpp.cli.options.groups import take_options
from lcorpp.cli.options.recordings import RecordingOptions
from lcorpp.cli.options.senses import (
    ClassifiersOption,
    DataOption,
    EvidenceOption,
    LearnersOption,
    choose_classifiers,
    choose_evidence,
)
from lcorpp.errors import DecisionError, DomainError

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.values import EvidenceKind, Label


NO_RECORDING = RecordingOptions()


@take_options
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
    recording: RecordingOptions = NO_RECORDING,
    tracks: options.TracksOption = None,
    epochs: options.EpochsOption = None,
    device: options.DeviceOption = "cpu",
    features: options.FeaturesOption = None,
    rate: options.RateOption = None,
    seconds: options.SecondsOption = None,
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
    from lcorpp.assembly.case import draw_case
    from lcorpp.assembly.options import EvidenceOptions
    from lcorpp.assembly.robot import compose_robot, set_up_senses
    from lcorpp.assembly.solving import explain_missing_reports
    from lcorpp.assembly.strategies.baselines import find_strategies
    from lcorpp.cli.robot_output import print_classifiers, print_domain, print_gap, print_solution
    from lcorpp.decision import LCORPP
    from lcorpp.decision.dt_control import log_decision
    from lcorpp.decision.strategies import make_generator
    from lcorpp.domains import load_domain, with_world
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.planning.policy_cache import find_cache_folder
    from lcorpp.worlds import ScriptedWorld

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
    row = LCORPP
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
        reading=recording.choose_reading({}),
        training=options.choose_training(
            tracks=tracks, epochs=epochs, device=device, features=features, rate=rate, seconds=seconds
        ),
        by_channel=True,
    )
    kinds, processes = choose_evidence(loaded, sources, evidence or []), console.count_processes(jobs)
    _check_evidence(sources, kinds, labels, likelihoods, interactive=interactive)
    with nullcontext() if log is None else DecisionLog(log) as decisions:
        print_domain(loaded)
        senses = set_up_senses(
            loaded, used, sources, EvidenceOptions(kinds), console.show_progress, seed=seed, jobs=processes
        )
        print_classifiers(loaded, senses)
        robot = compose_robot(
            loaded,
            senses,
            chosen,
            given={name: name in likelihoods for name in predicted},
            cache=cache,
            progress=console.show_progress,
        )
        parts, solution = robot.parts, robot.solution
        assert solution is not None
        print_solution(solution)
        if interactive:
            case = ask_case(loaded, used, facts, predicted)
        else:
            case = draw_case(loaded, senses, facts, predicted, value, seed=seed)
            if script is not None:
                case = case._replace(world=ScriptedWorld(script, "--answers"))
            print_person(loaded, case.person or {})
        with explain_missing_reports(solution), row.locate_failures():
            own = row.robot(robot.robot, make_generator(seed, 0), rates=parts.rates)
            known = {name: label for name, label in case.predicted.items() if name in own.classifiers}
            episode = decide_and_print(loaded, own, case.facts, known, case.world, case.truth)
        if row.plans and row.change is None and row.start is None:
            print_gap(solution, solution.gap(episode.prior), chosen.precision, "this prior")
        log_decision(episode)
        if decisions is not None:
            simulated = describe_simulation(case)
            decisions.append(parts, row, case.facts, episode, simulated, seed=(seed, 0), person=0)


def _check_evidence(
    sources: Mapping[str, ClassifierOptions],
    kinds: Mapping[str, EvidenceKind],
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
    for name, kind in kinds.items():
        if interactive or name in labels:
            other = f"a label of {name} is given" if name in labels else "--interactive asks for labels"
            raise DomainError(f"--evidence {kind}: {other}; expected the likelihood of a simulated person")
