"""Noises that are mixed with synthetic speech: white noise and babble at a signal-to-noise ratio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.errors import DataError, expected_one_of
from lcorpp.values import Array
from lcorpp.worlds.speech.waves import RATE

KINDS = ("clean", "white", "babble")

MIN_SNR, MAX_SNR = -20.0, 60.0
"""Limits of the signal-to-noise ratio in dB."""

SPEECH_LEVEL = 0.05
"""Root mean square of speech, where full scale is 1."""

CLEAN_LEVEL = 1e-4
"""Root mean square of the hiss of a clean recording."""

TALKERS = 6
"""Number of people whose talk is mixed to babble."""

MAX_GAP = 0.25
"""Longest pause of such a person between two sentences, in seconds."""

LEAD, TAIL = 0.7, 0.8
"""Seconds of noise before and after an utterance."""


@dataclass(frozen=True)
class Noise:
    """A noise, and its share in a mix of noises.

    kind: clean, white or babble.
    snr: in dB, the power of the utterance over that of the noise; of clean speech infinite.
    share: in the mix, from 0 to 1.
    """

    kind: str
    snr: float
    share: float

    @property
    def name(self) -> str:
        """For tables, e.g. ``white:20``."""
        return self.kind if self.kind == "clean" else f"{self.kind}:{self.snr:g}"

    @property
    def level(self) -> float:
        """Root mean square of the noise."""
        return CLEAN_LEVEL if self.kind == "clean" else SPEECH_LEVEL * 10 ** (-self.snr / 20)


def parse_noises(text: str) -> tuple[Noise, ...]:
    """Return the mix of a text such as ``clean,white:20,babble:20``.

    All have the same share, or each has one after an @, ``clean@.6,white:20@.4``, which sum to 1.

    Raises:
        DataError: a noise is unknown or repeated, a ratio is missing or out of range, or shares do not sum
            to 1.
    """
    items = [item.strip() for item in text.split(",")]
    noises = []
    for item in items:
        name, at, share = item.partition("@")
        kind, colon, ratio = name.partition(":")
        if kind not in KINDS or (kind == "clean") == bool(colon):
            raise DataError(f"the noise {item!r}: {expected_one_of(('clean', 'white:SNR', 'babble:SNR'))}")
        snr = np.inf if kind == "clean" else _read_number(ratio, MIN_SNR, MAX_SNR, f"the noise {item!r}: SNR")
        part = _read_number(share, 0, 1, f"the noise {item!r}: share") if at else 1 / len(items)
        noises.append(Noise(kind, snr, part))
    names = [noise.name for noise in noises]
    if len(set(names)) < len(names):
        raise DataError(f"the noises {text!r}: one is repeated; expected each once")
    total = sum(noise.share for noise in noises)
    if abs(total - 1) > 1e-6:
        raise DataError(f"the noises {text!r}: the shares sum to {total:g}, not 1")
    return tuple(noises)


def _read_number(text: str, low: float, high: float, what: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    if not low <= number <= high:
        raise DataError(f"{what} is {text!r}; expected a number from {low:g} to {high:g}")
    return number


def set_level(speech: Array) -> Array:
    """Return speech (n,) without silence at its ends, at `SPEECH_LEVEL`.

    Raises:
        DataError: there is no sound.
    """
    loud = np.flatnonzero(np.abs(speech) > 0.02 * np.abs(speech).max(initial=0))
    if not len(loud):
        raise DataError("a recording without sound")
    kept = speech[loud[0] : loud[-1] + 1]
    scaled: Array = kept * (SPEECH_LEVEL / np.sqrt(np.mean(kept**2)))
    return scaled


def add_noise(speech: Array, noise: Noise, talk: Sequence[Array], rng: np.random.Generator) -> Array:
    """Return speech (n,) at `SPEECH_LEVEL` with noise before, during and after it.

    Args:
        talk: what others say, for babble; each (m,) at `SPEECH_LEVEL`.
    """
    padded = np.concatenate([np.zeros(round(LEAD * RATE)), speech, np.zeros(round(TAIL * RATE))])
    return padded + make_noise(noise, len(padded), talk, rng)


def make_noise(noise: Noise, n: int, talk: Sequence[Array], rng: np.random.Generator) -> Array:
    """Return n samples of noise alone; `talk` as in `add_noise`."""
    if noise.kind != "babble":
        return rng.normal(scale=noise.level, size=n)
    mixed = np.zeros(n)
    for _ in range(TALKERS):
        place = -int(rng.integers(RATE))  # the first sentence has begun before
        while place < n:
            sentence = talk[int(rng.integers(len(talk)))]
            begin, end = max(place, 0), min(place + len(sentence), n)
            if end > begin:
                mixed[begin:end] += sentence[begin - place : end - place]
            place += len(sentence) + int(rng.integers(1, round(MAX_GAP * RATE)))
    scaled: Array = mixed * (noise.level / np.sqrt(np.mean(mixed**2) + 1e-12))
    return scaled
