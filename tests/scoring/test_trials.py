"""Trials: the same for any number of processes, on any domain; people and answers as often as they should."""

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import confusion_matrix

from lcorpp import planning
from lcorpp.decision import LCORPP, STRATEGIES, Robot, strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DataError, DecisionError, DomainError, ObservationError
from lcorpp.learning import TrainedClassifier, fit_calibration
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.scoring import trial_chunks
from lcorpp.scoring.batch_simulation import BatchWorld, PeopleDraws
from lcorpp.scoring.cases import compute_joint_distribution
from lcorpp.scoring.experiment import CHUNK_SIZE, ChunkSource, Experiment, replay_trial
from lcorpp.scoring.trial_chunks import ChunkWork, make_results
from lcorpp.scoring.trials import run_trials
from lcorpp.simulation import (
    NoisyChannel,
    Population,
    RecordedSignals,
    SimulatedSignals,
    SimulationModel,
    simulate_dataset,
)
from lcorpp.values import ConfusionMatrix, Dataset, Likelihood
from tests.decision.fakes import FakeWorld

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"


@pytest.fixture(scope="module")
def rooms() -> Experiment:
    domain = load_domain(ROOMS)
    channels = {"heading": NoisyChannel.from_domain(domain, domain.senses[0])}
    planner = planning.Planner(planning.solve(domain.pomdp, domain.start_beliefs()))
    robot = Robot(channels, Enumeration(domain.program), planner, domain)
    return Experiment(domain, robot, channels, channels, STRATEGIES, 3)


def test_the_experiment_is_pickled_once_by_the_thread_that_decides(rooms):
    """Strategies that learn from people use the same robot meanwhile, and change what it caches."""
    threads = []

    class Pickled(Enumeration):
        def __reduce_ex__(self, protocol):
            threads.append(threading.current_thread().name)
            return super().__reduce_ex__(protocol)

    robot = replace(rooms.robot, reasoner=Pickled(rooms.domain.program))
    results, done = run_trials(replace(rooms, robot=robot), 300, jobs=2)
    assert done == 300
    assert threads == [threading.main_thread().name]
    expected, _ = run_trials(rooms, 300)
    assert [own.counts.tolist() for own in results] == [own.counts.tolist() for own in expected]


def test_all_strategies_run_on_another_domain(rooms):
    results, done = run_trials(rooms, 300)
    assert done == 300
    by_name = {result.strategy: result for result in results}
    assert list(by_name) == [row.name for row in STRATEGIES]
    assert by_name["LCORPP"].return_.estimate > by_name["L+R"].return_.estimate
    assert all(np.sum(result.counts) == 300 for result in results)


def test_the_result_does_not_depend_on_the_processes(rooms):
    """Shows 7."""
    one, _ = run_trials(rooms, 350, jobs=1)
    two, _ = run_trials(rooms, 350, jobs=2)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.counts, b.counts)
        assert (a.cost, a.return_, a.cost_sd, a.gap) == (b.cost, b.return_, b.cost_sd, b.gap)


@dataclass(frozen=True)
class Column:
    """The channel as soft evidence: a label's likelihood is its column of the rates."""

    channel: NoisyChannel

    def classify(self, signal):
        return self.classify_many(signal[None])[0]

    def classify_many(self, signals):
        said = self.channel.classify_many(signals)
        columns = self.channel.rates.T
        return [
            Likelihood(self.channel.classes, columns[self.channel.classes.index(label)]) for label in said
        ]


@pytest.mark.parametrize("place", [ROOMS, "intention"])
def test_the_likelihood_of_a_label_decides_like_the_label(place):
    """Both go through the same program; the rules of the hard one hold the same rates."""
    domain = load_domain(place)
    (sense,) = domain.senses
    channel = NoisyChannel.from_domain(domain, sense)
    planner = planning.Planner(planning.solve(domain.pomdp, domain.start_beliefs()))
    rows = tuple(row for row in STRATEGIES if row.reasons)
    counts = []
    for reader, program in ((channel, domain.program), (Column(channel), domain.soft_program())):
        readers = {sense.name: reader}
        robot = Robot(readers, Reasoner(program), planner, domain)
        experiment = Experiment(domain, robot, readers, {sense.name: channel}, rows, 3)
        results, _ = run_trials(experiment, 200)
        counts.append([(result.counts.tolist(), result.cost.estimate) for result in results])
    assert counts[0] == counts[1]


