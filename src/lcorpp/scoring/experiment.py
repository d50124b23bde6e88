"""An experiment and its trials: people, drawn by chunks, with their signals and the classifiers' output."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from lcorpp.arguments import check_fields
from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.decision import Robot, Strategy, dt_control
from lcorpp.decision.strategies import Rates, Session, make_generator
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError
from lcorpp.simulation.dynamics import make_dynamics
from lcorpp.simulation.people import Person, Population, SignalSource, select_signals, simulate_signals
from lcorpp.simulation.simulated_classifier import BatchClassifier, PrecomputedLabel, classify_perceived
from lcorpp.simulation.world import Dynamics, SimulatedWorld
from lcorpp.values import Array, Episode, Indices, Instance, Label

CHUNK_SIZE = 100
"""Trials per chunk. Each chunk has its own random generator, so this number is part of every result."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """The full robot, the sources of its signals and the strategies to compare.

    classifiers, signals: sense -> its classifier for many people at once, and the source of its signals.
    seed: of the people and their answers. All strategies get the same people and the same random numbers, so
        that differences between strategies are not differences between samples.
    parts: what determines the robot's decisions, for a log.
    rates: of senses with soft evidence, for strategies that learn from earlier people.
    people: the domain of the people, see `check_people`; None for the robot's.

    Examples:
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.scoring import Experiment, run_trials
        >>> full = load_robot("intention", cache=False)
        >>> channels = {"motion": full.senses["motion"].classifier}  # the source of its signals, too
        >>> chosen = strategies(["LCORPP"])
        >>> experiment = Experiment(full.domain, full.robot, channels, channels, chosen, seed=1)
        >>> scores, completed = run_trials(experiment, 100)
        >>> scores[0].counts.astype(int).tolist()  # true value by reported value; none is not reported
        [[29, 4, 0], [9, 58, 0]]
    """

    domain: Domain
    robot: Robot
    classifiers: Mapping[str, BatchClassifier]
    signals: Mapping[str, SignalSource]
    strategies: tuple[Strategy, ...]
    seed: int
    parts: RobotParts | None = None
    rates: Rates = field(default_factory=dict)
    people: Domain | None = None

    def __post_init__(self) -> None:
        check_fields(self)


class Trial(NamedTuple):
    """One trial before a decision.

    robot: the full one, whose classifiers return their output about the person.
    instance: what the robot perceives. seed: of the person's answers.
    """

    model: Dynamics
    robot: Robot
    instance: Instance
    person: Person
    seed: tuple[int, ...]

    def make_robot(self, strategy: Strategy, session: Session | None = None) -> Robot:
        """Return the robot of a strategy; session: of a strategy that learns from earlier trials."""
        if session is not None:
            return session.robot(strategy.select(self.robot))
        return strategy.robot(self.robot, make_generator(*self.seed) if strategy.draws else None)

    def make_world(self) -> SimulatedWorld:
        """Return the world before any action; each one draws the same random numbers."""
        return self.model.make_world(self.person, np.random.default_rng(self.seed))


@dataclass(frozen=True, eq=False)
class Chunk:
    """The n people of a chunk of trials.

    domain: the robot's. robot: the full one. seed: of the experiment and the chunk.
    signals: sense -> (n, ...), as of `simulate_signals`.
    labels: sense -> output of the classifier about each person, None without a signal.
    seconds: of the classifiers, for each person.
    """

    domain: Domain
    model: Dynamics
    robot: Robot
    seed: tuple[int, int]
    people: Sequence[Person]
    signals: Mapping[str, Array]
    labels: Mapping[str, Sequence[Label | None]]
    seconds: float

    def index_values(self) -> Indices:
        """Return the index of each person's shared value, (n,)."""
        domain = self.domain
        return np.array([domain.values.index(domain.reasoning.join(p)) for p in self.people], np.intp)

    @property
    def seeds(self) -> list[tuple[int, int, int]]:
        """The seed of each person's answers: that of the chunk, and the place in it.

        The first person has the place `CHUNK_SIZE`: numpy ignores zeros at the end of a seed, and the seed of
        the chunk has drawn the people.
        """
        return [(*self.seed, i or CHUNK_SIZE) for i in range(len(self.people))]

    def find_trial(self, i: int) -> Trial:
        """Return the trial of person i."""
        person, observed = self.people[i], self.domain.observed
        classifiers = {sense: PrecomputedLabel(labels[i]) for sense, labels in self.labels.items()}
        instance = Instance(select_signals(self.signals, i), {name: person[name] for name in observed})
        robot = replace(self.robot, classifiers=classifiers)
        return Trial(self.model, robot, instance, person, self.seeds[i])


