"""Voice activity: where speech begins and ends in a stream of samples (pocketsphinx's Endpointer)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from lcorpp.values import Array
from lcorpp.worlds.speech.sphinx import load_pocketsphinx
from lcorpp.worlds.speech.waves import RATE, to_pcm

WINDOW, RATIO = 0.3, 0.9
"""Speech begins or ends if this share of the frames in a window, in seconds, agree."""

MIN_SECONDS = 0.15
"""Shorter sounds are not speech."""


def find_speech(blocks: Iterable[Array]) -> Iterator[Array]:
    """Yield each utterance of a stream, as soon as it has ended; the last one may be cut by the stream's end.

    Args:
        blocks: (n,) samples at `RATE`, of any lengths.

    Returns:
        (m,) the samples of an utterance, from the begin of the window in which speech began.

    Raises:
        ActionFailedError: pocketsphinx is missing.
    """
    sphinx = load_pocketsphinx()
    endpointer = sphinx.Endpointer(window=WINDOW, ratio=RATIO, vad_mode=sphinx.Vad.LOOSE, sample_rate=RATE)
    size, utterance = endpointer.frame_bytes, list[bytes]()
    for frame in _cut_frames(blocks, size):
        speech = endpointer.process(frame)
        if speech is not None:
            utterance.append(speech)
        if utterance and not endpointer.in_speech:
            yield from _check_length(utterance)
            utterance = []
    yield from _check_length(utterance)


def _cut_frames(blocks: Iterable[Array], size: int) -> Iterator[bytes]:
    """Yield the stream as frames of `size` bytes of PCM; an incomplete one at its end is left out."""
    rest = b""
    for block in blocks:
        rest += to_pcm(block)
        for start in range(0, len(rest) - size + 1, size):
            yield rest[start : start + size]
        rest = rest[len(rest) - len(rest) % size :]


def _check_length(utterance: list[bytes]) -> Iterator[Array]:
    """Yield the samples of an utterance, unless it is shorter than `MIN_SECONDS`."""
    samples = np.frombuffer(b"".join(utterance), "<i2").astype(np.float64) / 2**15
    if len(samples) >= MIN_SECONDS * RATE:
        yield samples
