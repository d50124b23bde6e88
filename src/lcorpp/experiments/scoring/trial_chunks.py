"""Chunks of simulated trials: people, their signals, and the decisions of every strategy about them."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from lcorpp.decision import Robot, Strategy, dt_control
from lcorpp.decision.dt_control import LOG
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, LcorppError, check_type
from lcorpp.experiments.decision_log import format_decision
from lcorpp.experiments.robot_parts import RobotParts
from lcorpp.experiments.scoring.batch_simulation import BatchWorld, PeopleDraws
from lcorpp.experiments.scoring.decision_graph import DecisionGraph, Indices
from lcorpp.experiments.scoring.decision_nodes import BeliefNodes
from lcorpp.log_output import show_log
from lcorpp.planning import Planner
from lcorpp.simulation.people import Person, Population, SignalSource
from lcorpp.simulation.simulated_classifier import BatchClassifier
from lcorpp.simulation.world import SimulatedWorld, SimulationModel
from lcorpp.values import Array, Episode, Instance, Label

CHUNK_SIZE = 100
"""Trials per chunk. Each chunk has its own random generator, so this number is part of every result."""

Trials = np.ndarray[Any, np.dtype[np.void]]
"""(n,) trials, each with these fields, one number for each of the k strategies:

truth: index of the true value; -1 before the trial is complete. reported: (k,) index of the reported value,
V for no report. cost, return_: (k,) as in `Scores`.
"""


@dataclass(frozen=True, eq=False)
class Experiment:
    """The full robot, the sources of its signals and the strategies to compare.

    classifiers, signals: sense -> its classifier for many people at once, and the source of its signals.
    seed: of the people and their answers. All strategies get the same people and the same random numbers, so
        that differences between strategies are not differences between samples.
    parts: what determines the robot's decisions, for a log.
    """

    domain: Domain
    robot: Robot
    classifiers: Mapping[str, BatchClassifier]
    signals: Mapping[str, SignalSource]
    strategies: tuple[Strategy, ...]
    seed: int
    parts: RobotParts | None = None

    def __post_init__(self) -> None:
        check_type(self.domain, Domain, "the domain of an experiment", DecisionError)
        check_type(self.robot, Robot, "the robot of an experiment", DecisionError)
        for strategy in self.strategies:
            check_type(strategy, Strategy, "a strategy of an experiment", DecisionError)


class ChunkWork(NamedTuple):
    """A chunk to simulate: its number, where its trials are written, and the file for its log, if any."""

    number: int
    results: Trials
    file: Path | None = None


class _People(NamedTuple):
    """The people of a chunk, their signals and the output of the classifiers, and its seconds per person."""

    people: list[Person]
    signals: dict[str, Array]
    labels: Mapping[str, Sequence[Label | None]]
    seconds: float

    def instance(self, domain: Domain, i: int) -> Instance:
        """Return what the robot perceives of person i."""
        perceived = {sense: own[i] for sense, own in self.signals.items()}
        return Instance(perceived, {name: self.people[i][name] for name in domain.observed})


def run_in_worker(level: int, experiment: Experiment, work: Sequence[ChunkWork]) -> int:
    """Run chunks in another process, which shows messages of the same level."""
    if level < logging.WARNING:
        show_log(level)
    return run_chunks(experiment, work)


def run_chunks(experiment: Experiment, work: Sequence[ChunkWork]) -> int:
    """Simulate trials, write each into its results when it is complete, and return their number.

    The experiment's seed and the chunk's number determine every random draw. Decisions that depend on the
    belief alone are simulated for all people of the chunks at once, the others one by one; both ways give the
    same results. Chunks with a log, and decisions that are shown (`lcorpp -v`), are simulated one by one.
    """
    population = Population(experiment.domain)
    chunks = [_draw_people(experiment, population, number, len(results)) for number, results, _ in work]
    single = set(range(len(experiment.strategies)))
    if all(file is None for _, _, file in work) and not LOG.isEnabledFor(logging.INFO):
        single -= _simulate_at_once(experiment, work, chunks)
    for chunk, people in zip(work, chunks, strict=True):
        _simulate_one_by_one(experiment, chunk, people, sorted(single))
    return sum(len(chunk.results) for chunk in work)


class Trial(NamedTuple):
    """One trial before a decision.

    domain: of the experiment. robot: the full one, whose classifiers return the output about the person.
    instance: what the robot perceives. person: who it is. seed: of the person's answers.
    """

    domain: Domain
    robot: Robot
    instance: Instance
    person: Person
    seed: tuple[int, ...]

    def make_robot(self, strategy: Strategy) -> Robot:
        """Return the robot of a strategy."""
        return strategy.robot(self.robot, make_generator(*self.seed))

    def make_world(self) -> SimulatedWorld:
        """Return the world before any action; each one draws the same random numbers."""
        return SimulationModel(self.domain).make_world(self.person, np.random.default_rng(self.seed))


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
    domain = experiment.domain
    drawn = _draw_people(experiment, Population(domain), number, count)
    classifiers = {sense: PrecomputedLabel(labels[i]) for sense, labels in drawn.labels.items()}
    robot = replace(experiment.robot, classifiers=classifiers)
    seed = experiment.seed, number, i
    return Trial(domain, robot, drawn.instance(domain, i), drawn.people[i], seed)


def replay_trial(experiment: Experiment, trial: int, strategy: Strategy, *, trials: int) -> Episode:
    """Decide about the person of one trial again.

    Args:
        trial: its number, from 0. strategy: one of the experiment's. trials: the number of all trials.

    Raises:
        DecisionError: there is no such trial; and whatever the robot's parts raise.
    """
    drawn = draw_trial(experiment, trial, trials=trials)
    return dt_control(drawn.make_robot(strategy), drawn.instance, drawn.make_world())


def simulates_at_once(experiment: Experiment, strategy: Strategy) -> bool:
    """Whether a strategy's decisions are simulated for many people at once.

    They are if its actions depend on the belief alone and people answer by the feedback model.
    """
    planner = experiment.robot.planner
    return strategy.change is None and isinstance(planner, Planner) and BatchWorld.supports(experiment.domain)


def _draw_people(experiment: Experiment, population: Population, number: int, count: int) -> _People:
    rng = np.random.default_rng([experiment.seed, number])
    people = population.sample(count, rng)
    signals = {sense: source.simulate(people, rng) for sense, source in experiment.signals.items()}
    began = perf_counter()
    labels = {
        sense: classifier.classify_many(signals[sense])
        for sense, classifier in experiment.classifiers.items()
    }
    return _People(people, signals, labels, (perf_counter() - began) / count)


def _simulate_at_once(
    experiment: Experiment, work: Sequence[ChunkWork], chunks: Sequence[_People]
) -> set[int]:
    """Simulate all people of some chunks at once; return the indices of the strategies that were simulated.

    A strategy whose decisions fail is left out: one by one the decision is found that fails.
    """
    domain = experiment.domain
    selected = [k for k, row in enumerate(experiment.strategies) if simulates_at_once(experiment, row)]
    if not selected:
        return set()
    world = BatchWorld(SimulationModel(domain))
    draws = PeopleDraws(
        [(experiment.seed, number, i) for number, results, _ in work for i in range(len(results))]
    )
    values = np.concatenate([_index_values(domain, chunk.people) for chunk in chunks])
    done = set()
    for k in selected:
        strategy = experiment.strategies[k]
        nodes = BeliefNodes(domain, strategy.robot(experiment.robot))
        graph = DecisionGraph(domain, nodes)
        try:
            roots = _find_roots(domain, nodes, graph, strategy, chunks)
            outcomes = world.decide(graph, roots, values, draws)
        except LcorppError:
            continue
        first = 0
        for _, results, _ in work:
            rows = slice(first, first + len(results))
            results["reported"][:, k] = outcomes.reported[rows]
            results["cost"][:, k], results["return_"][:, k] = outcomes.cost[rows], outcomes.return_[rows]
            first += len(results)
        done.add(k)
    return done


def _find_roots(
    domain: Domain, nodes: BeliefNodes, graph: DecisionGraph, strategy: Strategy, chunks: Sequence[_People]
) -> Indices:
    """Return the node of a graph before the first action about each person of the chunks."""
    roots = list[int]()
    known: dict[tuple[object, ...], int] = {}
    for chunk in chunks:
        senses = [sense for sense in chunk.labels if strategy.uses(sense)]
        for i, person in enumerate(chunk.people):
            facts = [person[name] for name in domain.observed]
            outputs = [chunk.labels[sense][i] for sense in senses]
            key = (*facts, *outputs)
            root = known.get(key)
            if root is None:
                labels = {s: label for s, label in zip(senses, outputs, strict=True) if label is not None}
                root = graph.find_number(nodes.root(dict(zip(domain.observed, facts, strict=True)), labels))
                known[key] = root
            roots.append(root)
    return np.array(roots, np.intp)


def _index_values(domain: Domain, people: Sequence[Person]) -> Indices:
    """Return the index of each person's shared value."""
    return np.array([domain.values.index(domain.reasoning.join(person)) for person in people], np.intp)


