"""`lcorpp robot`: decide about people on a robot that runs ROS."""

from __future__ import annotations

import signal
import warnings
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.senses import reject_given
from lcorpp.cli.options.solving import NoCacheOption, find_cache
from lcorpp.errors import FileError
from lcorpp.values import format_value

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.assembly.robot_parts import RobotParts
    from lcorpp.assembly.strategies.session_file import SessionFile
    from lcorpp.decision import Strategy
    from lcorpp.decision.strategies import Session
    from lcorpp.domains import Domain
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.robot.config import RobotConfig
    from lcorpp.robot.deciding import Decision
    from lcorpp.values import Step

CONFIG = Path("robot.toml")


@take_consent
def robot(
    config: Annotated[
        Path, typer.Option(metavar="FILE", help="Topics, actions, frames and time-outs of the robot.")
    ] = CONFIG,
    decisions: Annotated[
        int | None, typer.Option(min=1, help="End after N decisions; by default at Ctrl-C.")
    ] = None,
    pose: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="X Y HEADING",
            help="Where the robot is, in metres and radians of the fixed frame: sent to its localisation. By"
            " default `initial_pose` of the file.",
        ),
    ] = None,
    bag: Annotated[
        Path | None,
        typer.Option(
            metavar="BAG",
            help="Decide about the people in a bag instead, without a robot: for models whose only action"
            " is to watch.",
        ),
    ] = None,
    state: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="What the strategy has learnt from people, e.g. LCORPP+trust: read at the start if the file"
            " exists, written after each decision.",
        ),
    ] = None,
    ask_budget: options.AskBudgetOption = None,
    log: options.LogOption = None,
    seed: options.SeedOption = 0,
    jobs: options.JobsOption = None,
    no_cache: NoCacheOption = False,
) -> None:
    """Decide about the people around a robot that runs ROS.

    `lcorpp check robot.toml` checks the configuration without a robot. After a failed action, a lost
    connection or Ctrl-C the robot is ordered to stop.
    """
    from lcorpp.assembly.strategies.baselines import find_strategies
    from lcorpp.assembly.strategies.session_file import SessionFile
    from lcorpp.assembly.strategies.trust import check_dialogue, with_ask_budget
    from lcorpp.assembly.track_robot import set_up_track_robot
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.robot.connecting import connect
    from lcorpp.robot.loop import RobotLoop
    from lcorpp.robot.reading import read_robot_config

    read, domain = read_robot_config(config, initial_pose=pose)
    (strategy,) = find_strategies([read.strategy], [sense.name for sense in domain.senses])
    check_dialogue(domain, [strategy])
    if ask_budget is not None:
        strategy = with_ask_budget(strategy, ask_budget)
    if bag is not None:
        reject_given("is for a running robot; --bag has none", pose=pose, state=state)
        _decide_about_bag(
            read,
            domain,
            strategy,
            bag,
            decisions=decisions,
            log=log,
            cache=find_cache(no_cache=no_cache),
            seed=seed,
            jobs=jobs,
        )
        return
    session_file = None if state is None else SessionFile(state, domain, strategy)
    with ExitStack() as stack:
        stack.callback(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT))
        is_new_log = log is not None and not log.exists()
        kept = None if log is None else stack.enter_context(DecisionLog(log))
        connection = connect(read.connection)
        stack.callback(connection.close)
        parts, classifiers = set_up_track_robot(
            domain,
            choose_robot_classifiers(read, domain),
            domain.planning.solver,
            cache=find_cache(no_cache=no_cache),
            progress=console.show_progress,
            seed=seed,
            jobs=console.count_processes(jobs),
        )
        strategy = _plan_limits(strategy, parts)
        loop = RobotLoop(read, parts, classifiers, strategy, connection, show_step=_print_step, seed=seed)
        if session_file is not None and (session := loop.session) is not None:
            session_file.restore(session)
            if n := session.n_people:
                console.print_note(f"{state}: learnt from {n} {'person' if n == 1 else 'people'}")
                if is_new_log:
                    console.print_note(
                        f"{log} begins after them, so `lcorpp replay` cannot repeat its decisions"
                    )
        console.out.print(
            f"{domain.name} by {strategy.name} on {read.connection.kind} (ROS {connection.version});"
            " Ctrl-C ends it"
        )
        stack.callback(setattr, warnings, "showwarning", warnings.showwarning)
        warnings.showwarning = lambda message, *_, **__: console.warn(str(message))
        # the end of a service or of a terminal: as Ctrl-C; Windows has no SIGHUP
        for number in {signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}:
            stack.callback(signal.signal, number, signal.signal(number, signal.default_int_handler))
        count = 0
        try:
            for decision in loop.run(decisions):
                count += 1
                _print_decision(decision)
                _log_decision(kept, parts, strategy, decision)
                if session_file is not None and loop.session is not None:
                    _write_state(session_file, loop.session)
        except FileError as error:  # of the log
            made = f"after {count} decision{'s' * (count != 1)}"
            raise FileError(f"{error}; ended {made}, the last one is not in the log; {loop.stop()}") from None
        except KeyboardInterrupt:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second one must not prevent the stop
            where = "" if log is None else f"; they are in {log}"
            raise KeyboardInterrupt(
                f"interrupted after {count} decision{'s' * (count != 1)}{where}; {loop.stop()}"
            ) from None


