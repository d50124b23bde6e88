"""From sound to an observation: sentences of flite are recognised, and silence, talk and noise are not."""

from shutil import which

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import DataError
from lcorpp.hearing.sounds import SOUNDS, make_sound
from lcorpp.planning import update
from lcorpp.worlds.speech import FEATURES, Confidence, Listener, Recogniser, WaveSource, read_confidence
from lcorpp.worlds.speech.activity import find_speech
from lcorpp.worlds.speech.confidence import ANSWER, Factor
from lcorpp.worlds.speech.features import count_edits
from lcorpp.worlds.speech.listener import choose_heard
from lcorpp.worlds.speech.recogniser import Recognition
from lcorpp.worlds.speech.voice import parse_voice
from lcorpp.worlds.speech.waves import RATE, resample, write_wave

pytest.importorskip("pocketsphinx", reason="pocketsphinx is not installed: pip install 'lcorpp[speech]'")
needs_flite = pytest.mark.skipif(not which("flite"), reason="flite is not installed")


@pytest.fixture(scope="module")
def domain():
    return load_domain("intention", preset="heard")


@pytest.fixture(scope="module")
def recogniser(domain):
    return Recogniser(domain.planning.utterances)


@pytest.fixture(scope="module")
def confidence(domain):
    return read_confidence(domain.planning.recogniser, FEATURES)


def speak(text: str, pause: float = 0.8) -> np.ndarray:
    """Return a sentence of flite between pauses with a little hiss."""
    speech = resample(*parse_voice("flite:slt").synthesise(text))
    hiss = np.random.default_rng(0).normal(scale=1e-4, size=len(speech) + 2 * round(pause * RATE))
    hiss[round(pause * RATE) :][: len(speech)] += speech
    return hiss


@needs_flite
@pytest.mark.parametrize(("text", "answer"), [("yes please", "pos"), ("maybe another time", "neg")])
def test_a_sentence_is_heard(recogniser, confidence, text, answer):
    source = WaveSource(speak(text))
    heard = Listener(recogniser, confidence, source).listen(5)
    assert (heard.observation, heard.text) == (answer, text)
    assert heard.confidence > 0.5


@needs_flite
def test_other_talk_and_silence_are_none(recogniser, confidence):
    talk = Listener(recogniser, confidence, WaveSource(speak("the elevator is very slow"))).listen(5)
    assert talk.observation == "none"
    silence = WaveSource(np.random.default_rng(0).normal(scale=1e-3, size=5 * RATE))
    assert Listener(recogniser, confidence, silence).listen(5).observation == "none"
    assert Listener(recogniser, confidence, WaveSource(np.zeros(0))).listen(5).text == ""


@needs_flite
def test_the_time_of_a_recording_is_that_of_its_samples(recogniser, confidence):
    source = WaveSource(np.concatenate([np.zeros(2 * RATE), speak("no thanks")]))
    listener = Listener(recogniser, confidence, source)
    assert listener.listen(1.5).observation == "none"  # nothing was said yet
    assert listener.listen(5).observation == "neg"


@needs_flite
def test_from_a_recorded_wave_to_a_belief(tmp_path, domain, recogniser, confidence):
    write_wave(tmp_path / "answer.wav", speak("yes i am interested"))
    listener = Listener(recogniser, confidence, WaveSource.of_file(tmp_path / "answer.wav"))
    heard = listener.listen(5)
    pomdp = domain.pomdp
    action, observation = pomdp.action_index("greet"), pomdp.observation_index(heard.observation)
    belief = update(pomdp, pomdp.start, action, observation)
    assert belief[0] > 0.9  # interested, not turned
    silent = update(pomdp, pomdp.start, action, pomdp.observation_index("none"))
    assert 0.3 < silent[0] < 0.7  # silence says little, and is possible


@needs_flite
def test_equal_samples_are_heard_equally_whatever_was_heard_before(domain, recogniser):
    samples = speak("tell me more") + np.random.default_rng(0).normal(
        scale=0.01, size=len(speak("tell me more"))
    )
    first = recogniser.recognise(samples)
    recogniser.recognise(speak("go away"))
    for other in (recogniser, Recogniser(domain.planning.utterances)):
        again = other.recognise(samples)
        assert first.text == again.text
        np.testing.assert_array_equal(first.features, again.features)