def test_a_single_strategy_gets_the_same_people(rooms):
    together, _ = run_trials(rooms, 200)
    alone, _ = run_trials(replace(rooms, strategies=(LCORPP,)), 200)
    np.testing.assert_array_equal(together[-1].counts, alone[0].counts)
    assert together[-1].cost == alone[0].cost


def test_another_seed_gives_another_result(rooms):
    one, _ = run_trials(rooms, 100)
    other, _ = run_trials(replace(rooms, seed=4), 100)
    assert any((a.counts != b.counts).any() for a, b in zip(one, other, strict=True))


def one_by_one(rows):
    """The strategies as own ones, which are simulated one by one."""
    return tuple(replace(row, change=lambda robot: robot) for row in rows)


def test_decisions_at_once_equal_those_one_by_one(rooms):
    together, _ = run_trials(rooms, 150)
    single, _ = run_trials(replace(rooms, strategies=one_by_one(STRATEGIES)), 150)
    for a, b in zip(together, single, strict=True):
        np.testing.assert_array_equal(a.counts, b.counts)
        assert (a.cost, a.return_, a.cost_sd) == (b.cost, b.return_, b.cost_sd)


def test_a_single_trial_is_replayed(rooms):
    """Also of the last chunk, which is not full."""
    results = make_results(150, len(STRATEGIES))
    trial_chunks.run_chunks(rooms, [ChunkWork(0, results[:100]), ChunkWork(1, results[100:])])
    for trial in (0, 57, 100, 149):
        for k, strategy in enumerate(STRATEGIES):
            episode = replay_trial(rooms, trial, strategy, trials=150)
            assert rooms.domain.values.index(episode.report) == results["reported"][trial, k]
            costs = [
                -float(rooms.domain.pomdp.reward[rooms.domain.pomdp.actions.index(step.action)].min())
                for step in episode.steps[:-1]
            ]
            assert sum(costs) == pytest.approx(results["cost"][trial, k])
    with pytest.raises(DecisionError, match="there is no trial 150; expected 0 to 149"):
        replay_trial(rooms, 150, STRATEGIES[0], trials=150)


def test_draws_are_those_of_each_persons_generator():
    draws = PeopleDraws([(1, 2, i) for i in range(5)])
    streams = [np.random.default_rng((1, 2, i)).random(200) for i in range(5)]
    for number in (0, 3, 40, 40, 17, 150):
        people = np.array([4, 1, 2]) if number == 40 else np.arange(5)
        np.testing.assert_array_equal(draws.get(people, number), [streams[i][number] for i in people])


def test_a_decision_that_fails_at_once_is_found_one_by_one(rooms, monkeypatch):
    class Wrong(planning.Planner):
        def update(self, belief, action, observation):
            raise ObservationError("this observation is impossible")

    wrong = replace(
        rooms, robot=replace(rooms.robot, planner=Wrong(rooms.robot.planner.policy, rooms.domain.pomdp))
    )
    with pytest.raises(ObservationError, match="this observation is impossible"):
        run_trials(wrong, 100)


def test_an_interrupt_keeps_the_complete_trials(rooms, monkeypatch):
    """Of decisions one by one also those of an incomplete chunk: here 130 trials of a chunk and a half."""
    honest, calls = trial_chunks.dt_control, itertools.count(1)
    rows = one_by_one(STRATEGIES)

    def interrupt(robot, instance, world):
        if next(calls) > 130 * len(STRATEGIES):
            raise KeyboardInterrupt
        return honest(robot, instance, world)

    monkeypatch.setattr(trial_chunks, "dt_control", interrupt)
    results, done = run_trials(replace(rooms, strategies=rows), 1000)
    assert done == 130
    monkeypatch.undo()
    whole, _ = run_trials(rooms, 200)
    assert (whole[0].counts >= results[0].counts).all()
    assert all(np.sum(result.counts) == 130 for result in results)


def test_an_interrupt_keeps_the_people_who_are_complete_at_once(rooms, monkeypatch):
    honest, calls = BatchWorld.decide, itertools.count(1)

    def interrupt(*arguments):
        if next(calls) > 3 * len(STRATEGIES) + 2:
            raise KeyboardInterrupt
        return honest(*arguments)

    monkeypatch.setattr(BatchWorld, "decide", interrupt)
    results, done = run_trials(rooms, 5000)
    assert done == 3000
    assert all(np.sum(result.counts) == 3000 for result in results)


