from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError
from lcorpp.learning import check_trainable, split
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.values import Dataset, stack_signals, strip_padding

RAMP = np.linspace(0, 1, 5)


def small(labels: str, groups: str = "") -> Dataset:
    """One case per letter; the tracks differ."""
    tracks = np.arange(1, len(labels) + 1)[:, None, None] * RAMP * np.ones((2, 1))
    return Dataset(tracks, tuple(labels), tuple(groups))


def test_append_adds_a_row_and_leaves_the_old_data_set_unchanged():
    old = small("ab")
    new = old.append([(9 * np.ones((2, 5)), "b")], ["person 3"])
    assert len(old) == 2
    assert len(new) == 3
    assert new.labels[-1] == "b"
    assert new.groups == ("0", "1", "person 3")
    assert np.all(new.trajectories[2] == 9)
    assert np.array_equal(new.trajectories[:2], old.trajectories)


def test_append_of_another_shape_is_an_error():
    for track in (np.ones((3, 5)), np.ones(2)):
        with pytest.raises(DataError, match=r"shape \(.*\) does not fit .* \(2, 5\)"):
            small("ab").append([(track, "a")], ["g"])


def test_append_pads_the_shorter_tracks():
    data = small("ab")
    longer = data.append([(np.ones((2, 9)), "a"), (np.ones((2, 3)), "b")], ["c", "d"])
    assert longer.trajectories.shape == (4, 2, 9)
    assert longer.lengths.tolist() == [5, 5, 9, 3]
    for case, track in enumerate([*data.trajectories, np.ones((2, 9)), np.ones((2, 3))]):
        assert np.array_equal(strip_padding(longer.trajectories[case]), track)
    assert np.array_equal(longer.append([], []).trajectories, longer.trajectories, equal_nan=True)


def padded(lengths: list[int], channels: int = 2) -> np.ndarray:
    rng = np.random.default_rng(0)
    return stack_signals([rng.normal(size=(channels, n)) for n in lengths])


def test_padded_tracks_are_accepted_and_other_nan_located():
    tracks = padded([7, 3, 5])
    assert check_tracks(tracks) is tracks
    for case, channel, time in ((0, 1, 6), (1, 0, 2), (2, 1, 0)):
        bad = tracks.copy()
        bad[case, channel, time] = np.nan
        words = f"case {case}, channel {channel}, time point {time} .* finite number, or NaN in all channels"
        with pytest.raises(DataError, match=words):
            check_tracks(bad)
    infinite = tracks.copy()
    infinite[1, 0, 5] = np.inf  # within the padding
    with pytest.raises(DataError, match=r"case 1, channel 0, time point 3 \(counted from 0\) is nan"):
        check_tracks(infinite)


@pytest.mark.parametrize("points", [0, 1])
def test_a_padded_track_needs_two_points(points):
    tracks = padded([7, 3])
    tracks[1, :, points:] = np.nan
    with pytest.raises(
        DataError, match=rf"case 1 .* has {points} time points, the others are NaN; at least 2"
    ):
        check_tracks(tracks)


def test_equal_padded_tracks_are_refused():
    tracks = np.ones((4, 2, 5))
    tracks[:, :, 3:] = np.nan
    with pytest.raises(DataError, match="all 4 tracks are the same"):
        check_trainable(Dataset(tracks, tuple("abab")))


def test_append_of_no_rows_changes_nothing():
    assert small("ab").append([], []).labels == ("a", "b")


def test_data_of_a_single_class_are_an_error():
    with pytest.raises(DataError, match="all 3 cases are of class 'a'"):
        check_trainable(small("aaa"))
    with pytest.raises(DataError, match="there are no tracks; at least two classes are needed"):
        check_trainable(small("ab").take([]))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_not_finite_is_located(value):
    tracks = np.array(small("abab").trajectories)
    tracks[2, 1, 3] = value
    with pytest.raises(DataError, match=rf"case 2, channel 1, time point 3 .* is {value}"):
        check_trainable(Dataset(tracks, tuple("abab")))


def test_a_single_point_is_no_track():
    with pytest.raises(DataError, match="1 time points shows no motion; at least 2"):
        check_trainable(Dataset(np.zeros((2, 2, 1)), ("a", "b")))


def test_constant_data_is_refused():
    with pytest.raises(DataError, match="all 4 tracks are the same"):
        check_trainable(Dataset(np.ones((4, 2, 5)), tuple("abab")))


def test_too_few_groups_says_what_is_there_and_what_is_needed():
    with pytest.raises(DataError, match=r"3 folds need every class in at least 3 groups; .* a in 4, b in 2"):
        check_trainable(small("aaaabbb", "1234556"), folds=3)


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), people=st.integers(8, 40), share=st.floats(0.2, 0.8))
def test_split_keeps_groups_whole_and_every_case(seed, people, share):
    rng = np.random.default_rng(seed)
    group = rng.integers(0, people, 4 * people)
    group[:people] = np.arange(people)
    labels = np.where(group % 2 == 0, "a", "b")
    rows = np.arange(len(group))
    data = Dataset(rows[:, None, None] + np.zeros((1, 2, 2)), tuple(labels.tolist()), tuple(map(str, group)))
    train, test = split(data, test=share, seed=seed)
    assert not set(train.groups) & set(test.groups)
    assert sorted([*train.trajectories[:, 0, 0], *test.trajectories[:, 0, 0]]) == rows.tolist()


def test_split_is_in_proportion_and_repeatable():
    data = small("a" * 60 + "b" * 40)
    train, test = split(data, seed=4)
    assert (test.labels.count("a"), test.labels.count("b")) == (18, 12)
    assert (len(train), len(test)) == (70, 30)
    assert split(data, seed=4)[1].groups == test.groups != split(data, seed=5)[1].groups


def test_a_split_that_leaves_a_side_without_a_class_is_an_error():
    with pytest.raises(DataError, match=r"a test share of 0.3 leaves the test data without b"):
        split(small("aaaaaaaaab"), seed=0)
    with pytest.raises(DataError, match="between 0 and 1, not 1"):
        split(small("ab"), test=1, seed=0)
