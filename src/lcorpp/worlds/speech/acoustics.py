"""Acoustic measures of an utterance: its level, its pitch and the width of its spectrum over time.

Speech alternates between voiced and unvoiced sounds, its pitch glides, and its spectrum is at times narrow
and at times wide. A tone, a motor or a fan does not change, music changes in steps, and knocks have no pitch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.values import Array, Flags
from lcorpp.worlds.speech.waves import RATE

STEP = 160
"""Samples from one frame to the next: 10 ms, as those of pocketsphinx."""

LENGTH = 640
"""Samples of a frame: 40 ms, two periods of a low voice."""

LOUD_RANGE, LOUD_MARGIN, MIN_LOUD_RANGE = 20.0, 3.0, 6.0
"""A loud frame is less than `LOUD_RANGE` below the loudest ones and at least `LOUD_MARGIN` above the quiet
ones, or less than `MIN_LOUD_RANGE` below the loudest ones, in dB: in a steady sound all frames are loud."""

MIN_LEVEL = -100.0
"""Level of digital silence, in dB."""

MAX_CONTRAST = 60.0
"""In dB: that of a clean recording depends on its hiss alone."""

PITCH_LAGS = (40, 240)
"""Periods of a voice in samples: 400 to 67 Hz."""

MIN_PERIODICITY = 0.5
"""A voiced frame has at least this periodicity."""

OCTAVE = 0.9
"""The period is the shortest lag with a peak of this part of the highest one: twice a period is one, too."""

GLIDE = (0.002, 0.06)
"""Changes of the pitch of a voice within a step, in octaves: a tone has smaller ones, music larger ones."""

BANDS, BAND_LIMITS = 18, (150.0, 3800.0)
"""Number of mel bands, and their limits in Hz: those of a telephone."""

BAND_RANGE = 30.0
"""Bands are at least at this level below the strongest one of the frame, in dB."""


@dataclass(frozen=True, eq=False)
class Acoustics:
    """The n frames of an utterance; frame i begins at sample i * `STEP`.

    level: (n,) in dB. periodicity: (n,) from 0 to 1, the correlation with the signal a period later.
    pitch: (n,) in octaves above 1 Hz, for voiced frames.
    width: (n,) entropy of the power over mel bands, in nats: 0 if one band has all power.
    """

    level: Array
    periodicity: Array
    pitch: Array
    width: Array

    @property
    def is_loud(self) -> Flags:
        """(n,) whether a frame is loud."""
        quiet, loud = np.quantile(self.level, [0.1, 0.95])
        chosen: Flags = self.level >= loud - np.clip(loud - quiet - LOUD_MARGIN, MIN_LOUD_RANGE, LOUD_RANGE)
        return chosen

    @property
    def is_voiced(self) -> Flags:
        """(n,) whether a frame has a pitch."""
        return self.periodicity >= MIN_PERIODICITY

    def measure_voicing(self) -> float:
        """Return the share of voiced frames."""
        return float(self.is_voiced.mean())

    def measure_longest_voicing(self) -> float:
        """Return the longest time for which frames are voiced and loud, in seconds."""
        voiced = np.concatenate([[False], self.is_voiced & self.is_loud, [False]])
        edges = np.flatnonzero(np.diff(voiced))
        return float((edges[1::2] - edges[::2]).max(initial=0) * STEP / RATE)

    def measure_periodicity_change(self) -> float:
        """Return the standard deviation of the periodicity of loud frames."""
        return float(self.periodicity[self.is_loud].std())

    def measure_glides(self) -> float:
        """Return the share of the steps between voiced frames in which the pitch changes as a voice's."""
        voiced = self.is_voiced & self.is_loud
        change = np.abs(np.diff(self.pitch))[voiced[1:] & voiced[:-1]]
        if not len(change):
            return 0.0
        return float(np.mean((change > GLIDE[0]) & (change < GLIDE[1])))

    def measure_width(self) -> tuple[float, float]:
        """Return the mean and the standard deviation of the width of loud frames."""
        width = self.width[self.is_loud]
        return float(width.mean()), float(width.std())

    def measure_contrast(self) -> float:
        """Return the level of the loudest frames (95 %) above the quiet ones (10 %), in dB, at most 60."""
        quiet, loud = np.quantile(self.level, [0.1, 0.95])
        return float(min(loud - quiet, MAX_CONTRAST))


