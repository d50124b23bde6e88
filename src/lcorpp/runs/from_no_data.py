"""Algorithm 1 from no data at all, beside the same people without any learning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, cast

import numpy as np

from lcorpp.assembly.options import TrainingOptions
from lcorpp.decision import Robot, dt_control
from lcorpp.domains import Domain
from lcorpp.domains.sections.simulation import Simulate
from lcorpp.protocols import Classifier, Planner
from lcorpp.runs.batches import score_batch
from lcorpp.runs.run import run_active_learning
from lcorpp.runs.senses import LABEL_KINDS, ActiveLearningOptions, set_up_learning
from lcorpp.runs.untrained import RandomClassifier
from lcorpp.scoring.metrics import Scores
from lcorpp.simulation.people import Person, Population, SimulatedSignals
from lcorpp.simulation.people_stream import DecisionResult, PeopleStream
from lcorpp.simulation.simulated_classifier import BatchClassifier
from lcorpp.values import Array, ConfusionMatrix, Episode

NONE = "none"
"""The run without new data; the others are named after their kind of labels."""


@dataclass(frozen=True, eq=False)
class BatchOutcome:
    """A batch of decisions, the classifier with which they were made, and what is learned from them.

    scores: of the decisions; the errors of its `counts` are those of the labels that they add to the data.
    rules: the confusion matrix in the rules, estimated from the labels reported before.
    true: the classifier's confusion matrix for the people of this batch, by their true classes.
    belief: the mean belief in the reported value at the report.
    learned: the accuracy, for people who are in no batch, of the classifier that is trained after the batch.
    """

    scores: Scores
    rules: ConfusionMatrix
    true: ConfusionMatrix
    belief: float
    learned: float


def run_from_no_data(
    domain: Domain,
    planner: Planner,
    seed: int,
    *,
    learner: str,
    batches: int,
    batch_size: int,
    test_size: int,
    labels: Sequence[str] = LABEL_KINDS,
) -> dict[str, list[BatchOutcome]]:
    """Decide about batches of people, first with a random classifier; each run has the same people.

    Args:
        domain: with one sense, whose signals are simulated.
        learner: a name in the table of learners.
        test_size: the number of people for whom the accuracy of each classifier is measured, of all runs the
            same. A batch is too small for that: two trainings differ by less than chance in it.
        labels: kinds of labels, of each of which there is a run.

    Returns:
        Run -> its batches: without new data, and with each kind of labels.
    """
    sense = domain.senses[0]
    signals = {sense.name: _simulate_once(domain.simulation.signals[sense.name])}
    domain = replace(domain, simulation=replace(domain.simulation, signals=signals))
    rng = np.random.default_rng([seed, 3])
    people = Population(domain).sample(test_size, rng)
    tracks = SimulatedSignals.from_domain(domain, sense).simulate(people, rng)
    classes = np.array([domain.class_of(sense.name, domain.reasoning.join(person)) for person in people])

    def measure(classifier: Classifier) -> float:
        predicted = cast(BatchClassifier, classifier).classify_many(tracks)
        return float(np.mean(np.array(predicted) == classes))

    def learn(kind: str) -> list[BatchOutcome]:
        options = ActiveLearningOptions(
            {sense.name: TrainingOptions(learner=learner, tracks=0)},
            labels=kind,
            batch_size=batch_size,
            epsilon=0,
            max_batches=batches,
            seed=seed,
        )
        results = run_active_learning(domain, set_up_learning(domain, options), planner, options)
        return [
            make_outcome(
                domain,
                after.decisions,
                after.batch.episodes,
                before.batch.senses[sense.name].confusion,
                measure(after.batch.senses[sense.name].classifier),
            )
            for before, after in pairwise(results)
        ]

    learned = measure(RandomClassifier(sense.classes, seed))
    unchanged = _decide_without_learning(domain, planner, seed, batches, batch_size, learned)
    return {NONE: unchanged, **{kind: learn(kind) for kind in labels}}


def _simulate_once(simulate: Simulate) -> Simulate:
    """Return the function with a memory: simulating trajectories takes longer than deciding about them."""
    memory: dict[str, tuple[Array, Any]] = {}  # arguments -> signals, and the generator's state afterwards

    def recall(people: Sequence[Person], rng: np.random.Generator) -> Array:
        key = f"{people} {rng.bit_generator.state}"
        if key not in memory:
            memory[key] = simulate(people, rng), rng.bit_generator.state
        signals, rng.bit_generator.state = memory[key]
        return signals

    return recall


def _decide_without_learning(
    domain: Domain, planner: Planner, seed: int, batches: int, batch_size: int, learned: float
) -> list[BatchOutcome]:
    """Keep the random classifier and its uniform rules; the people are those of `run_active_learning`."""
    sense = domain.senses[0]
    classifier = RandomClassifier(sense.classes, seed)
    rules = classifier.confusion
    reasoner = domain.make_reasoner(domain.program_for({sense.name: rules}))
    robot = Robot({sense.name: classifier}, reasoner, planner, domain)
    stream = PeopleStream(domain, {sense.name: SimulatedSignals.from_domain(domain, sense)}, seed)
    outcomes = []
    for _ in range(batches):
        decisions, episodes = list[DecisionResult](), list[Episode]()
        for _ in range(batch_size):
            episodes.append(dt_control(robot, *stream.next()))
            decisions.append(stream.result(episodes[-1]))
        outcomes.append(make_outcome(domain, decisions, episodes, rules, learned))
    return outcomes


def make_outcome(
    domain: Domain,
    decisions: Sequence[DecisionResult],
    episodes: Sequence[Episode],
    rules: ConfusionMatrix,
    learned: float,
) -> BatchOutcome:
    """Score the decisions of a batch, their labels and the beliefs behind their reports."""
    name, true = domain.senses[0].name, np.zeros_like(rules.counts)
    for decision, episode in zip(decisions, episodes, strict=True):
        actual, label = domain.class_of(name, decision.actual), str(episode.labels[name])
        true[rules.classes.index(actual), rules.classes.index(label)] += 1
    beliefs = [
        domain.marginal(episode.steps[-1].belief)[episode.report]
        for episode in episodes
        if episode.report is not None
    ]
    matrix = ConfusionMatrix(rules.classes, true)
    return BatchOutcome(score_batch(domain, decisions), rules, matrix, float(np.mean(beliefs)), learned)
