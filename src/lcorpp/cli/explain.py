"""`lcorpp explain`: one decision, step by step."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext, suppress
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from lcorpp.cli import console
from lcorpp.cli.options import common as options, decision
from lcorpp.errors import DecisionError, DomainError, NoValueError

if TYPE_CHECKING:
    from lcorpp.decision import Robot
    from lcorpp.domains import Domain, Sense
    from lcorpp.protocols import World
    from lcorpp.values import Episode, Label, SharedValue, Step


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
    log: options.LogOption = None,
    solver: options.SolverOption = None,
    precision: options.PrecisionOption = None,
    time_limit: options.TimeLimitOption = None,
    no_cache: options.NoCacheOption = False,
) -> None:
    """Print one decision, step by step.

    The steps are label, evidence, posterior, prior, then every action with its observation and belief.
    The person is simulated; values that are not given are drawn. With --interactive you are the person.
    Ctrl-C stops the solver; the command continues with the best policy so far.
    """
    from lcorpp.cli.robot_output import print_classifier, print_domain, print_solution
    from lcorpp.decision import STRATEGIES
    from lcorpp.decision.dt_control import log_decision
    from lcorpp.domains import load_domain, with_world
    from lcorpp.experiments.decision_log import DecisionLog
    from lcorpp.experiments.robot_parts import ClassifierPart, RobotParts
    from lcorpp.experiments.scoring.trials import make_generator
    from lcorpp.experiments.setup import explain_missing_reports, from_channel, make_robot, solve_domain
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
    senses = {sense.name: from_channel(loaded, sense) for sense in used}
    with nullcontext() if log is None else DecisionLog(log) as decisions:
        print_domain(loaded)
        for name, setup in senses.items():
            print_classifier(setup, name if len(senses) > 1 else "")
        with console.show_progress("solving the POMDP") as advance:
            solution = solve_domain(loaded, chosen, cache=cache, advance=advance)
        print_solution(solution)
        program = loaded.soft_program(likelihoods)
        robot = make_robot(loaded, senses, program, Planner(solution))
        if interactive:
            case = _ask_case(loaded, used, facts, predicted)
        else:
            case = _simulate_case(loaded, used, facts, predicted, value, script, seed)
        with explain_missing_reports(solution), row.locate_failures():
            episode = _decide_and_print(loaded, row.robot(robot, make_generator(seed, 0)), case)
        log_decision(episode)
        if decisions is not None:
            classifiers = {
                name: ClassifierPart("given", soft=name in likelihoods)
                if name in predicted
                else ClassifierPart.of("channel", setup.classifier)
                for name, setup in senses.items()
            }
            parts = RobotParts(loaded, solution.policy, classifiers, solver=chosen)
            known = _describe_simulation(case)
            decisions.append(parts, row, case.facts, episode, known, seed=(seed, 0))


class _Case(NamedTuple):
    """One person to decide about.

    facts: observed attribute -> value. predicted: sense -> its output, a class or a likelihood.
    world: answers the robot's actions. truth: the true shared value, None if it is unknown.
    person: all that a simulation knows of the person, None without one.
    """

    facts: Mapping[str, str]
    predicted: Mapping[str, Label]
    world: World
    truth: SharedValue | None
    person: Mapping[str, str] | None


def _ask_case(
    domain: Domain, senses: Sequence[Sense], facts: Mapping[str, str], predicted: Mapping[str, Label]
) -> _Case:
    """Ask the user, who is the person, for the facts and the labels that no option gives."""
    from lcorpp.worlds import ConsoleWorld, choose

    complete = dict(facts)
    for name in domain.observed:
        if name not in complete:
            values = domain.program.attributes[name].values
            complete[name] = choose(values, f"What is the {name}?", show=console.out.print)
    labels = dict(predicted)
    for sense in senses:
        if sense.name not in labels:
            class_of = {label: name for name, label in sense.label_of.items()}
            question = f"What is the classifier's label ({sense.attribute})?"
            labels[sense.name] = class_of[choose(tuple(class_of), question, show=console.out.print)]
    return _Case(
        complete, labels, ConsoleWorld(domain.pomdp.observations, show=console.out.print), None, None
    )


def _simulate_case(
    domain: Domain,
    senses: Sequence[Sense],
    facts: Mapping[str, str],
    predicted: Mapping[str, Label],
    truth: SharedValue | None,
    answers: Sequence[str] | None,
    seed: int,
) -> _Case:
    """Draw what is None, and the facts and labels that are not given; print what the robot cannot observe."""
    import numpy as np

    from lcorpp.simulation import NoisyChannel, Population, SimulationModel

    rng = np.random.default_rng([seed, 0])
    given = facts if truth is None else {**facts, **domain.reasoning.split(truth)}
    person = Population(domain).sample(1, rng, given)[0]
    labels = dict(predicted)
    for sense in domain.senses:
        if sense.name not in labels:
            channel = NoisyChannel.from_domain(domain, sense)
            labels[sense.name] = channel.classify_many(channel.simulate([person], rng))[0]
    world = SimulationModel(domain).make_world(person, rng) if answers is None else ScriptedWorld(answers)
    observable = (*domain.observed, *[sense.attribute for sense in domain.senses])
    hidden = ", ".join(f"{name}={value}" for name, value in person.items() if name not in observable)
    console.out.print(f"a simulated person; hidden from the robot: {hidden}", style="dim")
    context = {name: person[name] for name in domain.observed}
    known = {sense.name: labels[sense.name] for sense in senses}
    return _Case(context, known, world, domain.reasoning.join(person), person)


def _describe_simulation(case: _Case) -> dict[str, object] | None:
    """Return what only the simulation knows, for the log; prepared answers have no cost and no return."""
    from lcorpp.simulation import SimulatedWorld

    if case.person is None:
        return None
    known: dict[str, object] = {"truth": dict(case.person)}
    if isinstance(case.world, SimulatedWorld):
        known |= {"cost": case.world.cost, "return": case.world.return_}
    return known


def _decide_and_print(domain: Domain, robot: Robot, case: _Case) -> Episode:
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


class ScriptedWorld:
    """A world whose person gives prepared answers (`lcorpp.protocols.World`)."""

    def __init__(self, answers: Sequence[str]) -> None:
        self._count, self._rest = len(answers), iter(answers)

    def act(self, action: str) -> str:
        answer = next(self._rest, None)
        if answer is None:
            raise DecisionError(
                f"--answers has {self._count} answers, and the robot needs another one, to {action}"
            )
        return answer

    def report(self, action: str) -> None:
        pass


def _print_bars(pairs: Iterable[tuple[str, float]], *, possible: bool = False) -> None:
    """Print names with their probabilities; `possible`: only those of positive probability."""
    shown = list(pairs)
    width = max(len(name) for name, _ in shown)
    for name, probability in shown:
        if probability > 0 or not possible:
            console.print_probability(name, probability, width)
