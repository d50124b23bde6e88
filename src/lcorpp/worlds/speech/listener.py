"""Listen for an answer: utterances of a source are recognised until one has enough confidence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from lcorpp.errors import DataError
from lcorpp.values import Array
from lcorpp.worlds.speech.activity import find_speech
from lcorpp.worlds.speech.confidence import NONE, Confidence
from lcorpp.worlds.speech.recogniser import Recogniser, Recognition
from lcorpp.worlds.speech.waves import RATE, read_wave, resample

MIN_LISTENING, MAX_LISTENING = 0.1, 30.0
"""Limits of the seconds of listening."""

BLOCK = 480
"""Samples of a block of a recording: 30 ms."""


class Source(Protocol):
    """Where samples come from: `Microphone` or `WaveSource`."""

    def blocks(self, seconds: float) -> Iterator[Array]:
        """Yield blocks (n,) of samples at `RATE`, at most some seconds of sound."""


class WaveSource:
    """A recording as a source; its time is that of the samples, so that nothing waits.

    Listening again continues where it ended. After its end there is silence: nothing is yielded.

    Args:
        samples: (n,) at `RATE`.
    """

    def __init__(self, samples: Array) -> None:
        self._samples, self._place = samples, 0

    @classmethod
    def of_file(cls, path: str | Path) -> WaveSource:
        """Return a wave file as a source.

        Raises:
            FileError, DataError: see `read_wave`.
        """
        return cls(resample(*read_wave(path)))

    def blocks(self, seconds: float) -> Iterator[Array]:
        """Yield blocks (n,) of the next seconds."""
        end = min(len(self._samples), self._place + round(seconds * RATE))
        while self._place < end:
            begin, self._place = self._place, min(self._place + BLOCK, end)
            yield self._samples[begin : self._place]


@dataclass(frozen=True)
class Heard:
    """What was heard.

    observation: for the planner; `NONE` after silence, other talk, or an answer with too little confidence.
    text: the sentence that was recognised last, "" without.
    confidence: the probability that this sentence's answer is right, 0 without a sentence.
    """

    observation: str
    text: str = ""
    confidence: float = 0.0


class Listener:
    """Listen to a source.

    Args:
        recogniser: of the domain's sentences.
        confidence: what `lcorpp observe` learnt; `Confidence.keep` fits it to a model.
        source: the microphone or a recording.
    """

    def __init__(self, recogniser: Recogniser, confidence: Confidence, source: Source) -> None:
        self._recogniser, self._confidence, self._source = recogniser, confidence, source

    def listen(self, seconds: float) -> Heard:
        """Listen until an answer is heard, at most some seconds of sound.

        An utterance that is not over by then is recognised as far as it was heard.

        Raises:
            DataError: the seconds are out of range.
            ActionFailedError: the microphone is missing or fails.
        """
        if not MIN_LISTENING <= seconds <= MAX_LISTENING:
            raise DataError(
                f"listening for {seconds} seconds; expected {MIN_LISTENING} to {MAX_LISTENING:g} seconds"
            )
        return choose_heard(recognise_all(self._recogniser, self._source.blocks(seconds)), self._confidence)


def recognise_all(recogniser: Recogniser, blocks: Iterable[Array]) -> Iterator[Recognition]:
    """Recognise each utterance of a stream as soon as it has ended."""
    return (recogniser.recognise(utterance) for utterance in find_speech(blocks))


def choose_heard(recognitions: Iterable[Recognition], confidence: Confidence) -> Heard:
    """Return the first recognition that makes another observation than `NONE`, else the last one."""
    heard = Heard(NONE)
    for recognition in recognitions:
        if recognition.answer is None:
            continue
        score = float(confidence.score(recognition.features[None])[0])
        heard = Heard(confidence.observe(recognition.answer, score), recognition.text, score)
        if heard.observation != NONE:
            break
    return heard
