"""Wave files: written samples are read again, other rates keep the pitch, and wrong files are named."""

import struct

import numpy as np
import pytest

from lcorpp.errors import DataError, FileError
from lcorpp.worlds.speech.waves import RATE, read_wave, resample, write_wave

GUID = bytes.fromhex("000000001000800000aa00389b71")


def make_chunk(name: bytes, body: bytes, claimed=None) -> bytes:
    """Return a chunk, padded to an even length."""
    size = len(body) if claimed is None else claimed
    return name + struct.pack("<I", size) + body + bytes(len(body) % 2)


def make_file(
    samples: bytes,
    *,
    channels=1,
    bits=16,
    rate=16000,
    kind=1,
    extensible=False,
    claimed=None,
    total=None,
    before=b"",
    after=b"",
) -> bytes:
    """Return a wave file by hand: RIFF, fmt, chunks before, data, chunks after.

    claimed, total: sizes that the header states of the samples and of the file, by default the true ones.
    """
    width = channels * ((bits + 7) // 8)
    form = struct.pack("<HHIIHH", 0xFFFE if extensible else kind, channels, rate, rate * width, width, bits)
    if extensible:
        form += struct.pack("<HHIH", 22, bits, 4, kind) + GUID
    body = b"WAVE" + make_chunk(b"fmt ", form) + before + make_chunk(b"data", samples, claimed) + after
    return b"RIFF" + struct.pack("<I", len(body) if total is None else total) + body


def encode(samples: np.ndarray, kind: int, bits: int) -> bytes:
    """Return samples from -1 to 1 in an encoding."""
    if kind == 3:
        return samples.astype(f"<f{bits // 8}").tobytes()
    if bits == 8:
        return np.round(samples * 128 + 128).astype(np.uint8).tobytes()
    whole = np.round(samples * 2 ** (bits - 1)).astype("<i8")
    return whole.view(np.uint8).reshape(-1, 8)[:, : bits // 8].tobytes()


def test_written_samples_are_read_again(tmp_path):
    samples = np.sin(np.arange(1000) / 10) * 0.5
    write_wave(tmp_path / "a.wav", samples, 8000)
    read, rate = read_wave(tmp_path / "a.wav")
    assert rate == 8000
    np.testing.assert_allclose(read, samples, atol=1e-4)  # 16 bits


def test_samples_of_8_bits_are_unsigned(tmp_path):
    (tmp_path / "a.wav").write_bytes(make_file(bytes([0, 128, 255]), bits=8))
    np.testing.assert_allclose(read_wave(tmp_path / "a.wav")[0], [-1, 0, 127 / 128])


@pytest.mark.parametrize("extensible", [False, True])
@pytest.mark.parametrize(("kind", "bits"), [(1, 8), (1, 16), (1, 24), (1, 32), (3, 32), (3, 64)])
def test_each_encoding_gives_the_same_samples(tmp_path, kind, bits, extensible):
    samples = np.array([-1, -0.5, 0, 0.25, 0.75])
    content = make_file(encode(samples, kind, bits), kind=kind, bits=bits, extensible=extensible)
    (tmp_path / "a.wav").write_bytes(content)
    read, rate = read_wave(tmp_path / "a.wav")
    np.testing.assert_array_equal(read, samples)
    assert rate == 16000


def test_float_samples_are_clipped_and_finite(tmp_path):
    (tmp_path / "a.wav").write_bytes(make_file(encode(np.array([1.5, -2]), 3, 32), kind=3, bits=32))
    np.testing.assert_array_equal(read_wave(tmp_path / "a.wav")[0], [1, -1])
    (tmp_path / "a.wav").write_bytes(make_file(encode(np.array([np.nan]), 3, 32), kind=3, bits=32))
    with pytest.raises(DataError, match="not finite numbers"):
        read_wave(tmp_path / "a.wav")


@pytest.mark.parametrize(
    ("claimed", "total"),
    [
        (2**32 - 1, 2**32 - 1),
        (0x7FFFF000, 0x7FFFF024),
        (0x80000000, 0x80000024),
        (0, 0),
        (0, 36),
        (0, 2**32 - 1),
    ],
)
def test_a_header_without_a_size_is_read_to_the_end(tmp_path, claimed, total):
    samples, notes = np.linspace(-0.5, 0.5, 5), make_chunk(b"LIST", b"INFOISFT")
    content = make_file(encode(samples, 1, 16), claimed=claimed, total=total, before=notes)
    (tmp_path / "a.wav").write_bytes(content + b"\0")  # a sample that was begun
    np.testing.assert_allclose(read_wave(tmp_path / "a.wav")[0], samples, atol=1e-4)


@pytest.mark.parametrize(("kind", "bits", "channels"), [(1, 16, 2), (1, 24, 2), (3, 32, 6), (1, 8, 2)])
def test_of_several_channels_the_mean_is_read(tmp_path, kind, bits, channels):
    samples = np.linspace(-0.5, 0.5, 5)
    parts = samples[:, None] * np.linspace(0, 1, channels)
    content = make_file(
        encode(parts.ravel(), kind, bits), kind=kind, bits=bits, channels=channels, extensible=True
    )
    (tmp_path / "a.wav").write_bytes(content)
    np.testing.assert_allclose(read_wave(tmp_path / "a.wav")[0], samples / 2, atol=1e-2)


def test_other_chunks_are_skipped(tmp_path):
    samples, notes = np.linspace(-0.5, 0.5, 5), make_chunk(b"LIST", b"odd")
    content = make_file(encode(samples, 1, 8), bits=8, before=notes, after=notes)
    (tmp_path / "a.wav").write_bytes(content)
    np.testing.assert_allclose(read_wave(tmp_path / "a.wav")[0], samples, atol=1e-2)
    (tmp_path / "a.wav").write_bytes(make_file(b"", after=notes))  # no samples, and the header is right
    assert len(read_wave(tmp_path / "a.wav")[0]) == 0


@pytest.mark.parametrize("rate", [8000, 11025, 22050, 44100, 48000])
def test_another_rate_keeps_the_pitch(rate):
    tone = np.sin(2 * np.pi * 440 * np.arange(rate) / rate)
    converted = resample(tone, rate)
    assert len(converted) == RATE
    assert np.argmax(np.abs(np.fft.rfft(converted))) == 440


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "not a wave file of PCM"),
        (b"RIFF", "not a wave file of PCM"),
        (b"hello" * 50, "not a wave file of PCM"),
        (make_file(bytes(8))[:20], "not a wave file of PCM"),
        (make_file(bytes(8))[:40], "not a wave file of PCM"),
        (b"RF64" + make_file(bytes(8))[4:], "not a wave file of PCM but RF64; expected"),
        (b"fLaC" + bytes(50), "not a wave file of PCM but FLAC; expected"),
        (make_file(bytes(8), kind=7, bits=8), "a wave file of mu-law; expected"),
        (make_file(bytes(8), kind=6, bits=8, extensible=True), "a wave file of A-law"),
        (make_file(bytes(8), kind=99), "a wave file of of unknown format 99"),
        (make_file(bytes(8), extensible=True).replace(GUID, bytes(14)), "extensible format of unknown kind"),
        (
            make_file(bytes(8), kind=3),
            "not a wave file of PCM samples: float with 1 channels, 16 bits and 2 bytes",
        ),
        (make_file(bytes(8), bits=40), "not a wave file of PCM samples: PCM with 1 channels, 40 bits"),
        (make_file(bytes(8), channels=2, claimed=80), "the file is cut: 2 of 20 samples"),
        (make_file(bytes(8), channels=0), "PCM with 0 channels"),
        (make_file(bytes(8), bits=0), "not a wave file of PCM"),
        (make_file(bytes(8)).replace(b"fmt ", b"junk"), "the samples precede their format"),
        (make_file(bytes(8), rate=0), "0 samples per second; expected 4000 to 192000"),
        (make_file(bytes(8), rate=2**30), "samples per second"),
        (make_file(bytes(8), claimed=800), "the file is cut: 4 of 400 samples"),
        (make_file(bytes(8), claimed=800, total=2**32 - 1), "the file is cut: 4 of 400 samples"),
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
