"""Cases of a measurement: the split by sentence, recordings in folders, and the whole way to the files."""

import json
from shutil import which

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import DataError, FileError
from lcorpp.hearing.answers import SYNTHETIC_SAID, assume_without_kinds
from lcorpp.hearing.cases import (
    Case,
    RecordedCases,
    SyntheticCases,
    parse_voices,
    split_sentences,
)
from lcorpp.hearing.measurement import Result
from lcorpp.hearing.noises import LEAD, SPEECH_LEVEL, TAIL, parse_noises
from lcorpp.hearing.observing import observe, recorded_noise, weigh_factors
from lcorpp.hearing.results import write_observed
from lcorpp.hearing.sounds import LEVELS, SOUNDS, make_sound
from lcorpp.planning import read_pomdp
from lcorpp.worlds.speech import FEATURES, parse_voice, read_confidence
from lcorpp.worlds.speech.waves import RATE, write_wave

POS = ("yes please", "of course", "tell me more", "that sounds good")
NEG = ("no thanks", "maybe later", "i am busy", "go away")


class Tone:
    """A voice that plays a tone whose pitch depends on the text."""

    name = "tone"

    def synthesise(self, text):
        return np.sin(np.arange(4000) * (0.1 + len(text) / 100)), 16000


def write_recordings(folder, texts, rng=None):
    rng = rng or np.random.default_rng(0)
    for kind, sentences in texts.items():
        (folder / kind).mkdir(parents=True)
        for text in sentences:
            write_wave(folder / kind / f"{text.replace(' ', '_')}-ann-2.wav", rng.normal(size=800) * 0.1)


def test_sentences_are_split_in_halves_whatever_their_order():
    texts = [f"sentence {i}" for i in range(41)]
    split = split_sentences(texts, 0)
    assert sum(split.values()) == 20
    assert split_sentences(texts[::-1], 0) == split != split_sentences(texts, 1)


def test_all_voices_and_noises_of_a_sentence_are_on_one_side(tmp_path):
    mix = parse_noises("clean,babble:10")
    cases = SyntheticCases({"pos": POS, "neg": NEG}, [Tone()], mix, tmp_path, 0)
    assert cases.kinds == ("pos", "neg", "talk", "sound", "silence")
    sides = {}
    for case in cases.cases:
        sides.setdefault(case.sentence, set()).add(case.is_test)
    assert all(len(side) == 1 for side in sides.values())
    assert len({case.key for case in cases.cases}) == len(cases.cases)
    one = next(case for case in cases.cases if case.noise == "babble:10" and case.text == "yes please")
    np.testing.assert_array_equal(cases.samples(one), cases.samples(one))
    assert np.abs(cases.samples(one) - cases.samples(one, repeat=1)).max() > 1e-3


def test_half_of_the_kinds_of_sounds_are_unseen_in_the_tuning(tmp_path):
    cases = SyntheticCases({"pos": POS, "neg": NEG}, [Tone()], parse_noises("clean"), tmp_path, 0)
    side = {case.text: case.is_test for case in cases.cases if case.said == "sound"}
    assert set(side) == set(SOUNDS)
    assert sum(side.values()) == len(SOUNDS) // 2
    one, other = [case for case in cases.cases if case.text == "motor"][:2]
    assert len(cases.samples(one)) > (LEAD + TAIL) * RATE
    assert len(cases.samples(one)) != len(cases.samples(other))


@pytest.mark.parametrize("kind", SOUNDS)
def test_sounds_have_the_stated_levels(kind):
    for seed in range(2):
        sound = make_sound(kind, np.random.default_rng(seed))
        np.testing.assert_array_equal(sound, make_sound(kind, np.random.default_rng(seed)))
        assert np.abs(sound).max() < 1
        level = 20 * np.log10(np.sqrt(np.mean(sound**2)) / SPEECH_LEVEL)
        assert LEVELS[0] - 6 < level < LEVELS[1] + 1  # fading, and peaks of 1, make it quieter


