from __future__ import annotations

import numpy as np
import pytest

from lcorpp.learning.streaming.clock import BLOCK, MAX_BASES, Clock, StampCheck


def passed(*stamps: float) -> float:
    clock = Clock(1.0)
    for stamp in stamps:
        clock.observe(stamp)
    return clock.elapsed


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        ((100.0, 100.5, 101.5), 1.5),
        ((0.0, 0.5, 0.4, 0.45, 0.6), 0.6),  # late ones count once
        ((0.0, 1e6, 0.5, -1e6, 1.0), 1.0),  # wrong ones do not count
        ((0.0, 0.1, 9e9, 9e9, 9e9, 0.2), 0.2),  # nor do those of a whole message
        ((0.0, 10.0, 10.1, 10.2), 1.1),  # all were silent
        ((50.0, 3.0, 3.1, 3.5), 1.4),  # a recording begins again
        ((5.0, 5.0, 5.0), 0.0),
    ],
)
def test_the_clock_ignores_wrong_stamps(stamps, seconds):
    assert passed(*stamps) == pytest.approx(seconds)


def frames(seconds, offsets):
    return [offset + t for t in np.arange(0, seconds, 0.1) for offset in offsets]


def test_people_whose_stamps_differ_by_an_offset_do_not_speed_the_clock_up():
    assert passed(*frames(20.05, (0, 0, 3600, 3600, -7, -7))) == pytest.approx(20.0)


def test_a_wrong_stamp_each_25_seconds_does_not_speed_the_clock_up():
    stamps = frames(200.05, (0, 0))
    for place in range(500, len(stamps), 500):
        stamps[place] += 3e7
    assert passed(*stamps) == pytest.approx(200.0)


def test_a_clock_that_was_reset_continues_after_one_step():
    assert passed(*frames(10.05, (1e9,)), *frames(10.05, (3.0,)), *frames(10.05, (1e9,))) == pytest.approx(
        10 + 1 + 9.9 + 1 + 9.9
    )


def test_time_passes_however_far_the_stamps_are_apart():
    assert passed(*np.arange(100) * 50.0) == pytest.approx(99 // MAX_BASES)
    ids = [100 * frame for frame in range(50) for _ in range(3)]  # a new id each time, three in a frame
    assert passed(*ids) == pytest.approx(49 // MAX_BASES)


def test_stamps_stand_still_if_more_than_half_of_a_block_is_not_used():
    for share, expected in ((0.0, False), (0.5, False), (0.6, True), (1.0, True)):
        check = StampCheck()
        found = [check.observe(number >= share * BLOCK) for number in range(BLOCK)]
        assert any(found) is expected
