"""Cases of faults in the field, which are kept beside the repository."""

import runpy
import shutil
from pathlib import Path

import pytest

from lcorpp.camera import Intrinsics
from lcorpp.camera.frames import ImageFolder
from lcorpp.camera.mounting import suggest_options
from lcorpp.domains import load_domain
from lcorpp.worlds.speech import FEATURES, Listener, Recogniser, WaveSource, read_confidence
from lcorpp.worlds.speech.waves import read_wave

CASES = Path(__file__).parents[3] / "shared" / "cases" / "robot"


needs_cases = pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not here (shared/cases/robot)")


@needs_cases
@pytest.mark.parametrize(
    "name",
    [
        "01_one_wrong_stamp",
        "04_frozen_stamps",
        "05_weights_cross_calibrate",
        "06_one_nan_pose",
        "09_markers",
    ],
)
def test_a_case_passes(name, monkeypatch):
    monkeypatch.chdir(CASES)  # some read a classifier
    runpy.run_path(str(CASES / f"{name}.py"))


@needs_cases
def test_a_rotated_camera_shows_no_people(capsys):
    runpy.run_path(str(CASES / "03_rotated_depth.py"))
    upright, *rotated = capsys.readouterr().out.splitlines()
    assert f"people found in an image: {[1] * 25} floor Floor(" in upright
    assert [line.split(": people")[1] for line in rotated] == [
        f" found in an image: {[0] * 25} floor None"
    ] * 2


@needs_cases
def test_another_unit_of_depths_is_named(tmp_path):
    pytest.importorskip("cv2", reason="OpenCV is not installed: pip install 'lcorpp[camera]'")
    shutil.copy(CASES / "14_depth_5000_a_metre.png", tmp_path / "0.0.png")
    (frame,) = ImageFolder(tmp_path)
    advice = suggest_options(frame, Intrinsics(143, 143, 79.5, 59.5))
    assert "--depth-scale 5000 (TUM RGB-D): 1 m" in advice


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