@dataclass(frozen=True)
class Stalling:
    """A reasoner that never returns from its 200th answer in a process, after it has created a file."""

    reasoner: Enumeration
    folder: Path
    answers: list[str] = field(default_factory=list)

    def posterior(self, attribute, evidence):
        self.answers.append(attribute)
        if len(self.answers) == 200:
            (self.folder / str(os.getpid())).touch()
            threading.Event().wait()
        return self.reasoner.posterior(attribute, evidence)


@pytest.mark.slow
def test_an_interrupt_keeps_the_trials_of_incomplete_chunks_of_all_processes(rooms, tmp_path):
    def interrupt_when_stalled():
        while len(list(tmp_path.iterdir())) < 2:  # while a process starts, an interrupt would be lost
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    robot = replace(rooms.robot, reasoner=Stalling(rooms.robot.reasoner, tmp_path))
    rows = one_by_one(STRATEGIES)
    interrupter = threading.Thread(target=interrupt_when_stalled)
    interrupter.start()
    results, done = run_trials(replace(rooms, robot=robot, strategies=rows), 1000, jobs=2)
    interrupter.join()
    assert 32 <= done < CHUNK_SIZE  # six answers a trial, two of them for L+P: 200 answers are 33 trials
    assert all(np.sum(result.counts) == done for result in results)