def analyse(samples: Array) -> Acoustics:
    """Return the frames of samples (n,) at `RATE`; a sound shorter than a frame is one frame."""
    padded = np.pad(samples, (0, max(0, LENGTH - len(samples))))
    frames = np.lib.stride_tricks.sliding_window_view(padded, LENGTH)[::STEP]
    frames = frames - frames.mean(axis=1, keepdims=True)
    level = 10 * np.log10(np.mean(frames**2, axis=1) + 10 ** (MIN_LEVEL / 10))
    periodicity, pitch = _find_pitch(frames)
    return Acoustics(level, periodicity, pitch, _measure_width(frames))


def _find_pitch(frames: Array) -> tuple[Array, Array]:
    """Return the periodicity and the pitch (n,) of frames (n, LENGTH).

    Source: Boersma 1993: the autocorrelation of a windowed frame over that of the window.
    """
    low, high = PITCH_LAGS
    correlation = _correlate(frames * np.hanning(LENGTH), high) / _correlate(np.hanning(LENGTH)[None], high)
    inner = correlation[:, low:high]
    is_peak = (inner >= correlation[:, low - 1 : high - 1]) & (inner >= correlation[:, low + 1 : high + 1])
    highest = np.max(inner, axis=1, where=is_peak, initial=0.0)
    place = low + np.argmax(is_peak & (inner >= OCTAVE * highest[:, None]), axis=1)
    before, peak, after = (
        np.take_along_axis(correlation, (place + shift)[:, None], axis=1)[:, 0] for shift in (-1, 0, 1)
    )
    curvature = before - 2 * peak + after  # of the parabola through the three
    shift = np.where(curvature < -1e-9, 0.5 * (before - after) / np.minimum(curvature, -1e-9), 0.0)
    return highest, np.log2(RATE / (place + np.clip(shift, -0.5, 0.5)))


def _correlate(frames: Array, max_lag: int) -> Array:
    """Return the autocorrelation (n, max_lag + 1) of frames (n, LENGTH) over that at lag 0."""
    power = np.abs(np.fft.rfft(frames, 2 * LENGTH, axis=1)) ** 2
    correlation = np.fft.irfft(power, axis=1)[:, : max_lag + 1]
    normalised: Array = correlation / (correlation[:, :1] + 1e-12)
    return normalised


def _measure_width(frames: Array) -> Array:
    """Return the entropy (n,) of the power of frames over mel bands."""
    power = np.abs(np.fft.rfft(frames * np.hanning(LENGTH), axis=1)) ** 2 @ _make_bands().T
    power = np.maximum(power, power.max(axis=1, keepdims=True) * 10 ** (-BAND_RANGE / 10)) + 1e-12
    share = power / power.sum(axis=1, keepdims=True)
    entropy: Array = -(share * np.log(share)).sum(axis=1)
    return entropy


def _make_bands() -> Array:
    """Return triangular mel bands (BANDS, LENGTH // 2 + 1), each with weights that sum to 1."""
    ends = 2595 * np.log10(1 + np.array(BAND_LIMITS) / 700)
    edges = 700 * (10 ** (np.linspace(ends[0], ends[1], BANDS + 2) / 2595) - 1)
    frequency = np.arange(LENGTH // 2 + 1) * RATE / LENGTH
    low, centre, high = edges[:-2, None], edges[1:-1, None], edges[2:, None]
    bands = np.minimum((frequency - low) / (centre - low), (high - frequency) / (high - centre)).clip(0)
    normalised: Array = bands / bands.sum(axis=1, keepdims=True)
    return normalised
