"""Answers by the robot's own recogniser, from recordings in place of a microphone."""

import shutil
import subprocess

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.errors import DomainError
from lcorpp.robot.hearing import MicrophoneListener
from lcorpp.worlds.speech import WaveSource

DOMAIN = load_domain("intention", preset="heard")


def test_silence_is_none():
    listener = MicrophoneListener(DOMAIN, WaveSource(np.zeros(3 * 16000)))
    listener.clear()
    assert listener.listen(2.0) == "none"
    assert listener.listen(0.0) is None


@pytest.mark.skipif(shutil.which("flite") is None, reason="needs flite")
def test_a_spoken_answer_is_heard(tmp_path):
    file = tmp_path / "no.wav"
    subprocess.run(["flite", "-voice", "slt", "-t", "no thank you", "-o", file], check=True)
    assert MicrophoneListener(DOMAIN, WaveSource.of_file(file)).listen(5.0) == "neg"


def test_a_domain_without_sentences_is_refused():
    domain = load_domain("museum")
    with pytest.raises(
        DomainError, match=r"domain.toml: no \[planning.utterances\]; `lcorpp observe` measures"
    ):
        MicrophoneListener(domain, WaveSource(np.zeros(16000)))
