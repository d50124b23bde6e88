"""Wave files: samples of mono PCM files, and their conversion to the rate of the recogniser."""

from __future__ import annotations

import io
import struct
import wave
from math import gcd
from pathlib import Path

import numpy as np

from lcorpp.errors import DataError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.values import Array

RATE = 16_000
"""Samples per second of the recogniser."""

MIN_RATE, MAX_RATE = 4_000, 192_000
"""Limits of a file's samples per second."""

MAX_SECONDS = 600
"""Maximum length of a wave file."""


def read_wave(path: str | Path) -> tuple[Array, int]:
    """Read a wave file of mono PCM with 8 or 16 bits.

    Returns:
        (n,) the samples, from -1 to 1, and their number per second.

    Raises:
        FileError: the file cannot be read.
        DataError: it is no such file, it is cut, or it is longer than `MAX_SECONDS`.
    """
    content = read_bytes(path)
    try:
        with wave.open(io.BytesIO(content)) as file:
            channels, width, rate, n = file.getnchannels(), file.getsampwidth(), file.getframerate(), 0
            n = file.getnframes()
            data = file.readframes(min(n, len(content)))
    except (wave.Error, EOFError, OSError, RuntimeError, ValueError, struct.error) as error:
        reason = str(error) or "it ends too early"
        raise DataError(f"{path}: no wave file of PCM: {reason}; expected mono PCM of 8 or 16 bits") from None
    if channels != 1 or width not in (1, 2):
        raise DataError(
            f"{path}: {channels} channels of {8 * width} bits; expected mono PCM of 8 or 16 bits, e.g. by"
            f" sox IN.wav -c 1 -b 16 OUT.wav"
        )
    if not MIN_RATE <= rate <= MAX_RATE:
        raise DataError(f"{path}: {rate} samples per second; expected {MIN_RATE} to {MAX_RATE}")
    if len(data) != n * width:
        raise DataError(f"{path}: the file is cut: {len(data) // width} of {n} samples; copy it again")
    if n > MAX_SECONDS * rate:
        raise DataError(f"{path}: {n / rate:.0f} seconds; expected at most {MAX_SECONDS}")
    if width == 1:
        return (np.frombuffer(data, np.uint8).astype(np.float64) - 128) / 128, rate
    return np.frombuffer(data, "<i2").astype(np.float64) / 2**15, rate


def write_wave(path: str | Path, samples: Array, rate: int = RATE) -> None:
    """Write samples (n,) from -1 to 1 as a wave file of mono PCM with 16 bits; larger ones are clipped.

    Raises:
        FileError: the file cannot be written.
    """
    content = io.BytesIO()
    with wave.open(content, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(to_pcm(samples))
    write_atomically(path, content.getvalue())


def to_pcm(samples: Array) -> bytes:
    """Return samples (n,) as 16-bit little-endian PCM; those outside of -1 to 1 are clipped."""
    return np.round(np.clip(samples, -1, 1) * (2**15 - 1)).astype("<i2").tobytes()


def resample(samples: Array, rate: int) -> Array:
    """Return samples (n,) of another rate at `RATE`, by a polyphase filter."""
    if rate == RATE or not len(samples):
        return samples
    from scipy.signal import resample_poly

    divisor = gcd(rate, RATE)
    converted: Array = resample_poly(samples, RATE // divisor, rate // divisor)
    return converted
