"""The cases of a measurement: recordings, and the sentences of synthetic voices in noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np

from lcorpp.errors import DataError, FileError, expected_one_of
from lcorpp.files import make_folder, read_text
from lcorpp.hearing.answers import SILENCE, SOUND, TALK
from lcorpp.hearing.noises import LEAD, TAIL, Noise, add_noise, make_noise, set_level
from lcorpp.hearing.sounds import SOUNDS, make_sound
from lcorpp.values import Array
from lcorpp.worlds.speech.voice import Voice
from lcorpp.worlds.speech.waves import RATE, read_wave, resample, write_wave

OFF_TOPIC = Path(__file__).with_name("off_topic.txt")
"""Sentences that are not answers, one a line."""

SILENCE_SECONDS = 2.5
"""Duration of a case in which nobody answers."""

SILENCES = 200
"""Number of cases of silence in each noise."""

SOUNDS_OF_A_KIND = 6
"""Number of cases of each kind of sound in each noise."""

RECORDED = "recorded"
"""The noise of recordings: what they contain."""

MIN_SENTENCES = 4
"""Minimum number of sentences of each kind: two for tuning, two for the test."""


@dataclass(frozen=True)
class Case:
    """An utterance, a sound or silence, in noise.

    said: an answer, or what is heard besides. text: the sentence or the kind of sound, "" for silence.
    voice: who says it. noise: its name. number: of the silence or the sound; seeds the noise.
    is_test: whether it belongs to the test.
    """

    said: str
    text: str
    voice: str
    noise: str
    number: int
    is_test: bool

    @property
    def key(self) -> str:
        """Text that identifies the case in a measurement."""
        return f"{self.said}|{self.text}|{self.voice}|{self.noise}|{self.number}"

    @property
    def sentence(self) -> str:
        """What is split between tuning and test, and resampled, as a whole."""
        return f"{self.said}|{self.text or self.number}"


def split_sentences(texts: Sequence[str], seed: int) -> dict[str, bool]:
    """Return text -> whether it belongs to the test: half of them, by a hash of text and seed."""
    ordered = sorted(texts, key=lambda text: (crc32(f"{seed}|{text}".encode()), text))
    return {text: place < len(texts) // 2 for place, text in enumerate(ordered)}


class SyntheticCases:
    """Sentences and off-topic talk by synthetic voices, sounds and silence, in each noise.

    Half of the kinds of sounds belong to the test: what is learnt from some kinds is tested with others.

    Args:
        utterances: answer -> sentences.
        voices: by whom each sentence is said.
        noises: the mix.
        folder: keeps the speech of the voices as wave files.
        seed: of the split and the noise.
        advance: receives the numbers of finished and of all sentences.

    Raises:
        DataError: fewer than `MIN_SENTENCES` sentences of an answer.
        ActionFailedError: a voice fails.
    """

    def __init__(
        self,
        utterances: Mapping[str, Sequence[str]],
        voices: Sequence[Voice],
        noises: Sequence[Noise],
        folder: Path,
        seed: int,
        advance: Callable[[int, int], None] = lambda done, total: None,
    ) -> None:
        said = {**utterances, TALK: read_text(OFF_TOPIC).splitlines()}
        check_numbers(said)
        self.kinds = (*said, SOUND, SILENCE)
        self._noises, self._seed = {noise.name: noise for noise in noises}, seed
        self._speech = dict[tuple[str, str], Array]()
        self.cases = list[Case]()
        total = len(voices) * sum(map(len, said.values()))
        for kind, texts in said.items():
            is_test = split_sentences(texts, seed)
            for text in texts:
                for voice in voices:
                    self._speech[voice.name, text] = _synthesise(voice, text, folder)
                    advance(len(self._speech), total)
                    self.cases += [
                        Case(kind, text, voice.name, noise, 0, is_test[text]) for noise in self._noises
                    ]
        is_test = split_sentences(tuple(SOUNDS), seed)
        for kind in SOUNDS:
            for number in range(SOUNDS_OF_A_KIND):
                self.cases += [Case(SOUND, kind, "", noise, number, is_test[kind]) for noise in self._noises]
        for number in range(SILENCES):
            self.cases += [Case(SILENCE, "", "", noise, number, number % 2 == 1) for noise in self._noises]
        self._is_test = {case.text: case.is_test for case in self.cases}

    def samples(self, case: Case, repeat: int = 0) -> Array:
        """Return the samples (n,) of a case; each `repeat` has other noise.

        Babble is mixed from other sentences of the same part of the split.
        """
        rng = np.random.default_rng([self._seed, crc32(case.key.encode()), repeat])
        noise = self._noises[case.noise]
        talk = [
            speech
            for (_, text), speech in self._speech.items()
            if text != case.text and self._is_test[text] == case.is_test
        ]
        if case.said == SILENCE:
            return make_noise(noise, round((SILENCE_SECONDS + LEAD + TAIL) * RATE), talk, rng)
        speech = make_sound(case.text, rng) if case.said == SOUND else self._speech[case.voice, case.text]
        return add_noise(speech, noise, talk, rng)


class RecordedCases:
    """Recordings in a folder with a folder for each answer, and one for all else, e.g. none.

    A file ``yes_please-ann-2.wav`` has the sentence "yes please"; what follows the first hyphen is the voice.

    Args:
        folder: of the recordings.
        answers: the observations that people give by sentences.
        seed: of the split.

    Raises:
        FileError, DataError: a folder of an answer is missing, the only other one is not there, there are
            fewer than `MIN_SENTENCES` sentences in one, or a file is not a wave file.
    """

    def __init__(self, folder: Path, answers: Sequence[str], seed: int) -> None:
        if not folder.is_dir():
            raise FileError(f"{folder}: there is no such folder of recordings")
        names = sorted(path.name for path in folder.iterdir() if path.is_dir())
        others = [name for name in names if name not in answers]
        missing = [name for name in answers if name not in names]
        if missing or len(others) != 1:
            raise DataError(
                f"{folder}: folders {', '.join(names) or '(none)'}; expected one for each of"
                f" {', '.join(answers)}, and one other for all else, e.g. none"
            )
        self.kinds = (*answers, others[0])
        self._paths, self.cases = dict[str, Path](), list[Case]()
        said: dict[str, list[str]] = {}
        for kind in self.kinds:
            files = sorted((folder / kind).glob("*.wav"))
            said[kind] = sorted({_read_name(path)[0] for path in files})
            is_test = split_sentences(said[kind], seed)
            for path in files:
                text, voice = _read_name(path)
                case = Case(kind, text, voice, RECORDED, 0, is_test[text])
                if case.key in self._paths:
                    raise DataError(f"{path}: has the name of {self._paths[case.key]}; rename one of them")
                self._paths[case.key] = path
                self.cases.append(case)
                read_wave(path)  # a wrong file is found before the long work
        check_numbers(said)

    def samples(self, case: Case, repeat: int = 0) -> Array:
        """Return the samples (n,) of a recording; they are the same at each `repeat`."""
        return resample(*read_wave(self._paths[case.key]))


Cases = SyntheticCases | RecordedCases


def check_numbers(said: Mapping[str, Sequence[str]]) -> None:
    """Raise `DataError` if a kind has fewer than `MIN_SENTENCES` sentences."""
    for kind, texts in said.items():
        if len(texts) < MIN_SENTENCES:
            raise DataError(f"{kind!r} has {len(texts)} sentences; expected at least {MIN_SENTENCES}")


def parse_voices(texts: str, parse: Callable[[str], Voice]) -> tuple[Voice, ...]:
    """Return the voices of a text such as ``flite:slt,flite:rms``.

    Raises:
        DataError: a voice is unknown or repeated.
    """
    names = [name.strip() for name in texts.split(",")]
    if len(set(names)) < len(names):
        raise DataError(f"the voices {texts!r}: one is repeated; {expected_one_of(names)} once")
    return tuple(parse(name) for name in names)


def _read_name(path: Path) -> tuple[str, str]:
    """Return the sentence and the voice of a recording's name."""
    text, _, voice = path.stem.partition("-")
    return text.replace("_", " ").strip().lower(), voice


def _synthesise(voice: Voice, text: str, folder: Path) -> Array:
    """Return the speech of a text at the common level; it is kept in the folder."""
    name = "".join(c if c.isalnum() else "_" for c in voice.name)
    path = make_folder(folder / name) / f"{text.replace(' ', '_')}.wav"
    if not path.exists():
        samples, rate = voice.synthesise(text)
        write_wave(path, set_level(resample(samples, rate)))
    return resample(*read_wave(path))
