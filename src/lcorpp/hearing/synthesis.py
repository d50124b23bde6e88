"""Parts of synthetic sounds: oscillators, modulations, filters and repetitions; all samples are at `RATE`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

from lcorpp.values import Array
from lcorpp.worlds.speech.waves import RATE


def draw_log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def oscillate(rng: np.random.Generator, frequency: Array, partials: int | None = None) -> Array:
    """Return a tone of a frequency (n,) in Hz, with harmonics of random levels below half the rate."""
    number = partials or int(rng.choice((1, 2, 4, 8, 20)))
    phase, decay = 2 * np.pi * np.cumsum(frequency) / RATE, rng.uniform(0.3, 2.0)
    tone = np.zeros(len(frequency))
    for k in range(1, number + 1):
        level = 1.0 if k == 1 else rng.uniform(0.2, 1) * k**-decay
        tone += np.where(k * frequency < RATE / 2, level * np.sin(k * phase + rng.uniform(0, 2 * np.pi)), 0)
    return tone


def modulate(rng: np.random.Generator, n: int, low: float, high: float) -> Array:
    """Return a sine (n,) of a random frequency, as a modulation."""
    rate = draw_log_uniform(rng, low, high)
    wave: Array = np.sin(2 * np.pi * (rate * np.arange(n) / RATE + rng.uniform()))
    return wave


def drift(rng: np.random.Generator, n: int, rate: float) -> Array:
    """Return a random curve (n,) with unit variance that changes `rate` times a second."""
    points = rng.normal(size=max(4, round(n / RATE * rate) + 2))
    return np.interp(np.linspace(0, len(points) - 1, n), np.arange(len(points)), points)


def filter_band(noise: Array, low: float, high: float) -> Array:
    """Return noise (n,) between two frequencies in Hz."""
    band: Array = sosfilt(butter(2, (low, high), "bandpass", fs=RATE, output="sos"), noise)
    return band


def resonate(signal: Array, frequency: float, width: float) -> Array:
    """Return the signal through a resonance of a frequency and a bandwidth in Hz."""
    radius = np.exp(-np.pi * width / RATE)
    poles = [1, -2 * radius * np.cos(2 * np.pi * frequency / RATE), radius**2]
    resonance: Array = lfilter([1 - radius], poles, signal)
    return resonance


def repeat_event(
    rng: np.random.Generator, n: int, gaps: tuple[float, float], event: Callable[[], Array]
) -> Array:
    """Return n samples of events, one after a random gap in seconds from begin to begin."""
    sound, place = np.zeros(n), 0
    while place < n:
        part = event()[: n - place]
        sound[place : place + len(part)] += part
        place += max(round(rng.uniform(*gaps) * RATE), 1)
    return sound


def play_note(
    rng: np.random.Generator, frequency: float, seconds: float, partials: int, decay: float
) -> Array:
    """Return a note of a frequency in Hz and a decay in nepers a second."""
    t = np.arange(round(seconds * RATE)) / RATE
    rise = np.minimum(t / rng.uniform(0.003, 0.05), 1)
    fall = np.exp(-t * decay) * np.minimum((seconds - t) / 0.01, 1)
    note: Array = oscillate(rng, np.full(len(t), frequency), partials) * rise * fall
    return note


def mix(a: Array, b: Array, level: float) -> Array:
    """Return a sound with another one at a level, as long as the shorter one."""
    n = min(len(a), len(b))
    mixed: Array = a[:n] + level * b[:n]
    return mixed
