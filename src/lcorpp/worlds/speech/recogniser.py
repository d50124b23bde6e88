"""Recognise sentences: pocketsphinx with a grammar of all sentences, and any phones beside it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcorpp.errors import DataError
from lcorpp.values import Array
from lcorpp.worlds.speech.features import FEATURES, Segment, compute_features
from lcorpp.worlds.speech.sphinx import find_model, load_pocketsphinx
from lcorpp.worlds.speech.waves import RATE, to_pcm

BEAM, WORD_BEAM = 1e-80, 1e-60
"""Wider than pocketsphinx's own, 1e-48 and 7e-29, by which noise loses sentences; the grammar is small."""

MAX_SECONDS = 30
"""Maximum length of an utterance."""

SENTENCE = re.compile(r"[a-z']+( [a-z']+)*")


@dataclass(frozen=True, eq=False)
class Recognition:
    """What was recognised in an utterance.

    answer: the observation whose sentence was recognised; None if no sentence fits.
    text: the sentence, "" without.
    features: (F,) `FEATURES`, from which a confidence is computed; zeros without a sentence.
    """

    answer: str | None
    text: str
    features: Array


class Recogniser:
    """Recognise the sentences of a grammar.

    Args:
        utterances: observation -> its sentences, words in lower case with a space between them.

    Raises:
        DataError: there is no sentence, one belongs to two observations, or it has a word that is not in the
            dictionary; the message names it.
        ActionFailedError: pocketsphinx is missing.
    """

    def __init__(self, utterances: Mapping[str, Sequence[str]]) -> None:
        self._answer_of = _find_answers(utterances)
        self._decoder = _make_decoder(self._answer_of)

    def recognise(self, samples: Array) -> Recognition:
        """Recognise the sentence of an utterance.

        Args:
            samples: (n,) at `RATE`, from -1 to 1.

        Raises:
            DataError: samples that are no such numbers, or too many.
        """
        if samples.ndim != 1 or len(samples) > MAX_SECONDS * RATE or not np.isfinite(samples).all():
            raise DataError(
                f"an utterance of shape {samples.shape}; expected at most {MAX_SECONDS} s of finite samples"
            )
        speech = to_pcm(samples)
        text, words = self._search("sentences", speech)
        answer = self._answer_of.get(text)
        if answer is None:  # the search has lost all sentences
            return Recognition(None, "", np.zeros(len(FEATURES)))
        _, phones = self._search("phones", speech)
        expected = {w.word: tuple(self._decoder.lookup_word(w.word).split()) for w in words if w.is_spoken}
        return Recognition(answer, text, compute_features(samples, words, phones, expected))

    def _search(self, name: str, speech: bytes) -> tuple[str, list[Segment]]:
        """Return the best hypothesis of a search, and its segments."""
        decoder = self._decoder
        decoder.reinit_feat()  # else scores depend on the utterances before
        decoder.activate_search(name)
        decoder.start_utt()
        decoder.process_raw(speech, no_search=False, full_utt=True)
        decoder.end_utt()
        best = decoder.hyp()
        if best is None:
            return "", []
        return best.hypstr, [Segment.of(part) for part in decoder.seg()]


def _find_answers(utterances: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return sentence -> observation."""
    answer_of: dict[str, str] = {}
    for observation, sentences in utterances.items():
        for sentence in sentences:
            if not SENTENCE.fullmatch(sentence):
                raise DataError(
                    f"the sentence {sentence!r} of {observation!r}: expected words in lower case with a space"
                    " between them"
                )
            if answer_of.setdefault(sentence, observation) != observation:
                raise DataError(
                    f"the sentence {sentence!r} belongs to {answer_of[sentence]!r} and to {observation!r}"
                )
    if not answer_of:
        raise DataError("a recogniser without sentences; see docs/guides/robot/speech.md")
    return answer_of


def _make_decoder(answer_of: Mapping[str, str]) -> Any:
    """Return a decoder with the searches "sentences" and "phones"."""
    # the best path through the lattice is off: in noise it often ends without any hypothesis
    decoder = load_pocketsphinx().Decoder(
        lm=None, loglevel="FATAL", bestpath=False, beam=BEAM, pbeam=BEAM, wbeam=WORD_BEAM
    )
    for sentence, answer in answer_of.items():
        for word in sentence.split():
            if decoder.lookup_word(word) is None:
                raise DataError(
                    f"the word {word!r} of the sentence {sentence!r} ({answer}) is not in pocketsphinx's"
                    " dictionary; say it in other words"
                )
    rule = " | ".join(answer_of)
    decoder.add_jsgf_string("sentences", f"#JSGF V1.0;\ngrammar sentences;\npublic <sentence> = {rule};\n")
    decoder.add_allphone_file("phones", find_model("en-us-phone.lm.bin"))
    return decoder
