"""Features of a recognised sentence, from which the confidence in it is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from lcorpp.values import Array
from lcorpp.worlds.speech.acoustics import STEP, analyse
from lcorpp.worlds.speech.waves import RATE

FEATURES = (
    "acoustic_score",
    "worst_word_score",
    "phone_score",
    "phone_errors",
    "unexplained_speech",
    "words",
    "phones",
    "longest_phone",
    "voicing",
    "contrast",
    "phone_rate",
    "loud_outside",
    "longest_voicing",
    "periodicity_change",
    "glides",
    "width",
    "width_change",
)
"""acoustic_score: the grammar's score minus that of any phones, a frame, within the words.
worst_word_score: the same of the worst word.
phone_score: score of any phones, a frame.
phone_errors: edit distance between the phones of the sentence and the recognised ones, a phone.
unexplained_speech: share of the frames with phones that are outside of the words.
words, phones: logarithms of their numbers.
longest_phone: longest mean duration of a word's phones, in frames.
voicing: share of frames with a pitch. contrast: level of the loudest frames above the quiet ones, in dB.
phone_rate: number of phones a second. loud_outside: share of the loud frames that are outside of the words.
longest_voicing, periodicity_change, glides, width, width_change: see `Acoustics`.

Scores are natural logarithms of likelihoods.
"""

SCORE_SCALE = 1024
"""By which pocketsphinx reduces scores, unless they are those of a best path through a lattice."""

SILENT_PHONES = ("SIL", "+SPN+", "+NSN+")

MIN_SCORE = 1e-300


@dataclass(frozen=True)
class Segment:
    """A word or phone in an utterance.

    word: its name. is_spoken: False for silence and noise. begin, end: frames, the end excluded.
    score: natural logarithm of the acoustic likelihood, relative to the best senones.
    """

    word: str
    is_spoken: bool
    begin: int
    end: int
    score: float

    @classmethod
    def of(cls, part: Any) -> Self:
        """Return a segment of pocketsphinx."""
        score = float(np.log(max(part.ascore, MIN_SCORE))) * SCORE_SCALE
        spoken = part.word[0] not in "<[+(" and part.word not in SILENT_PHONES
        return cls(part.word, spoken, part.start_frame, part.end_frame + 1, score)


def compute_features(
    samples: Array,
    words: Sequence[Segment],
    phones: Sequence[Segment],
    expected: Mapping[str, Sequence[str]],
) -> Array:
    """Compute the features (F,) of a sentence.

    Args:
        samples: (n,) of the utterance.
        words: the segments of the sentence. phones: those of the best sequence of phones.
        expected: word -> phones of the pronunciation that was recognised.
    """
    frames = max(part.end for part in (*words, *phones)) if phones else max(part.end for part in words)
    phone_scores, has_phone = np.zeros(frames), np.zeros(frames, bool)
    for part in phones:
        phone_scores[part.begin : part.end] = part.score / max(part.end - part.begin, 1)
        has_phone[part.begin : part.end] = part.is_spoken
    spoken = [word for word in words if word.is_spoken and word.end > word.begin]
    in_words = np.zeros(frames, bool)
    differences, lengths, durations = [], [], []
    for word in spoken:
        in_words[word.begin : word.end] = True
        length = word.end - word.begin
        differences.append(word.score - phone_scores[word.begin : word.end].sum())
        lengths.append(length)
        durations.append(length / max(len(expected[word.word]), 1))
    said = [phone for word in spoken for phone in expected[word.word]]
    found = [part.word for part in phones if part.is_spoken]
    sound = analyse(samples)
    loud = sound.is_loud[:frames]
    return np.array(
        [
            sum(differences) / max(sum(lengths), 1),
            min((d / n for d, n in zip(differences, lengths, strict=True)), default=0.0),
            phone_scores.mean(),
            count_edits(said, found) / max(len(said), 1),
            (has_phone & ~in_words).sum() / max(has_phone.sum(), 1),
            np.log(max(len(spoken), 1)),
            np.log(max(len(said), 1)),
            max(durations, default=0.0),
            sound.measure_voicing(),
            sound.measure_contrast(),
            len(found) / (frames * STEP / RATE),
            (loud & ~in_words[: len(loud)]).sum() / max(loud.sum(), 1),
            sound.measure_longest_voicing(),
            sound.measure_periodicity_change(),
            sound.measure_glides(),
            *sound.measure_width(),
        ]
    )


def count_edits(a: Sequence[str], b: Sequence[str]) -> int:
    """Return the edit distance of two sequences: insertions, deletions and substitutions (Levenshtein)."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        above, row[0] = row[0], i
        for j, y in enumerate(b, 1):
            above, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, above + (x != y))
    return row[-1]
