"""Simulation of chunks of trials: the decisions of every strategy about each person."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lcorpp.decision import Robot, Strategy, dt_control
from lcorpp.decision.dt_control import LOG
from lcorpp.decision.strategies import Session
from lcorpp.errors import LcorppError
from lcorpp.log_output import show_log
from lcorpp.logs.decision_log import format_decision
from lcorpp.planning import Planner
from lcorpp.scoring.batch_simulation import BatchWorld, PeopleDraws
from lcorpp.scoring.decision_graph import DecisionGraph
from lcorpp.scoring.decision_nodes import BeliefNodes
from lcorpp.scoring.experiment import CHUNK_SIZE, Chunk, ChunkSource, Experiment
from lcorpp.scoring.gaps import find_gap
from lcorpp.values import Array, Indices

Trials = np.ndarray[Any, np.dtype[np.void]]
"""(n,) trials, each with these fields, one number for each of the k strategies:

truth: index of the true value; -1 before the trial is complete. reported: (k,) index of the reported value,
V for no report. cost, return_: (k,) as in `Scores`. gap: (k,) see `find_gap`.
"""


class ChunkWork(NamedTuple):
    """A chunk to simulate: its number, where its trials are written, and the file for its log, if any."""

    number: int
    results: Trials
    file: Path | None = None


def make_results(trials: int, k: int) -> Trials:
    """Return the results of trials of k strategies, none of which is complete."""
    each = (k,)
    fields = [
        ("truth", np.intp),
        ("reported", np.intp, each),
        ("cost", float, each),
        ("return_", float, each),
        ("gap", float, each),
    ]
    return np.full(trials, -1, np.dtype(fields))


def run_in_worker(level: int, experiment: Experiment, work: Sequence[ChunkWork]) -> int:
    """Run chunks in another process, which shows messages of the same level."""
    if level < logging.WARNING:
        show_log(level)
    return run_chunks(experiment, work)


def run_chunks(
    experiment: Experiment, work: Sequence[ChunkWork], sessions: Sequence[Session | None] | None = None
) -> int:
    """Simulate trials, write each into its results when it is complete, and return their number.

    Decisions that depend on the belief alone are simulated for all people of the chunks at once, the others
    one by one; both ways give the same results. Chunks with a log, and decisions that are shown
    (`lcorpp -v`), are simulated one by one.

    Args:
        sessions: of each strategy, None for one that does not learn from earlier people; by default of all.
    """
    source = ChunkSource(experiment)
    chunks = [source.draw(number, len(results)) for number, results, _ in work]
    single = set(range(len(experiment.strategies)))
    if all(file is None for _, _, file in work) and not LOG.isEnabledFor(logging.INFO):
        single -= _simulate_at_once(experiment, work, chunks)
    for own, chunk in zip(work, chunks, strict=True):
        _simulate_one_by_one(experiment, own, chunk, sorted(single), sessions)
    return sum(len(results) for _, results, _ in work)


def simulates_at_once(experiment: Experiment, strategy: Strategy) -> bool:
    """Whether a strategy's decisions are simulated for many people at once.

    They are if its actions depend on the belief alone and people answer by the feedback model.
    """
    planner = experiment.robot.planner
    alone = strategy.change is None and strategy.start is None
    return alone and isinstance(planner, Planner) and BatchWorld.supports(experiment.domain)


def _simulate_at_once(experiment: Experiment, work: Sequence[ChunkWork], chunks: Sequence[Chunk]) -> set[int]:
    """Simulate all people of some chunks at once; return the indices of the strategies that were simulated.

    A strategy whose decisions fail is left out: one by one the decision is found that fails.
    """
    domain = experiment.domain
    selected = [k for k, row in enumerate(experiment.strategies) if simulates_at_once(experiment, row)]
    if not selected:
        return set()
    world = BatchWorld(chunks[0].model)
    draws = PeopleDraws([seed for chunk in chunks for seed in chunk.seeds])
    values = np.concatenate([chunk.index_values() for chunk in chunks])
    ends = np.cumsum([len(results) for _, results, _ in work])[:-1]
    done = set()
    for k in selected:
        strategy = experiment.strategies[k]
        nodes = BeliefNodes(domain, strategy.robot(experiment.robot))
        graph = DecisionGraph(domain, nodes)
        try:
            roots, gaps = _find_roots(nodes, graph, strategy, chunks, experiment.robot)
            outcomes = world.decide(graph, roots, values, draws)
        except LcorppError:
            continue
        for name, numbers in {**outcomes._asdict(), "gap": gaps}.items():
            for (_, results, _), part in zip(work, np.split(numbers, ends), strict=True):
                results[name][:, k] = part
        done.add(k)
    return done


def _find_roots(
    nodes: BeliefNodes, graph: DecisionGraph, strategy: Strategy, chunks: Sequence[Chunk], full: Robot
) -> tuple[Indices, Array]:
    """Return the node of a graph before the first action about each person of the chunks, and `find_gap`."""
    roots, gaps = list[int](), list[float]()
    known: dict[tuple[object, ...], tuple[int, float]] = {}
    for chunk in chunks:
        observed = chunk.model.domain.observed
        senses = [sense for sense in chunk.labels if strategy.uses(sense)]
        for i, person in enumerate(chunk.people):
            facts = [person[name] for name in observed]
            outputs = [chunk.labels[sense][i] for sense in senses]
            key = (*facts, *outputs)
            if key not in known:
                labels = {s: label for s, label in zip(senses, outputs, strict=True) if label is not None}
                node = nodes.root(dict(zip(observed, facts, strict=True)), labels)
                (root,) = graph.find_numbers([node])
                known[key] = root, find_gap(full, strategy, np.frombuffer(node))
            root, gap = known[key]
            roots.append(root)
            gaps.append(gap)
    return np.array(roots, np.intp), np.array(gaps)


def _simulate_one_by_one(
    experiment: Experiment,
    work: ChunkWork,
    chunk: Chunk,
    selected: Sequence[int],
    sessions: Sequence[Session | None] | None,
) -> None:
    """Simulate the decisions of the selected strategies about each person, and complete the trials."""
    number, results, file = work
    values, parts = experiment.domain.values, experiment.parts
    if not selected:
        results["truth"] = chunk.index_values()
        return
    with nullcontext() if file is None else open(file, "wb", buffering=0) as log:
        for i, truth in enumerate(chunk.index_values()):
            trial, lines = chunk.find_trial(i), []
            for k in selected:
                strategy, world = experiment.strategies[k], trial.make_world()
                session = None if sessions is None else sessions[k]
                person = None if session is None else session.n_people
                with strategy.locate_failures():
                    episode = dt_control(trial.make_robot(strategy, session), trial.instance, world)
                    if session is not None:
                        session.learn(episode.evidence, episode.steps)
                report = episode.report
                results["reported"][i, k] = len(values) if report is None else values.index(report)
                results["cost"][i, k], results["return_"][i, k] = world.cost, world.return_
                results["gap"][i, k] = find_gap(trial.robot, strategy, episode.prior)
                if log is not None and parts is not None:
                    seconds = {**episode.seconds, "classify": chunk.seconds if episode.labels else 0.0}
                    simulated = {"trial": number * CHUNK_SIZE + i, **world.describe_truth()}
                    timed, context = replace(episode, seconds=seconds), trial.instance.context
                    line = format_decision(
                        parts, strategy, context, timed, simulated, seed=trial.seed, person=person
                    )
                    lines.append(line)
            if log is not None:
                log.write(b"".join(lines))
            results["truth"][i] = truth