def test_each_factor_learns_from_its_own_cases():
    said = ("pos", "neg", "talk", "sound", "silence")
    results = [
        Result(Case(kind, str(number), "", "clean", 0, False), (), 0.0)
        for place, kind in enumerate(said)
        for number in range(place + 1)
    ]
    weights = weigh_factors(results, parse_noises("clean"), ("pos", "neg"))
    kinds = np.array([result.case.said for result in results])
    total = {name: [own[kinds == kind].sum() / own.sum() for kind in said] for name, own in weights.items()}
    np.testing.assert_allclose(total["answer"], [1 / 4, 1 / 4, 1 / 4, 0, 1 / 4])
    np.testing.assert_allclose(total["speech"], [1 / 4, 1 / 4, 1 / 4, 1 / 4, 0])
    without = [result for result in results if result.case.said != "sound"]
    assert set(weigh_factors(without, parse_noises("clean"), ("pos", "neg"))) == {"answer"}


def test_recordings_are_read_by_their_names(tmp_path):
    write_recordings(tmp_path, {"pos": POS, "neg": NEG, "none": ["a b", "c", "d", "e"]})
    cases = RecordedCases(tmp_path, ("pos", "neg"), 0)
    assert cases.kinds == ("pos", "neg", "none")
    assert {(case.text, case.voice) for case in cases.cases if case.said == "neg"} == {
        (text, "ann-2") for text in NEG
    }
    assert len(cases.samples(cases.cases[0])) == 800
    assert assume_without_kinds(("none",)) == pytest.approx({"expected": 0.7, "other": 0.03, "none": 0.27})


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        ({}, r"folders \(none\); expected one for each of pos, neg, and one other for all else"),
        ({"pos": POS, "neg": NEG}, "folders neg, pos; expected"),
        ({"pos": POS, "none": POS}, "folders none, pos; expected"),
        ({"pos": POS, "neg": NEG, "a": POS, "b": POS}, "folders a, b, neg, pos; expected"),
        ({"pos": POS, "neg": NEG[:3], "none": POS}, "'neg' has 3 sentences; expected at least 4"),
    ],
)
def test_folders_that_do_not_fit(tmp_path, texts, words):
    write_recordings(tmp_path, texts)
    with pytest.raises(DataError, match=words):
        RecordedCases(tmp_path, ("pos", "neg"), 0)


def test_a_wrong_recording_is_found_before_the_work(tmp_path):
    write_recordings(tmp_path, {"pos": POS, "neg": NEG, "none": POS})
    (tmp_path / "neg" / "go_away-ann-2.wav").write_bytes(b"RIFF, but cut")
    with pytest.raises(DataError, match=r"go_away-ann-2\.wav: not a wave file of PCM"):
        RecordedCases(tmp_path, ("pos", "neg"), 0)
    with pytest.raises(FileError, match="there is no such folder of recordings"):
        RecordedCases(tmp_path / "missing", ("pos", "neg"), 0)


def test_repeated_voices_are_errors():
    with pytest.raises(DataError, match="one is repeated"):
        parse_voices("a,b, a", lambda text: Tone())


@pytest.mark.slow
@pytest.mark.skipif(not which("flite"), reason="flite is not installed")
def test_a_measurement_from_voices_to_files(tmp_path):
    pytest.importorskip("pocketsphinx", reason="pocketsphinx is not installed")
    domain = load_domain("intention")
    mix = parse_noises("clean,babble:20")
    voices = parse_voices("flite:slt", parse_voice)
    cases = SyntheticCases(domain.planning.utterances, voices, mix, tmp_path / "voices", 0)
    observed = observe(domain, cases, mix, SYNTHETIC_SAID, tmp_path, trials=2000)
    again = observe(domain, cases, mix, SYNTHETIC_SAID, tmp_path, trials=2000)  # from what is kept
    assert again.value.interval == observed.value.interval
    written = write_observed(observed, tmp_path)
    assert all(path.exists() for path in written)
    model = read_pomdp(tmp_path / "heard.pomdp")
    np.testing.assert_array_equal(model.observation.dense, observed.model.observation.dense)
    none = model.observation_index("none")
    assert model.observation.dense[:, :, none].min() > 0
    learnt = read_confidence(tmp_path / "heard.json", FEATURES)
    assert set(model.observations) == {name for rows in learnt.bins.values() for name, _ in rows} | {"none"}
    summary = json.loads((tmp_path / "observe.json").read_text())
    assert summary["synthetic"] is True
    assert abs(summary["shortfall"]) < 0.1
    assert "synthetic" in (tmp_path / "heard.pomdp").read_text()
    with pytest.raises(DataError):  # the folder has another measurement
        observe(domain, cases, mix, SYNTHETIC_SAID, tmp_path, seed=1)
    assert recorded_noise()[0].share == 1
