"""Trials: the same for any number of processes, on any domain; people and answers as often as they should."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lcorpp import planning
from lcorpp.decision import STRATEGIES, Robot
from lcorpp.domains import load_domain
from lcorpp.errors import DataError, DecisionError, DomainError
from lcorpp.experiments import trials
from lcorpp.experiments.people import Channel, Motion, Population, Recorded, simulated_dataset
from lcorpp.experiments.simulated_world import Stage
from lcorpp.experiments.trials import Experiment, run_trials
from lcorpp.reasoning import Enumeration
from lcorpp.values import Dataset

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"


@pytest.fixture(scope="module")
def rooms() -> Experiment:
    domain = load_domain(ROOMS)
    channel = Channel.of(domain)
    planner = planning.Planner(domain.pomdp, planning.solve(domain.pomdp, domain.starts()).policy)
    robot = Robot(channel, Enumeration(domain.program), planner, domain)
    return Experiment(domain, robot, channel, channel, STRATEGIES, 3)


def test_a_made_up_domain_runs_all_strategies(rooms):
    results, done = run_trials(rooms, 300)
    assert done == 300
    by_name = {result.strategy: result for result in results}
    assert list(by_name) == [row.name for row in STRATEGIES]
    assert by_name["LCORPP"].earned.value > by_name["L+R"].earned.value
    assert all(np.sum(result.counts) == 300 for result in results)


def test_the_result_does_not_depend_on_the_processes(rooms):
    """Shows 7."""
    one, _ = run_trials(rooms, 350, jobs=1)
    two, _ = run_trials(rooms, 350, jobs=2)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.counts, b.counts)
        assert (a.cost, a.earned, a.cost_sd) == (b.cost, b.earned, b.cost_sd)


def test_a_strategy_alone_meets_the_same_people(rooms):
    together, _ = run_trials(rooms, 200)
    alone, _ = run_trials(replace(rooms, strategies=STRATEGIES[-1:]), 200)
    np.testing.assert_array_equal(together[-1].counts, alone[0].counts)
    assert together[-1].cost == alone[0].cost


def test_another_seed_is_another_result(rooms):
    one, _ = run_trials(rooms, 100)
    other, _ = run_trials(replace(rooms, seed=4), 100)
    assert any((a.counts != b.counts).any() for a, b in zip(one, other, strict=True))


def test_an_interruption_keeps_what_is_done(rooms, monkeypatch):
    honest = trials.run_chunk

    def tired(experiment, number, size):
        if number == 2:
            raise KeyboardInterrupt
        return honest(experiment, number, size)

    monkeypatch.setattr(trials, "run_chunk", tired)
    results, done = run_trials(rooms, 1000)
    assert done == 2 * trials.CHUNK
    monkeypatch.undo()
    whole, _ = run_trials(rooms, 2 * trials.CHUNK)
    np.testing.assert_array_equal(results[0].counts, whole[0].counts)


def test_nothing_done_is_nothing_to_keep(rooms, monkeypatch):
    def tired(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(trials, "run_chunk", tired)
    with pytest.raises(KeyboardInterrupt):
        run_trials(rooms, 100)
    with pytest.raises(DecisionError, match="at least 1, not 0 and 1"):
        run_trials(rooms, 0)


def test_people_come_as_the_truth_program_says():
    """P(interested) = .4 (.3, .1 and .8 in equal parts); 4000 people, so 4 standard errors are .031."""
    people = Population(load_domain("intention")).people(4000, np.random.default_rng(2))
    share = np.mean([person["intention"] == "interested" for person in people])
    assert abs(share - 0.4) < 0.031
    library = np.mean([p["location"] == "library" for p in people if p["identity"] == "visitor"])
    assert abs(library - 0.8) < 0.05


def test_cells_are_exact():
    cells = Population(load_domain("intention")).cells(("identity", "intention"))
    assert cells["visitor", "interested"] == pytest.approx(0.8 / 3)
    assert sum(cells.values()) == pytest.approx(1)


def test_a_channel_errs_at_its_rates():
    channel = Channel("wish", ("a", "b"), np.array([[0.76, 0.24], [0.29, 0.71]]))
    people = [{"wish": "a"}] * 20_000 + [{"wish": "b"}] * 20_000
    said = np.array(channel.classify_many(channel.trajectories(people, np.random.default_rng(0))))
    # standard errors are .003
    assert np.mean(said[:20_000] == "a") == pytest.approx(0.76, abs=0.012)
    assert np.mean(said[20_000:] == "a") == pytest.approx(0.29, abs=0.013)


def test_answers_are_flipped_with_the_noise_and_scored_by_the_truth():
    domain = load_domain("intention")
    stage, rng = Stage(domain), np.random.default_rng(1)
    worlds = [stage.world({"intention": "interested"}, rng) for _ in range(5000)]
    answers = [world.act("greet") for world in worlds]
    assert set(answers) == {"pos", "neg"}
    assert np.mean(np.array(answers) == "pos") == pytest.approx(0.7, abs=0.026)  # 4 standard errors
    worlds[0].act("turn")
    worlds[0].report("report_interested")
    assert (worlds[0].cost, worlds[0].earned) == (6.5, 73.5)
    worlds[1].report("report_not_interested")
    assert (worlds[1].cost, worlds[1].earned) == (2.0, -82.0)


def test_a_reaction_of_ones_own():
    domain = load_domain("intention")
    honest = replace(domain.simulation, reaction=lambda person, action, rng: "neg")
    world = Stage(replace(domain, simulation=honest)).world(
        {"intention": "interested"}, np.random.default_rng(0)
    )
    assert world.act("greet") == "neg"
    odd = replace(domain.simulation, reaction=lambda person, action, rng: "perhaps")
    world = Stage(replace(domain, simulation=odd)).world(
        {"intention": "interested"}, np.random.default_rng(0)
    )
    with pytest.raises(DomainError, match=r"reaction\(\) answered 'perhaps'; expected one of pos, neg, none"):
        world.act("greet")


def test_recorded_people_are_of_the_right_kind():
    data = Dataset(np.arange(8.0).reshape(4, 1, 2), ("a", "b", "a", "b"))
    tracks = Recorded("wish", data).trajectories([{"wish": "b"}] * 20, np.random.default_rng(0))
    assert {float(track[0, 0]) for track in tracks} == {2.0, 6.0}
    with pytest.raises(DataError, match="no recorded track of class 'c' is left"):
        Recorded("wish", data).trajectories([{"wish": "c"}], np.random.default_rng(0))


def test_simulated_tracks_are_balanced_and_shuffled(rooms):
    assert rooms.domain.simulation.trajectories is not None
    motion = Motion(rooms.domain.simulation.trajectories)
    data = simulated_dataset(rooms.domain, motion, 31, np.random.default_rng(0))
    assert [data.labels.count(value) for value in rooms.domain.values] == [11, 11, 11]
    assert len(set(data.labels[:11])) > 1


def test_deciding_needs_no_torch_and_no_matplotlib():
    code = "import lcorpp.decision, lcorpp.domains, sys; lcorpp.domains.load_domain('intention')\n"
    code += "print(sorted({'torch', 'sklearn', 'matplotlib'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