@needs_flite
def test_utterances_are_found_in_blocks_of_any_length():
    samples = np.concatenate([speak("yes please"), speak("no thanks")])
    whole = list(find_speech([samples]))
    assert [len(part) > 0.3 * RATE for part in whole] == [True, True]
    pieces = list(find_speech(np.array_split(samples, 1001)))
    assert len(pieces) == 2
    for part, other in zip(whole, pieces, strict=True):
        np.testing.assert_array_equal(part, other)


@pytest.mark.parametrize(
    ("utterances", "words"),
    [
        ({}, "a recogniser without sentences"),
        ({"pos": ["yes frobnicate"]}, "the word 'frobnicate' of the sentence 'yes frobnicate' .* is not in"),
        ({"pos": ["Yes"]}, "the sentence 'Yes' of 'pos': expected words in lower case"),
        ({"pos": ["yes; public <x> = no"]}, "expected words in lower case"),
        ({"pos": ["yes"], "neg": ["yes"]}, "'yes' belongs to 'pos' and to 'neg'"),
    ],
)
def test_sentences_that_cannot_be_recognised(utterances, words):
    with pytest.raises(DataError, match=words):
        Recogniser(utterances)


@pytest.mark.parametrize("samples", [np.full(100, np.nan), np.zeros((2, 2)), np.zeros(31 * RATE)])
def test_samples_that_are_no_utterance(recogniser, samples):
    with pytest.raises(DataError, match="an utterance of shape"):
        recogniser.recognise(samples)


@pytest.mark.parametrize("seconds", [0, -1, 31, float("nan")])
def test_seconds_out_of_range(recogniser, confidence, seconds):
    with pytest.raises(DataError, match=r"expected 0.1 to 30 seconds"):
        Listener(recogniser, confidence, WaveSource(np.zeros(9))).listen(seconds)


def test_the_first_sure_utterance_counts():
    factor = Factor(np.zeros(1), np.ones(1), np.ones(1), 0.0)
    sure = Confidence(("a",), {ANSWER: factor}, {"pos": (("pos", 0.6),)})
    low, high = (Recognition("pos", text, np.array([x])) for text, x in (("low", 0.0), ("high", 2.0)))
    nothing = Recognition(None, "", np.zeros(1))
    assert choose_heard([nothing, low, high, low], sure).text == "high"
    assert choose_heard([low], sure).observation == "none"
    assert choose_heard([nothing], sure).confidence == 0


def test_edits_are_counted():
    assert count_edits("kitten", "sitting") == 3
    assert count_edits("", "abc") == count_edits("abc", "") == 3


def find_heard(recogniser, confidence, kind: str, number: int) -> str:
    """Return the observation of a sound between silence."""
    sound = make_sound(kind, np.random.default_rng(number))
    source = WaveSource(np.concatenate([np.zeros(RATE // 2), sound, np.zeros(RATE)]))
    return Listener(recogniser, confidence, source).listen(6).observation


@pytest.mark.parametrize("kind", ["hum", "chirp", "chord", "motor", "cough"])
def test_sounds_without_speech_are_none(recogniser, confidence, kind):
    assert find_heard(recogniser, confidence, kind, 0) == "none"


def test_a_modulated_hum_is_none(recogniser, confidence):
    """A tone of 220 Hz whose level changes three times a second."""
    time = np.arange(2 * RATE) / RATE
    hum = 0.3 * np.sin(2 * np.pi * 220 * time) * (0.5 + 0.5 * np.sin(2 * np.pi * 3 * time))
    assert Listener(recogniser, confidence, WaveSource(hum)).listen(5).observation == "none"


@pytest.mark.slow
def test_few_sounds_of_all_kinds_are_answers(recogniser, confidence):
    heard = [
        find_heard(recogniser, confidence, kind, number) for kind in SOUNDS for number in range(100, 104)
    ]
    assert sum(observation != "none" for observation in heard) <= 0.05 * len(heard)
