from __future__ import annotations

import pytest

from lcorpp.learning.streaming.resampler import Clock


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
        ((0.0, 10.0, 10.1, 10.2), 1.1),  # all were silent
        ((50.0, 3.0, 3.1, 3.5), 1.4),  # a recording begins again
        ((0.0, 10.0, 20.0, 30.0, 40.0), 2.0),  # wide apart: still, time passes
    ],
)
def test_the_clock_ignores_single_wrong_stamps(stamps, seconds):
    assert passed(*stamps) == pytest.approx(seconds)
