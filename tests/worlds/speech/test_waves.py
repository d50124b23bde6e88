"""Wave files: written samples are read again, other rates keep the pitch, and wrong files are named."""

import struct

import numpy as np
import pytest

from lcorpp.errors import DataError, FileError
from lcorpp.worlds.speech.waves import RATE, read_wave, resample, write_wave


def make_file(samples: bytes, *, channels=1, bits=16, rate=16000, kind=1, claimed=None) -> bytes:
    """Return a wave file by hand: RIFF, fmt and data."""
    width = channels * bits // 8
    form = struct.pack("<HHIIHH", kind, channels, rate, rate * width, width, bits)
    size = len(samples) if claimed is None else claimed
    body = b"WAVEfmt " + struct.pack("<I", len(form)) + form + b"data" + struct.pack("<I", size) + samples
    return b"RIFF" + struct.pack("<I", len(body)) + body


def test_written_samples_are_read_again(tmp_path):
    samples = np.sin(np.arange(1000) / 10) * 0.5
    write_wave(tmp_path / "a.wav", samples, 8000)
    read, rate = read_wave(tmp_path / "a.wav")
    assert rate == 8000
    np.testing.assert_allclose(read, samples, atol=1e-4)  # 16 bits


def test_samples_of_8_bits_are_unsigned(tmp_path):
    (tmp_path / "a.wav").write_bytes(make_file(bytes([0, 128, 255]), bits=8))
    np.testing.assert_allclose(read_wave(tmp_path / "a.wav")[0], [-1, 0, 127 / 128])


@pytest.mark.parametrize("rate", [8000, 11025, 22050, 44100, 48000])
def test_another_rate_keeps_the_pitch(rate):
    tone = np.sin(2 * np.pi * 440 * np.arange(rate) / rate)
    converted = resample(tone, rate)
    assert len(converted) == RATE
    assert np.argmax(np.abs(np.fft.rfft(converted))) == 440


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "no wave file of PCM"),
        (b"RIFF", "no wave file of PCM"),
        (b"hello" * 50, "no wave file of PCM"),
        (make_file(bytes(8))[:20], "no wave file of PCM"),
        (make_file(bytes(8))[:40], "no wave file of PCM"),
        (make_file(bytes(8), kind=3, bits=32), "no wave file of PCM: unknown format: 3"),
        (make_file(bytes(8), channels=2), "2 channels of 16 bits; expected mono PCM of 8 or 16 bits"),
        (make_file(bytes(9), bits=24), "1 channels of 24 bits"),
        (make_file(bytes(8), channels=0), "no wave file of PCM: bad # of channels"),
        (make_file(bytes(8), bits=0), "no wave file of PCM"),
        (make_file(bytes(8), rate=0), "0 samples per second; expected 4000 to 192000"),
        (make_file(bytes(8), rate=2**30), "samples per second"),
        (make_file(bytes(8), claimed=800), "the file is cut: 4 of 400 samples"),
        (make_file(bytes(8), claimed=2**32 - 1), "the file is cut"),
        (make_file(bytes(2 * 4000 * 601), rate=4000), "601 seconds; expected at most 600"),
    ],
)
def test_wrong_files_are_data_errors(tmp_path, content, words):
    (tmp_path / "a.wav").write_bytes(content)
    with pytest.raises(DataError, match=words) as caught:
        read_wave(tmp_path / "a.wav")
    assert "a.wav: " in str(caught.value)


def test_damaged_files_never_raise_anything_else(tmp_path):
    rng, whole = np.random.default_rng(0), bytearray(make_file(bytes(100)))
    for _ in range(500):
        damaged = bytearray(whole)
        for place in rng.integers(0, 60, size=rng.integers(1, 6)):
            damaged[place] = rng.integers(256)
        (tmp_path / "a.wav").write_bytes(damaged[: rng.integers(1, len(damaged) + 1)])
        try:
            samples, rate = read_wave(tmp_path / "a.wav")
        except DataError:
            continue
        assert np.abs(samples).max(initial=0) <= 1
        assert rate >= 4000


def test_a_missing_file_and_a_folder_are_file_errors(tmp_path):
    for path in (tmp_path / "none.wav", tmp_path):
        with pytest.raises(FileError):
            read_wave(path)
