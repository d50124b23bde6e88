"""`lcorpp explain`: one decision, step by step."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.explanation.cases import ask_case, describe_simulation, print_person
from lcorpp.cli.explanation.steps import decide_and_print
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.decision import Person, PersonGroup
from lcorpp.cli.options.groups import take_options
from lcorpp.cli.options.recordings import RecordingGroup
from lcorpp.cli.options.senses import ClassifierGroup
from lcorpp.cli.options.solving import SolverGroup
from lcorpp.cli.options.training import TracksOption, TrainingGroup
from lcorpp.errors import DecisionError, DomainError

if TYPE_CHECKING:
    from lcorpp.assembly.case import Case
    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.assembly.robot import DomainRobot
    from lcorpp.assembly.senses import Senses
    from lcorpp.decision import Strategy
    from lcorpp.domains import Domain, Sense
    from lcorpp.values import Episode, EvidenceKind


@take_consent
@take_options
def explain(
    *,
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    person: PersonGroup,
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
    reasoner: options.ReasonerOption = None,
    classifiers: ClassifierGroup,
    recording: RecordingGroup,
    tracks: TracksOption = None,
    training: TrainingGroup,
    jobs: options.JobsOption = None,
    log: options.LogOption = None,
    solving: SolverGroup,
) -> None:
    """Print one decision, step by step.

    The steps are label, evidence, posterior, prior, then every action with its observation and belief.
    The person is simulated; values that are not given are drawn. With --interactive you are the person.
    A classifier is a noisy channel, unless --learner, --classifier or --data asks for a trained one.
    Ctrl-C stops the solver; the command continues with the best policy so far.
    """
    from lcorpp.assembly.options import EvidenceOptions
    from lcorpp.assembly.robot import compose_robot, set_up_senses
    from lcorpp.cli.robot_output import (
        print_classifiers,
        print_domain,
        print_gap,
        print_search,
        print_solution,
    )
    from lcorpp.decision.dt_control import log_decision
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.planning.solver_table import ONLINE

    _check_world(person, world, interactive=interactive)
    loaded = options.load_domain(domain, preset, world, reasoner)
    row = _find_strategy(loaded, strategy)
    chosen, cache = solving.choose_solver(loaded), solving.find_cache()
    known = person.parse(loaded)
    used = _list_used_senses(loaded, row, known)
    sources = classifiers.choose_classifiers(
        loaded,
        used,
        reading=recording.choose_reading({}),
        training=training.choose(tracks),
        by_channel=True,
    )
    kinds, processes = classifiers.choose_evidence(loaded, sources), console.count_processes(jobs)
    _check_evidence(sources, kinds, known, interactive=interactive)
    if known.predicted and not interactive:
        used = _leave_out(used, sources, known)
    with nullcontext() if log is None else DecisionLog(log) as decisions:
        print_domain(loaded)
        senses = set_up_senses(
            loaded, used, sources, EvidenceOptions(kinds), console.show_progress, seed=seed, jobs=processes
        )
        print_classifiers(loaded, senses)
        given = {name: name in known.likelihoods for name in known.predicted}
        robot = compose_robot(
            loaded, senses, chosen, given=given, cache=cache, progress=console.show_progress
        )
        if robot.solution is None:
            print_search(loaded)
        else:
            print_solution(robot.solution)
        case = ask_case(loaded, used, known) if interactive else _draw_case(loaded, senses, known, seed)
        episode = _decide(loaded, robot, row, case, seed)
        by_policy = robot.solution is not None and chosen.name != ONLINE
        if row.plans and row.change is None and row.start is None and by_policy:
            assert robot.solution is not None
            print_gap(robot.solution, robot.solution.gap(episode.prior), chosen.precision, "this prior")
        log_decision(episode)
        if decisions is not None:
            simulated = describe_simulation(case)
            decisions.append(robot.parts, row, case.facts, episode, simulated, seed=(seed, 0), person=0)


def _check_world(person: PersonGroup, world: str | None, *, interactive: bool) -> None:
    """Reject two sources of the answers, and questions to a user who cannot reply.

    Raises:
        DecisionError: the input is closed. DomainError: options exclude each other.
    """
    if interactive and sys.stdin is None:
        raise DecisionError("--interactive needs an input to read your answers from; it is closed")
    if interactive and (person.truth is not None or person.answers is not None):
        raise DomainError("--truth and --answers describe a simulated person; --interactive has none")
    if world is not None and (interactive or person.answers is not None):
        other = "--interactive" if interactive else "--answers"
        raise DomainError(f"--world {world} and {other} both answer the robot; expected one")


def _find_strategy(domain: Domain, name: str | None) -> Strategy:
    from lcorpp.assembly.strategies.baselines import find_strategies
    from lcorpp.assembly.strategies.limits import require_limits
    from lcorpp.decision import LCORPP

    if name is None:
        return LCORPP
    (found,) = find_strategies([name], [sense.name for sense in domain.all_senses])
    require_limits(domain, [found])
    return found


def _list_used_senses(domain: Domain, strategy: Strategy, person: Person) -> list[Sense]:
    """Return the senses that the strategy uses.

    Raises:
        DomainError: an option gives the label of another sense.
    """
    used = [sense for sense in domain.all_senses if strategy.uses(sense.name)]
    for name in person.predicted.keys() - {sense.name for sense in used}:
        raise DomainError(
            f"the strategy {strategy.name} does not use the classifier {name}, whose label is given"
        )
    return used


def _leave_out(
    used: Sequence[Sense], sources: Mapping[str, ClassifierOptions], person: Person
) -> list[Sense]:
    """Leave out the senses without a label if another has one: the robot has not perceived them."""
    missing = [s.name for s in used if s.name not in person.predicted and sources[s.name] is None]
    if missing:
        console.print_note(f"left out, as no label is given: {', '.join(missing)}")
    return [sense for sense in used if sense.name not in missing]


def _check_evidence(
    sources: Mapping[str, ClassifierOptions],
    kinds: Mapping[str, EvidenceKind],
    person: Person,
    *,
    interactive: bool,
) -> None:
    """Reject two kinds of evidence of one sense.

    Raises:
        DomainError: a likelihood and a trained classifier, or a label and soft evidence.
    """
    for name in person.likelihoods:
        if sources[name] is not None:
            raise DomainError(
                f"--likelihood is the evidence of {name}, expected no --learner, --classifier, --data of it"
            )
    for name, kind in kinds.items():
        if interactive or name in person.predicted:
            has_label = name in person.predicted
            other = f"a label of {name} is given" if has_label else "--interactive asks for labels"
            raise DomainError(f"--evidence {kind}: {other}; expected the likelihood of a simulated person")


def _draw_case(domain: Domain, senses: Senses, person: Person, seed: int) -> Case:
    """Draw what the options do not give of a simulated person, and print the hidden part."""
    from lcorpp.assembly.case import draw_case
    from lcorpp.worlds import ScriptedWorld

    case = draw_case(domain, senses, person.facts, person.predicted, person.truth, seed=seed)
    print_person(domain, case.person or {})
    if person.answers is None:
        return case
    return case._replace(world=ScriptedWorld(person.answers, "--answers"))


def _decide(domain: Domain, robot: DomainRobot, strategy: Strategy, case: Case, seed: int) -> Episode:
    """Decide about a person by a strategy, and print each step."""
    from lcorpp.assembly.solving import explain_missing_reports
    from lcorpp.decision.strategies import make_generator

    with explain_missing_reports(robot.solution), strategy.locate_failures():
        own = strategy.robot(robot.robot, make_generator(seed, 0), rates=robot.parts.rates)
        labels = {name: label for name, label in case.predicted.items() if name in own.classifiers}
        return decide_and_print(domain, own, case.facts, labels, case.world, case.truth)
