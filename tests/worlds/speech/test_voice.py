"""Voices: programs that fail, hang or are missing end in typed errors; recorded sentences are found."""

import stat
from shutil import which

import numpy as np
import pytest

from lcorpp.errors import ActionFailedError, DataError, FileError
from lcorpp.worlds.speech import sound_device, voice
from lcorpp.worlds.speech.voice import ProgramVoice, RecordedVoice, parse_voice
from lcorpp.worlds.speech.waves import write_wave

needs_flite = pytest.mark.skipif(not which("flite"), reason="flite is not installed")


@pytest.fixture
def program(tmp_path):
    def make(script: str, timeout: float = 10.0) -> ProgramVoice:
        path = tmp_path / "program"
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return ProgramVoice("own:a", lambda text, file: (str(path), str(file)), timeout)

    return make


@needs_flite
def test_flite_speaks():
    samples, rate = parse_voice("flite:slt").synthesise("Hello there!")
    assert rate == 16000
    assert 0.4 < len(samples) / rate < 2
    assert np.abs(samples).max() > 0.1


@needs_flite
def test_an_unknown_voice_is_not_replaced_by_another():
    with pytest.raises(DataError, match="flite has no voice 'nobody'; expected one of kal"):
        parse_voice("flite:nobody")


@pytest.mark.skipif(not which("espeak-ng"), reason="espeak-ng is not installed")
def test_espeak_speaks_and_names_its_error():
    assert len(parse_voice("espeak-ng:en-us").synthesise("hello")[0]) > 1000
    with pytest.raises(ActionFailedError, match=r"espeak-ng failed: .*voice does not exist"):
        parse_voice("espeak-ng:nobody").synthesise("hello")


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("echo no licence >&2; exit 3", "program failed: no licence"),
        ("exit 3", "program failed: code 3"),
        ("true", "wrote no speech of 'hello': cannot be read: No such file"),
        ('echo hello > "$1"', "wrote no speech of 'hello': not a wave file of PCM"),
        ('mkdir "$1"', "wrote no speech of 'hello': cannot be read: Is a directory"),
    ],
)
def test_a_program_that_fails(program, script, words):
    with pytest.raises(ActionFailedError, match=words):
        program(script).synthesise("hello")


def test_a_program_that_hangs_is_stopped(program):
    with pytest.raises(ActionFailedError, match=r"program took more than 0\.2 seconds and was stopped"):
        program("exec sleep 100", timeout=0.2).synthesise("hello")


def test_a_program_that_is_missing():
    missing = ProgramVoice("own:a", lambda text, file: ("no-such-program-at-all",))
    with pytest.raises(ActionFailedError, match="there is no program 'no-such-program-at-all'; install it"):
        missing.synthesise("hello")


@pytest.mark.parametrize("text", ["", "  ", "...", "a\x00b", "a\nb", "a" * 1001])
def test_texts_that_nobody_can_say(text):
    with pytest.raises(DataError, match="cannot be spoken"):
        ProgramVoice("own:a", lambda text, file: ("true",)).synthesise(text)


def test_recorded_sentences_are_found_by_their_words(tmp_path):
    write_wave(tmp_path / "nice_to_meet_you.wav", np.full(100, 0.5))
    found = parse_voice(f"wave:{tmp_path}")
    assert isinstance(found, RecordedVoice)
    assert len(found.synthesise("Nice to meet you!")[0]) == 100
    assert len(parse_voice(f"wave:{tmp_path}/nice_to_meet_you.wav").synthesise("Anything")[0]) == 100
    with pytest.raises(FileError, match=r"good_bye\.wav: cannot be read"):
        found.synthesise("Good bye")
    with pytest.raises(FileError, match=r"passwd\.wav"):  # never outside of the folder
        found.synthesise("../../passwd")


@pytest.mark.parametrize("text", ["", "slt", "flite:", "nobody:a", "flite:-h", "espeak-ng:\x01"])
def test_texts_that_name_no_voice(text):
    with pytest.raises(DataError, match="expected one of flite:VOICE"):
        parse_voice(text)


def test_a_missing_model_and_a_time_out_of_nothing(tmp_path):
    with pytest.raises(FileError, match=r"there is no .*joe\.onnx"):
        parse_voice(f"piper:{tmp_path}/joe.onnx")
    with pytest.raises(DataError, match="the time-out of a voice is 0"):
        parse_voice("espeak-ng:en", timeout=0)


def test_say_plays_what_is_synthesised(tmp_path, monkeypatch):
    played = []
    monkeypatch.setattr(voice, "play", lambda samples, rate: played.append((len(samples), rate)))
    write_wave(tmp_path / "a.wav", np.full(100, 0.5), 8000)
    parse_voice(f"wave:{tmp_path}/a.wav").say("hello")
    assert played == [(100, 8000)]


def test_without_a_sound_device_there_is_a_typed_error(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(ActionFailedError, match=r"pip install 'lcorpp\[speech\]'"):
        sound_device.play(np.zeros(100), 16000)
    with pytest.raises(ActionFailedError, match=r"pip install 'lcorpp\[speech\]'"):
        next(sound_device.Microphone().blocks(1))
