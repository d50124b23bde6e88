"""The published .pomdpx files, compared with known facts about them."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.planning import flatten, format_pomdpx, read_factored, read_pomdp, read_pomdpx, write_pomdpx
from tests.planning.models import shared_model


def test_hallway_is_the_same_in_both_formats():
    mine = read_pomdpx(shared_model("Hallway.pomdpx"))
    theirs = read_pomdp(shared_model("hallway.pomdp"))
    for ours, others in ((mine.transition, theirs.transition), (mine.observation, theirs.observation)):
        assert (np.asarray(ours) == np.asarray(others)).all()
    assert (mine.reward == theirs.reward).all()
    assert (mine.start == theirs.start).all()


@pytest.mark.parametrize("name", ["tiger.95.pomdp", "tiger.symbolic.pomdp", "tiger.aaai.pomdp"])
def test_tiger_is_the_same_in_both_formats(name):
    mine, theirs = read_pomdpx(shared_model("Tiger.pomdpx")), read_pomdp(shared_model(name))
    assert (mine.states, mine.actions) == (theirs.states, theirs.actions)
    assert (np.asarray(mine.transition) == np.asarray(theirs.transition)).all()
    # 1e-16: one of the files is written with other digits, and its rows are normalised
    assert np.abs(np.asarray(mine.observation) - np.asarray(theirs.observation)).max() < 1e-16
    assert (mine.reward == theirs.reward).all()
    # of these the one of the paper discounts by .75
    assert (mine.discount == theirs.discount) == (name != "tiger.aaai.pomdp")


def test_tag_differs_from_the_other_file_in_a_few_moves():
    """In the .pomdp file the target jumps in a few cells, and `yes` hides at the robot's place."""
    mine, theirs = read_pomdpx(shared_model("TagAvoid.pomdpx")), read_pomdp(shared_model("tag-avoid.pomdp"))
    assert mine.actions == theirs.actions
    differing = np.abs(np.asarray(mine.transition) - np.asarray(theirs.transition)) > 1e-6
    assert differing.sum() == 44
    assert {mine.states[s] for s in np.flatnonzero(differing.any(axis=(0, 2)))} == {
        "robot=Srv3rh9,target=Ttv3th9",
        "robot=Srv1rh7,target=Ttv1th5",
        "robot=Srv0rh6,target=Ttv1th6",
        "robot=Srv0rh6,target=Ttv0th6",
    }
    assert (mine.reward == theirs.reward).all()
    assert np.abs(mine.start - theirs.start).max() < 1e-12
    places = list(dict.fromkeys(state.split(",")[0] for state in mine.states))
    shown = np.zeros((len(mine.observations), len(theirs.observations)))
    for i, name in enumerate(mine.observations):
        robot, sensor = name.split(",")
        shown[i, -1 if sensor == "obs_sensor=yes" else places.index(robot)] = 1
    assert (np.asarray(mine.observation) @ shown == np.asarray(theirs.observation)).all()


def test_rock_sample_becomes_flat_without_its_zeros():
    problem = read_factored(shared_model("RockSample_7_8.pomdpx"))
    assert [v.name for v in problem.observed] == ["robot"]
    flat = flatten(problem)
    assert (len(flat.states), len(flat.actions), len(flat.observations)) == (50 * 256, 13, 49 * 2 + 1)
    assert len(flat.transition.values) == 13 * 50 * 256
    good = [
        flat.state_index(f"robot=s20,rock0={rock}" + "".join(f",rock{i}=bad" for i in range(1, 8)))
        for rock in ("good", "bad")
    ]
    sample, check = flat.action_index("as"), flat.action_index("ac0")
    assert flat.reward[sample, good].tolist() == [10, -10]
    assert flat.transition.row(sample, good[0])[0].tolist() == [good[1]]
    # beside the rock the sensor does not err
    assert flat.observation.row(check, good[0])[1].tolist() == [1.0]
    assert flat.start[flat.start > 0].tolist() == [1 / 256] * 256
    assert format_pomdpx(problem).count("<Entry>") < 1700


@pytest.mark.parametrize(
    "name", ["Hallway.pomdpx", "TagAvoid.pomdpx", "Tiger.pomdpx", "RockSample_7_8.pomdpx"]
)
def test_published_files_come_back_the_same(name, tmp_path):
    problem = read_factored(shared_model(name))
    write_pomdpx(problem, tmp_path / name)
    back = read_factored(tmp_path / name)
    assert back.equals(problem)
    assert flatten(back).fingerprint == flatten(problem).fingerprint