def _decide_about_bag(
    config: RobotConfig,
    domain: Domain,
    strategy: Strategy,
    bag: Path,
    *,
    decisions: int | None,
    log: Path | None,
    cache: Path | None,
    seed: int,
    jobs: int | None,
) -> None:
    """Print the beliefs and decisions about the people in a bag."""
    from lcorpp.assembly.track_robot import set_up_track_robot
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.robot.recorded import RecordedLoop, RecordedPeople, check_recordable, read_samples
    from lcorpp.robot.tracking import find_windows

    check_recordable(config, domain)
    samples = read_samples(config, bag)  # before the training
    with ExitStack() as stack:
        kept = None if log is None else stack.enter_context(DecisionLog(log))
        parts, classifiers = set_up_track_robot(
            domain,
            choose_robot_classifiers(config, domain),
            domain.planning.solver,
            cache=cache,
            progress=console.show_progress,
            seed=seed,
            jobs=console.count_processes(jobs),
        )

        def show_step(person: str, step: Step) -> None:
            belief = domain.marginal(step.belief)
            values = ", ".join(f"{format_value(value)} {p:.3f}" for value, p in belief)
            what = "the decision" if step.observation is None else f"observes {step.observation}"
            console.out.print(f"  person {person}: {step.action}, {what}; {values}")

        silence, windows = config.people.max_silence, find_windows(domain)
        people = RecordedPeople(samples, classifiers, max_silence=silence, windows=windows)
        strategy = _plan_limits(strategy, parts)
        loop = RecordedLoop(config, parts, strategy, people, show_step=show_step, seed=seed)
        count = 0
        for decision in loop.run(decisions):
            count += 1
            _print_decision(decision)
            _log_decision(kept, parts, strategy, decision)
    if not count:
        seconds = config.people.decide_after
        console.print_note(
            f"{bag}: no track of a person lasts {seconds:g} s (decide_after), so no decision is made"
        )


def _log_decision(log: DecisionLog | None, parts: RobotParts, strategy: Strategy, decision: Decision) -> None:
    """Write a decision to the log, if there is a log and the decision has an episode."""
    if log is not None and decision.episode is not None:
        log.append(
            parts,
            strategy,
            decision.facts,
            decision.episode,
            seed=decision.seed,
            person=decision.n_learnt,
            person_id=decision.person_id,
        )


def _write_state(file: SessionFile, session: Session) -> None:
    """Write what is learnt; the robot goes on if that fails, as the next decision writes all of it again."""
    try:
        file.write(session)
    except FileError as error:
        console.warn(str(error))


def _plan_limits(strategy: Strategy, parts: RobotParts) -> Strategy:
    """Return the strategy with the plan that keeps the limits of the domain, if it is LCORPP+limits."""
    from lcorpp.assembly.strategies.limits import bind_limits, keeps_limits

    if not keeps_limits(strategy):
        return strategy
    from lcorpp.assembly.strategies.limited_plan import find_plan

    with console.show_progress("keeping the limits"):
        plan = find_plan(parts.domain, parts.program)
    return bind_limits([strategy], plan)[0]


def choose_robot_classifiers(config: RobotConfig, domain: Domain) -> dict[str, ClassifierOptions]:
    """Return sense -> its stored classifier, or a learner on simulated or the domain's data, or None.

    The learner is the domain's, if it names one, and else the default one.
    """
    from lcorpp.assembly.options import StoredOptions, TrainingOptions
    from lcorpp.assembly.track_robot import LEARNER, find_track_senses
    from lcorpp.values import CHANNELS

    tracked = {sense.name for sense in find_track_senses(domain, CHANNELS)}
    chosen: dict[str, ClassifierOptions] = {}
    for sense in domain.senses:
        own = sense.classifier if sense.classifier not in (None, "channel") else LEARNER
        chosen[sense.name] = TrainingOptions(own) if sense.name in tracked else None
    return chosen | {name: StoredOptions(file) for name, file in config.classifiers.items()}


def _print_step(person: str, step: Step) -> None:
    what = "the decision" if step.observation is None else f"observes {step.observation}"
    console.out.print(f"  person {person}: {step.action}, {what}")


def _print_decision(decision: Decision) -> None:
    for failure in decision.failures:
        console.warn(str(failure))
    if decision.episode is not None:
        report = decision.episode.report
        console.out.print(
            f"person {decision.person}: {'no report' if report is None else format_value(report)}"
        )
    if decision.error is not None:
        console.warn(f"person {decision.person}: {decision.error}")
