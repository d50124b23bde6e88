"""`lcorpp run --trial`: one trial of a comparison again, step by step."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lcorpp.cli import console
from lcorpp.cli.explanation.cases import print_person
from lcorpp.cli.explanation.steps import decide_and_print

if TYPE_CHECKING:
    from lcorpp.scoring.experiment import Experiment


def print_trial(experiment: Experiment, number: int, trials: int) -> None:
    """Decide about the person of one trial again, with each strategy, and print every step.

    Args:
        number: of the trial, from 0. trials: the number of all trials.
    """
    from lcorpp.decision.dt_control import log_decision
    from lcorpp.scoring.experiment import draw_trial, start_session

    domain, trial = experiment.domain, draw_trial(experiment, number, trials=trials)
    truth = domain.reasoning.join(trial.person)
    print_person(domain, trial.person)
    for strategy in experiment.strategies:
        console.out.print(f"\ntrial {number}, {strategy.name}", style="bold")
        with strategy.locate_failures():
            session = start_session(experiment, strategy, number, trials=trials)
            robot, world = trial.make_robot(strategy, session), trial.make_world()
            labels = robot.classify(trial.instance)
            episode = decide_and_print(domain, robot, trial.instance.context, labels, world, truth)
        log_decision(episode)
        console.out.print(f"cost {world.cost:g}, return {world.return_:g}")
