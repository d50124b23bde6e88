"""Acoustic measures: known answers for tones, chirps and noise, and laws."""

import numpy as np
import pytest

from lcorpp.worlds.speech.acoustics import BANDS, analyse
from lcorpp.worlds.speech.waves import RATE

TIME = np.arange(RATE) / RATE
NOISE = np.random.default_rng(0).normal(size=RATE)


def play(frequency) -> np.ndarray:
    """Return a second of a sine of a frequency in Hz, which may change."""
    return np.sin(2 * np.pi * np.cumsum(np.broadcast_to(frequency, RATE)) / RATE)


@pytest.mark.parametrize("frequency", [80, 123.4, 220, 390])
def test_the_pitch_of_a_tone(frequency):
    tone = analyse(0.1 * play(frequency))
    assert tone.measure_voicing() == 1
    assert tone.measure_longest_voicing() == pytest.approx(0.96, abs=0.02)  # of a second, in frames of 40 ms
    np.testing.assert_allclose(2**tone.pitch, frequency, rtol=1e-3)
    assert tone.measure_glides() == 0
    assert tone.measure_periodicity_change() < 0.01
    mean, change = tone.measure_width()
    assert mean < 1
    assert change < 0.1


def test_noise_has_no_pitch_and_all_bands():
    noise = analyse(0.1 * NOISE)
    assert noise.measure_voicing() == noise.measure_longest_voicing() == noise.measure_glides() == 0
    mean, change = noise.measure_width()
    assert np.log(BANDS) - 0.3 < mean < np.log(BANDS)
    assert change < 0.2


def test_a_gliding_pitch_is_that_of_a_voice_and_steps_are_not():
    glide = analyse(play(np.linspace(120, 240, RATE)))  # an octave in 100 steps
    assert glide.measure_glides() > 0.95
    steps = analyse(play(np.repeat([130, 195, 260, 146], RATE // 4)))
    assert steps.measure_glides() < 0.1


def test_speech_alternates_between_tones_and_noise():
    parts = np.where(TIME % 0.4 < 0.2, 0.1 * play(150), 0.05 * NOISE)
    sound = analyse(parts)
    assert sound.measure_periodicity_change() > 0.3
    assert sound.measure_width()[1] > 0.5
    assert sound.measure_longest_voicing() == pytest.approx(0.2, abs=0.04)


@pytest.mark.parametrize("samples", [0.05 * play(200) + 0.01 * NOISE, 0.05 * NOISE])
def test_measures_do_not_depend_on_the_level(samples):
    one, other = analyse(samples), analyse(8 * samples)
    np.testing.assert_allclose(one.periodicity, other.periodicity, atol=1e-6)
    np.testing.assert_allclose(one.measure_width(), other.measure_width(), atol=1e-6)
    np.testing.assert_array_equal(one.is_loud, other.is_loud)


def test_the_contrast_is_a_difference_of_levels():
    loud = np.where(TIME < 0.5, 0.01, 0.1) * play(1000)
    assert analyse(loud).measure_contrast() == pytest.approx(20, abs=0.1)


@pytest.mark.parametrize("samples", [np.zeros(0), np.zeros(10), np.zeros(RATE), np.full(RATE, 0.5)])
def test_silence_has_finite_measures(samples):
    silence = analyse(samples)
    assert silence.measure_contrast() == silence.measure_voicing() == silence.measure_glides() == 0
    assert np.isfinite(silence.measure_width()).all()
    assert silence.measure_longest_voicing() == 0