class ChunkSource:
    """Draws the chunks of an experiment; its seed and the number of a chunk determine every random draw."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment = experiment
        self._people = experiment.people or experiment.domain
        self._model, self._population = make_dynamics(self._people), Population(self._people)

    def draw(self, number: int, count: int) -> Chunk:
        """Draw a chunk of some people."""
        experiment, seed = self._experiment, (self._experiment.seed, number)
        rng = np.random.default_rng(seed)
        people = self._population.sample(count, rng)
        signals = {}
        for place, sense in enumerate(experiment.domain.all_senses):
            if sense.name in experiment.signals:  # the same, whatever other senses the strategies use
                own = rng if place == 0 else np.random.default_rng([*seed, place, 2])
                source = experiment.signals[sense.name]
                signals[sense.name] = simulate_signals(self._people, sense.name, source, people, own)
        began = perf_counter()
        labels = {
            sense: classify_perceived(classifier, signals[sense])
            for sense, classifier in experiment.classifiers.items()
        }
        seconds = (perf_counter() - began) / count
        return Chunk(experiment.domain, self._model, experiment.robot, seed, people, signals, labels, seconds)


def draw_trial(experiment: Experiment, trial: int, *, trials: int) -> Trial:
    """Draw the person of one trial again.

    Args:
        trial: its number, from 0. trials: the number of all trials.

    Raises:
        DecisionError: there is no such trial.
    """
    if not 0 <= trial < trials:
        raise DecisionError(f"there is no trial {trial}; expected 0 to {trials - 1}")
    number, i = divmod(trial, CHUNK_SIZE)
    count = min(CHUNK_SIZE, trials - number * CHUNK_SIZE)
    return ChunkSource(experiment).draw(number, count).find_trial(i)


def replay_trial(experiment: Experiment, trial: int, strategy: Strategy, *, trials: int) -> Episode:
    """Decide about the person of one trial again.

    Args:
        trial: its number, from 0. strategy: one of the experiment's. trials: the number of all trials.

    Raises:
        DecisionError: there is no such trial; and whatever the robot's parts raise.

    Examples:
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.scoring import Experiment, replay_trial
        >>> full = load_robot("intention", cache=False)
        >>> channels, chosen = {"motion": full.senses["motion"].classifier}, strategies(["LCORPP"])
        >>> experiment = Experiment(full.domain, full.robot, channels, channels, chosen, seed=1)
        >>> episode = replay_trial(experiment, 7, chosen[0], trials=100)
        >>> dict(episode.evidence), episode.report
        ({'time': 'morning', 'location': 'library', 'classifier': 'one'}, 'interested')
    """
    drawn = draw_trial(experiment, trial, trials=trials)
    robot = drawn.make_robot(strategy, start_session(experiment, strategy, trial, trials=trials))
    return dt_control(robot, drawn.instance, drawn.make_world())


def start_session(experiment: Experiment, strategy: Strategy, trial: int, *, trials: int) -> Session | None:
    """Return the session of a strategy after the trials before `trial`; None if it does not learn from them.

    Arguments and errors: as of `replay_trial`.
    """
    if strategy.start is None:
        return None
    session, source = (
        strategy.start(strategy.select(experiment.robot), experiment.rates),
        ChunkSource(experiment),
    )
    for first in range(0, trial, CHUNK_SIZE):
        chunk = source.draw(first // CHUNK_SIZE, min(CHUNK_SIZE, trials - first))
        for i in range(min(CHUNK_SIZE, trial - first)):
            drawn = chunk.find_trial(i)
            episode = dt_control(drawn.make_robot(strategy, session), drawn.instance, drawn.make_world())
            session.learn(episode.evidence, episode.steps)
    return session
