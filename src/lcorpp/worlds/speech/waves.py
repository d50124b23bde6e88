"""Wave files: samples of PCM or float files, and their conversion to the rate of the recogniser."""

from __future__ import annotations

import io
import struct
import wave
from dataclasses import dataclass
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

STREAMED = 0x7FFFF000
"""Sizes from here on are those of programs that write to a pipe and do not know the size, e.g. sox, espeak-ng
(this number), arecord and ffmpeg (0xFFFFFFFF)."""

PCM, FLOAT, EXTENSIBLE = 1, 3, 0xFFFE
"""Format tags of a wave file."""

SUBTYPE = bytes.fromhex("000000001000800000aa00389b71")
"""An extensible format's GUID after its first two bytes, which are a format tag."""

ENCODINGS = {
    2: "ADPCM",
    6: "A-law",
    7: "mu-law",
    0x11: "IMA ADPCM",
    0x31: "GSM",
    0x50: "MPEG",
    0x55: "MP3",
}
"""Format tag -> name of an encoding that is not read."""

CONTAINERS = {
    b"RF64": "RF64",
    b"BW64": "BW64",
    b"RIFX": "big-endian RIFX",
    b"riff": "Wave64",
    b"FORM": "AIFF",
    b"OggS": "Ogg",
    b"fLaC": "FLAC",
    b"caff": "CAF",
    b".snd": "AU",
    b"ID3\x03": "MP3",
    b"ID3\x04": "MP3",
}
"""First bytes of a file -> name of a format that is not read."""

EXPECTED = "expected a wave file of PCM or float samples, e.g. by sox IN -c 1 -b 16 OUT.wav"


@dataclass(frozen=True)
class Form:
    """How a wave file encodes its samples: the chunk ``fmt``.

    tag: `PCM` or `FLOAT`. channels, rate: numbers of channels and of samples per second.
    width: bytes of a sample of one channel. frame: bytes of a sample of all channels.
    """

    tag: int
    channels: int
    rate: int
    width: int
    frame: int


def read_wave(path: str | Path) -> tuple[Array, int]:
    """Read a wave file of PCM with up to 32 bits, or of float samples with 32 or 64 bits.

    Of several channels the mean is returned. The format may be extensible. A header that states no size, as
    programs write it to a pipe, is read to the end of the file. Float samples beyond -1 and 1 are clipped.

    Returns:
        (n,) the samples, from -1 to 1, and their number per second.

    Raises:
        FileError: the file cannot be read.
        DataError: it is no such file, it is cut, or it is longer than `MAX_SECONDS`.

    Source: Multimedia Programming Interface and Data Specifications 1.0 (IBM and Microsoft, 1991).
    """
    content = read_bytes(path)
    try:
        form, data, stated = _find_samples(content)
        n = stated // form.frame
        if not MIN_RATE <= form.rate <= MAX_RATE:
            raise DataError(f"{form.rate} samples per second; expected {MIN_RATE} to {MAX_RATE}")
        if len(data) < n * form.frame:
            raise DataError(f"the file is cut: {len(data) // form.frame} of {n} samples; copy it again")
        if n > MAX_SECONDS * form.rate:
            raise DataError(f"{n / form.rate:.0f} seconds; expected at most {MAX_SECONDS}")
        channels = _decode(data[: n * form.frame], form).reshape(n, form.channels)
        return channels[:, 0] if form.channels == 1 else channels.mean(axis=1), form.rate
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def _find_samples(content: bytes) -> tuple[Form, bytes, int]:
    """Return the format, the bytes from the first sample on, and the number that the header states."""
    if content[:4] != b"RIFF" or content[8:12] != b"WAVE":
        name = CONTAINERS.get(content[:4])
        raise DataError(f"not a wave file of PCM{f' but {name}' if name else ''}; {EXPECTED}")
    form, place, total = None, 12, _read_size(content, 4)
    while place + 8 <= len(content):
        chunk, size, begin = content[place : place + 4], _read_size(content, place + 4), place + 8
        if chunk == b"fmt ":
            form = _read_form(content[begin : begin + size])
        elif chunk == b"data":
            if form is None:
                raise DataError(
                    f"not a wave file of PCM samples: the samples precede their format; {EXPECTED}"
                )
            data = content[begin:]
            unknown = size >= STREAMED or (size == 0 and total != len(content) - 8)
            return form, data, min(size or STREAMED, len(data)) if unknown else size
        place = begin + size + size % 2  # chunks begin at even places
    raise DataError(f"not a wave file of PCM samples: it ends before the samples; {EXPECTED}")


def _read_size(content: bytes, place: int) -> int:
    return int.from_bytes(content[place : place + 4], "little")


def _read_form(chunk: bytes) -> Form:
    """Read the chunk ``fmt``."""
    if len(chunk) < 16:
        raise DataError(
            f"not a wave file of PCM samples: its format has {len(chunk)} bytes, not 16; {EXPECTED}"
        )
    tag, channels, rate, _, frame, bits = struct.unpack("<HHIIHH", chunk[:16])
    if tag == EXTENSIBLE:
        if len(chunk) < 40 or chunk[26:40] != SUBTYPE:
            raise DataError(
                f"not a wave file of PCM samples: an extensible format of unknown kind; {EXPECTED}"
            )
        tag = int.from_bytes(chunk[24:26], "little")
    if tag not in (PCM, FLOAT):
        raise DataError(f"a wave file of {ENCODINGS.get(tag, f'of unknown format {tag}')}; {EXPECTED}")
    width = frame // channels if channels else 0
    widths = (4, 8) if tag == FLOAT else (1, 2, 3, 4)
    if width not in widths or frame != width * channels or not 8 * (width - 1) < bits <= 8 * width:
        kind = "float" if tag == FLOAT else "PCM"
        raise DataError(
            f"not a wave file of PCM samples: {kind} with {channels} channels, {bits} bits and {frame} bytes"
            f" for a sample of all channels; {EXPECTED}"
        )
    return Form(tag, channels, rate, width, frame)


def _decode(data: bytes, form: Form) -> Array:
    """Return the samples (n * channels,) of all channels, in the order of the file."""
    if form.tag == FLOAT:
        samples = np.frombuffer(data, f"<f{form.width}").astype(np.float64)
        if not np.isfinite(samples).all():
            raise DataError("samples that are not finite numbers")
        return np.clip(samples, -1, 1)
    if form.width == 1:
        return (np.frombuffer(data, np.uint8).astype(np.float64) - 128) / 128
    padded = np.zeros((len(data) // form.width, 4), np.uint8)  # the bytes of 32-bit numbers
    padded[:, 4 - form.width :] = np.frombuffer(data, np.uint8).reshape(-1, form.width)
    return padded.view("<i4")[:, 0].astype(np.float64) / 2**31


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
