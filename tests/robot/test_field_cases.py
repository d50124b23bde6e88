"""Cases of faults in the field, which are kept beside the repository."""

import runpy
from pathlib import Path

import pytest

from lcorpp.domains import load_domain
from lcorpp.worlds.speech import FEATURES, Listener, Recogniser, WaveSource, read_confidence
from lcorpp.worlds.speech.waves import read_wave

CASES = Path(__file__).parents[3] / "shared" / "cases" / "robot"


needs_cases = pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not here (shared/cases/robot)")


@needs_cases
@pytest.mark.parametrize("name", ["01_one_wrong_stamp", "04_frozen_stamps", "06_one_nan_pose", "09_markers"])
def test_a_case_passes(name, monkeypatch):
    monkeypatch.chdir(CASES)  # some read a classifier
    runpy.run_path(str(CASES / f"{name}.py"))


@needs_cases
def test_the_hum_is_no_answer():
    pytest.importorskip("pocketsphinx", reason="pocketsphinx is not installed: pip install 'lcorpp[speech]'")
    domain = load_domain("intention", preset="heard")
    known = read_confidence(domain.planning.recogniser, FEATURES).keep(domain.pomdp.observations)
    source = WaveSource.of_file(CASES / "02_hum.wav")
    listener = Listener(Recogniser(domain.planning.utterances), known, source)
    assert listener.listen(5).observation == "none"


@needs_cases
@pytest.mark.parametrize("name", ["11_extensible_pcm", "11_streamed_header"])
def test_wave_files_of_other_programs_are_read(name):
    samples, rate = read_wave(CASES / f"{name}.wav")
    assert len(samples) > rate / 10
    assert 0 < abs(samples).max() <= 1
