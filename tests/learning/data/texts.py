"""Small recordings with a known answer, and their texts."""

from __future__ import annotations

import numpy as np

from lcorpp.learning import Recording, Track

HEADING = "track,time,x,y,label\n"


def rows(name: str, label: str, *, samples: int = 12, start: float = 0.0, speed: float = 1.0) -> str:
    """A walk along x, ten samples a second."""
    times = [start + i / 10 for i in range(samples)]
    return "".join(f"{name},{t:.1f},{speed * (t - start):.2f},2.00,{label}\n" for t in times)


GOOD = HEADING + rows("a", "in") + rows("b", "out", speed=0.5)
"""Track a on lines 2 to 13, b on 14 to 25."""


def atc_rows(name: int, *, samples: int = 12, start: float = 1350867600.0, speed: float = 1.0) -> str:
    """The same walk in the form of ATC data."""
    return "".join(
        f"{start + i / 10:.3f},{name},{100 * speed * i:.0f},2000,1500,{1000 * speed:.0f},0.000,3.100\n"
        for i in range(samples)
    )


def walk(
    name: str, label: str | None = "in", *, seconds: float = 12.0, rate: float = 30.0, **columns
) -> Track:
    """A walk along x at 1 m/s that begins at 5 s."""
    times = 5 + np.arange(round(seconds * rate) + 1) / rate
    return Track(name, times, {"x": times - 5, "y": np.full(len(times), 2.0), **columns}, label)


def crowd(tracks: int = 40, *, seed: int = 0) -> Recording:
    """Straight walks of two classes, all alike but for chance."""
    rng = np.random.default_rng(seed)
    made = []
    for number in range(tracks):
        times = np.cumsum(rng.normal(0.1, 0.005, rng.integers(100, 120)))
        angle, noise = rng.uniform(0, 2 * np.pi), rng.normal(0, 0.03, (2, len(times)))
        start = rng.normal(0, 3, 2)
        x = start[0] + np.cos(angle) * times + noise[0]
        y = start[1] + np.sin(angle) * times + noise[1]
        made.append(Track(str(number), times, {"x": x, "y": y}, ("in", "out")[number % 2]))
    return Recording(tuple(made), "a crowd")