def _simulate_one_by_one(
    experiment: Experiment, work: ChunkWork, drawn: _People, selected: Sequence[int]
) -> None:
    """Simulate the decisions of the selected strategies about each person, and complete the trials."""
    number, results, file = work
    domain = experiment.domain
    truth = _index_values(domain, drawn.people)
    if not selected:
        results["truth"] = truth
        return
    model = SimulationModel(domain)
    classifiers = {sense: PrecomputedLabel() for sense in drawn.labels}
    full = replace(experiment.robot, classifiers=classifiers, domain=domain)
    rows = [experiment.strategies[k] for k in selected]
    # a strategy that changes the robot does so for each decision
    robots = [None if strategy.change else strategy.robot(full) for strategy in rows]
    with ExitStack() as stack:
        log, parts = None, experiment.parts
        if file is not None:
            log = stack.enter_context(open(file, "wb", buffering=0))
        for i, person in enumerate(drawn.people):
            for sense, classifier in classifiers.items():
                classifier.label = drawn.labels[sense][i]
            instance = drawn.instance(domain, i)
            lines = []
            for k, strategy, own in zip(selected, rows, robots, strict=True):
                # every strategy gets the same answers: each has a new generator with the same seed
                seed = experiment.seed, number, i
                world = model.make_world(person, np.random.default_rng(seed))
                with strategy.locate_failures():
                    robot = own or strategy.robot(full, make_generator(*seed))
                    episode = dt_control(robot, instance, world)
                report = episode.report
                reported = len(domain.values) if report is None else domain.values.index(report)
                results["reported"][i, k] = reported
                results["cost"][i, k], results["return_"][i, k] = world.cost, world.return_
                if log is not None and parts is not None:
                    seconds = {**episode.seconds, "classify": drawn.seconds if episode.labels else 0.0}
                    simulated = {"trial": number * CHUNK_SIZE + i, **world.describe_truth()}
                    timed = replace(episode, seconds=seconds)
                    lines.append(
                        format_decision(parts, strategy, instance.context, timed, simulated, seed=seed)
                    )
            if log is not None:
                log.write(b"".join(lines))
            results["truth"][i] = truth[i]


def make_generator(*seed: int) -> np.random.Generator:
    """Return the generator of a strategy that draws its actions, independent of the world's answers."""
    return np.random.default_rng([*seed, 1])


@dataclass
class PrecomputedLabel:
    """A classifier that returns the label of the current person, computed before with many others."""

    label: Label | None = None

    def classify(self, signal: Array) -> Label | None:
        return self.label