def test_an_interrupt_before_the_first_trial_is_raised(rooms, monkeypatch):
    def tired(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(trial_chunks, "run_chunks", tired)
    with pytest.raises(KeyboardInterrupt):
        run_trials(rooms, 100)
    with pytest.raises(DecisionError, match="`trials` must be at least 1, not 0"):
        run_trials(rooms, 0)


def test_people_are_drawn_from_the_truth_program():
    """P(interested) = .4 (.3, .1 and .8 in equal parts); 4000 people, so 4 standard errors are .031."""
    people = Population(load_domain("intention")).sample(4000, np.random.default_rng(2))
    share = np.mean([person["intention"] == "interested" for person in people])
    assert abs(share - 0.4) < 0.031
    library = np.mean([p["location"] == "library" for p in people if p["identity"] == "visitor"])
    assert abs(library - 0.8) < 0.05


def test_the_joint_distribution_is_exact():
    cells = compute_joint_distribution(load_domain("intention"), ("identity", "intention"))
    assert cells["visitor", "interested"] == pytest.approx(0.8 / 3)
    assert sum(cells.values()) == pytest.approx(1)


def test_a_channel_errs_at_its_rates():
    channel = NoisyChannel("wish", ("a", "b"), np.array([[0.76, 0.24], [0.29, 0.71]]))
    people = [{"wish": "a"}] * 20_000 + [{"wish": "b"}] * 20_000
    said = np.array(channel.classify_many(channel.simulate(people, np.random.default_rng(0))))
    # standard errors are .003
    assert np.mean(said[:20_000] == "a") == pytest.approx(0.76, abs=0.012)
    assert np.mean(said[20_000:] == "a") == pytest.approx(0.29, abs=0.013)


def test_answers_are_flipped_with_the_noise_and_scored_by_the_truth():
    domain = load_domain("intention")
    stage, rng = SimulationModel(domain), np.random.default_rng(1)
    worlds = [stage.make_world({"intention": "interested"}, rng) for _ in range(5000)]
    answers = [world.act("greet") for world in worlds]
    assert set(answers) == {"pos", "neg"}
    assert np.mean(np.array(answers) == "pos") == pytest.approx(0.7, abs=0.026)  # 4 standard errors
    worlds[0].act("turn")
    worlds[0].report("report_interested")
    assert (worlds[0].cost, worlds[0].return_) == (6.5, 73.5)
    worlds[1].report("report_not_interested")
    assert (worlds[1].cost, worlds[1].return_) == (2.0, -82.0)


def answers(*texts):
    return lambda person, rng: FakeWorld(*texts)


def test_an_own_world_replaces_the_feedback_model():
    domain = load_domain("intention")
    honest = replace(domain.simulation, world=answers("neg"))
    world = SimulationModel(replace(domain, simulation=honest)).make_world(
        {"intention": "interested"}, np.random.default_rng(0)
    )
    assert world.act("greet") == "neg"
    odd = replace(domain.simulation, world=answers("perhaps"))
    world = SimulationModel(replace(domain, simulation=odd)).make_world(
        {"intention": "interested"}, np.random.default_rng(0)
    )
    with pytest.raises(
        DomainError, match=r"FakeWorld\.act\(\) answered 'perhaps' to 'greet'; expected one of pos, neg, none"
    ):
        world.act("greet")


def test_recorded_tracks_have_the_class_of_the_person():
    data = Dataset(np.arange(8.0).reshape(4, 1, 2), ("a", "b", "a", "b"), channels=("x",))
    tracks = RecordedSignals("wish", data).simulate([{"wish": "b"}] * 20, np.random.default_rng(0))
    assert {float(track[0, 0]) for track in tracks} == {2.0, 6.0}
    with pytest.raises(DataError, match="no recorded case of class 'c' is left"):
        RecordedSignals("wish", data).simulate([{"wish": "c"}], np.random.default_rng(0))


def test_simulated_tracks_are_balanced_and_shuffled(rooms):
    (sense,) = rooms.domain.senses
    source = SimulatedSignals.from_domain(rooms.domain, sense)
    data = simulate_dataset(rooms.domain, sense, source, 31, np.random.default_rng(0))
    assert [data.labels.count(value) for value in rooms.domain.values] == [11, 11, 11]
    assert len(set(data.labels[:11])) > 1


def test_deciding_needs_no_torch_and_no_matplotlib():
    code = "import lcorpp.decision, lcorpp.domains, sys; lcorpp.domains.load_domain('intention')\n"
    code += "print(sorted({'torch', 'sklearn', 'matplotlib'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@dataclass(frozen=True)
class Scores:
    """Trajectories of one number, normal around .6 for interested people and -.6 for others: AUC .80."""

    def simulate(self, people, rng):
        means = [0.6 if person["intention"] == "interested" else -0.6 for person in people]
        return rng.normal(means)[:, None, None] * np.ones((1, 1, 2))


class Sigmoid:
    """The right probabilities for `Scores` where both kinds are equally common."""

    classes_ = np.array(["interested", "not_interested"])

    def predict_proba(self, tracks):
        p = 1 / (1 + np.exp(-1.2 * tracks[:, 0, 0]))
        return np.stack([p, 1 - p], axis=1)


@pytest.mark.slow
def test_soft_evidence_decides_better_than_the_label():
    """At AUC .80; how much is gained depends on the knowledge, that something is does not."""
    domain, rng = load_domain("intention"), np.random.default_rng(0)
    labels = np.array(Sigmoid.classes_)[np.arange(4000) % 2]
    tracks = Scores().simulate([{"intention": name} for name in labels], rng)
    probabilities = Sigmoid().predict_proba(tracks)
    counts = confusion_matrix(labels, Sigmoid.classes_[probabilities.argmax(axis=1)])
    calibration = fit_calibration(tuple(Sigmoid.classes_), probabilities, labels.tolist())
    trained = TrainedClassifier(Sigmoid(), ConfusionMatrix(tuple(Sigmoid.classes_), counts), calibration)
    planner = planning.Planner(planning.solve(domain.pomdp, domain.start_beliefs()))
    found = []
    for reader, program in (
        (trained, domain.program_for({"motion": trained.confusion})),
        (trained.soft(), domain.soft_program()),
    ):
        readers, rows = {"motion": reader}, strategies(["L+R", "LCORPP"])
        robot = Robot(readers, Reasoner(program), planner, domain)
        experiment = Experiment(domain, robot, readers, {"motion": Scores()}, rows, 3)
        found.append(run_trials(experiment, 8000)[0])
    for hard, soft in zip(*found, strict=True):
        assert soft.accuracy.estimate > hard.accuracy.estimate
        assert soft.f1.estimate > hard.f1.estimate
        assert soft.return_.estimate > hard.return_.estimate


def test_the_answers_of_each_person_have_random_numbers_of_their_own(rooms):
    chunk = ChunkSource(rooms).draw(2, 5)
    streams = [chunk.seed, *chunk.seeds]
    first = {tuple(np.random.default_rng(seed).random(3)) for seed in streams}
    assert len(first) == len(streams) == 6
    assert chunk.find_trial(0).seed == chunk.seeds[0]
