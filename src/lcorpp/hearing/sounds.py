"""Sounds without speech, synthesised: tones, chords, music, motors, fans, coughs, knocks and others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from scipy.signal import lfilter

from lcorpp.hearing.noises import set_level
from lcorpp.hearing.synthesis import (
    draw_log_uniform,
    drift,
    filter_band,
    mix,
    modulate,
    oscillate,
    play_note,
    repeat_event,
    resonate,
)
from lcorpp.values import Array
from lcorpp.worlds.speech.waves import RATE

SECONDS = (0.4, 4.0)
"""Limits of a sound's duration."""

LEVELS = (-15.0, 12.0)
"""Limits of a sound's level relative to speech, in dB."""

SEMITONE = 2 ** (1 / 12)

SCALE = (0, 2, 4, 5, 7, 9, 11, 12)
"""The major scale, in semitones."""


def make_sound(kind: str, rng: np.random.Generator) -> Array:
    """Return a sound (n,) of a kind of `SOUNDS`, of a random duration and level."""
    n = round(rng.uniform(*SECONDS) * RATE)
    sound = set_level(SOUNDS[kind](rng, n))
    fade = min(160, len(sound) // 2)
    sound[:fade] *= np.linspace(0, 1, fade)
    sound[-fade:] *= np.linspace(1, 0, fade)
    scaled: Array = sound * min(10 ** (rng.uniform(*LEVELS) / 20), 0.99 / np.abs(sound).max())
    return scaled


def _tone(rng: np.random.Generator, n: int) -> Array:
    return oscillate(rng, np.full(n, draw_log_uniform(rng, 60, 3000)))


def _hum(rng: np.random.Generator, n: int) -> Array:
    depth = rng.uniform(0.2, 1)
    return oscillate(rng, np.full(n, draw_log_uniform(rng, 60, 1500))) * (
        1 + depth * modulate(rng, n, 0.5, 15)
    )


def _vibrato(rng: np.random.Generator, n: int) -> Array:
    depth = draw_log_uniform(rng, 0.005, 0.3)
    return oscillate(rng, draw_log_uniform(rng, 80, 1500) * (1 + depth * modulate(rng, n, 0.5, 12)))


def _chirp(rng: np.random.Generator, n: int) -> Array:
    ends = np.log([draw_log_uniform(rng, 80, 4000), draw_log_uniform(rng, 80, 4000)])
    return oscillate(rng, np.exp(np.linspace(ends[0], ends[1], n)))


def _siren(rng: np.random.Generator, n: int) -> Array:
    low, octaves, wave = draw_log_uniform(rng, 200, 1000), rng.uniform(0.2, 1.5), modulate(rng, n, 0.3, 4)
    return oscillate(rng, low * 2 ** (octaves * (np.sign(wave) if rng.random() < 0.4 else wave)))


def _beeps(rng: np.random.Generator, n: int) -> Array:
    frequency, seconds, partials = (
        draw_log_uniform(rng, 300, 3000),
        rng.uniform(0.04, 0.4),
        int(rng.integers(1, 6)),
    )
    gap = seconds + rng.uniform(0.03, 0.4)
    return repeat_event(rng, n, (gap, gap), lambda: play_note(rng, frequency, seconds, partials, 0))


def _chord(rng: np.random.Generator, n: int) -> Array:
    root, third = draw_log_uniform(rng, 80, 600), int(rng.choice((3, 4, 5)))
    steps, decay = (0, third, 7, 12)[: int(rng.integers(2, 5))], float(rng.choice((0, 1, 3)))
    partials = int(rng.integers(1, 8))
    return sum(
        (play_note(rng, root * SEMITONE**step, n / RATE, partials, decay) for step in steps),
        start=np.zeros(n),
    )


def _melody(rng: np.random.Generator, n: int) -> Array:
    root, partials, decay = draw_log_uniform(rng, 100, 800), int(rng.integers(1, 10)), rng.uniform(0, 6)
    beat = rng.uniform(0.1, 0.5)
    return repeat_event(
        rng,
        n,
        (beat, 2 * beat),
        lambda: play_note(rng, root * SEMITONE ** int(rng.choice(SCALE)), 1.5 * beat, partials, decay),
    )


def _band(rng: np.random.Generator, n: int) -> Array:
    """Return music: chords, a melody and drums."""
    parts = [set_level(make(rng, n)) for make in (_chord, _melody, _drum)]
    longest = max(map(len, parts))
    return sum((np.pad(part, (0, longest - len(part))) for part in parts), start=np.zeros(longest))


def _pluck(rng: np.random.Generator, n: int) -> Array:
    """Return plucked strings (Karplus and Strong 1983)."""

    def string() -> Array:
        period = round(RATE / draw_log_uniform(rng, 80, 700))
        burst = np.concatenate([rng.uniform(-1, 1, period), np.zeros(RATE)])
        loop = np.zeros(period + 2)
        loop[0], loop[period], loop[period + 1] = 1, -0.498, -0.498
        plucked: Array = lfilter([1.0], loop, burst)
        return plucked

    return repeat_event(rng, n, (0.15, 0.7), string)


def _bell(rng: np.random.Generator, n: int) -> Array:
    root, t = draw_log_uniform(rng, 200, 1500), np.arange(2 * RATE) / RATE

    def strike() -> Array:
        ratios = np.array([0.5, 1, 1.19, 1.5, 2, 2.74, 3.76]) * rng.uniform(0.99, 1.01, 7)
        waves = np.exp(-t[:, None] * ratios * rng.uniform(1, 4)) * np.sin(
            2 * np.pi * t[:, None] * root * ratios
        )
        struck: Array = waves @ rng.uniform(0.2, 1, 7)
        return struck

    return repeat_event(rng, n, (0.2, 1.2), strike)


def _whistle(rng: np.random.Generator, n: int) -> Array:
    frequency = draw_log_uniform(rng, 600, 2500) * 2 ** (0.3 * drift(rng, n, 4))
    return oscillate(rng, frequency, int(rng.integers(1, 3))) + 0.03 * rng.normal(size=n)


def _bird(rng: np.random.Generator, n: int) -> Array:
    def call() -> Array:
        ends = np.log([draw_log_uniform(rng, 1500, 6000), draw_log_uniform(rng, 1500, 6000)])
        curve = np.exp(np.linspace(ends[0], ends[1], round(rng.uniform(0.03, 0.2) * RATE)))
        return oscillate(rng, curve, 1) * np.hanning(len(curve))

    return repeat_event(rng, n, (0.06, 0.4), call)


def _motor(rng: np.random.Generator, n: int) -> Array:
    speed = draw_log_uniform(rng, 40, 400) * (1 + rng.uniform(0, 0.1) * drift(rng, n, 3))
    load = 1 + rng.uniform(0, 0.6) * modulate(rng, n, 0.5, 20)
    buzz = set_level(oscillate(rng, speed, 30) * load)
    noise = set_level(filter_band(rng.normal(size=n), rng.uniform(50, 500), rng.uniform(1500, 7000)))
    return mix(buzz, noise, rng.uniform(0.05, 1))


def _engine(rng: np.random.Generator, n: int) -> Array:
    """Return ignitions, each through resonances of the exhaust and the body."""
    speed = draw_log_uniform(rng, 12, 90) * 2 ** (rng.uniform(0, 0.4) * drift(rng, n, 1.5))
    pulses = np.diff(np.floor(np.cumsum(speed) / RATE), prepend=0) * rng.uniform(0.7, 1.3, n)
    pulses = np.convolve(pulses, rng.normal(size=60) * np.exp(-np.arange(60) / 15))[:n]
    return sum(
        (resonate(pulses, draw_log_uniform(rng, 80, 2500), rng.uniform(40, 400)) for _ in range(4)),
        np.zeros(n),
    )


def _drill(rng: np.random.Generator, n: int) -> Array:
    def run() -> Array:
        m = round(rng.uniform(0.3, 1.5) * RATE)
        speed = draw_log_uniform(rng, 150, 900) * (1 - 0.5 * np.exp(-np.arange(m) / RATE / 0.1))
        return oscillate(rng, speed, 20) + 0.5 * rng.normal(size=m)

    return repeat_event(rng, n, (0.5, 2.0), run)


def _fan(rng: np.random.Generator, n: int) -> Array:
    noise = filter_band(rng.normal(size=n), rng.uniform(40, 300), rng.uniform(600, 7000))
    return noise * (1 + rng.uniform(0, 0.7) * modulate(rng, n, 5, 60))


def _wind(rng: np.random.Generator, n: int) -> Array:
    noise = filter_band(rng.normal(size=n), rng.uniform(60, 300), rng.uniform(400, 1500))
    return noise * np.exp(0.8 * drift(rng, n, 3))


def _hiss(rng: np.random.Generator, n: int) -> Array:
    def puff() -> Array:
        m = round(rng.uniform(0.1, 0.8) * RATE)
        low = rng.uniform(300, 3000)
        return filter_band(rng.normal(size=m), low, rng.uniform(low + 500, 7800)) * np.hanning(m)

    return repeat_event(rng, n, (0.2, 1.0), puff)


def _cough(rng: np.random.Generator, n: int) -> Array:
    """Return bursts of breath through the resonances of a throat, partly voiced."""
    formants = [(rng.uniform(400, 900), 150), (rng.uniform(1000, 1900), 250), (rng.uniform(2200, 3200), 400)]

    def burst() -> Array:
        t = np.arange(round(rng.uniform(0.15, 0.45) * RATE)) / RATE
        voice = oscillate(rng, np.full(len(t), rng.uniform(90, 300)) * (1 - 0.4 * t), 20)
        source = rng.normal(size=len(t)) + rng.uniform(0, 0.6) * voice
        envelope = np.minimum(t / 0.01, 1) * np.exp(-t / rng.uniform(0.03, 0.12))
        return sum((resonate(source * envelope, *formant) for formant in formants), np.zeros(len(t)))

    return repeat_event(rng, n, (0.3, 0.8), burst)


def _bark(rng: np.random.Generator, n: int) -> Array:
    first, second, pitch = rng.uniform(500, 1000), rng.uniform(1200, 2000), draw_log_uniform(rng, 200, 700)

    def bark() -> Array:
        t = np.arange(round(rng.uniform(0.1, 0.3) * RATE)) / RATE
        curve = pitch * (1 + 0.4 * np.sin(np.pi * t / t[-1]))
        source = (oscillate(rng, curve, 20) + 0.4 * rng.normal(size=len(t))) * np.hanning(len(t))
        return resonate(source, first, 200) + resonate(source, second, 300)

    return repeat_event(rng, n, (0.25, 1.0), bark)


def _clap(rng: np.random.Generator, n: int) -> Array:
    def clap() -> Array:
        t = np.arange(round(0.15 * RATE)) / RATE
        low = rng.uniform(400, 1500)
        noise = filter_band(rng.normal(size=len(t)), low, rng.uniform(low + 800, 7000))
        return noise * np.exp(-t / rng.uniform(0.005, 0.03)) * rng.uniform(0.5, 1)

    return repeat_event(rng, n, (0.15, 0.7), clap)


def _knock(rng: np.random.Generator, n: int) -> Array:
    frequency, width = draw_log_uniform(rng, 80, 900), rng.uniform(20, 150)

    def knock() -> Array:
        hit = np.zeros(round(0.25 * RATE))
        hit[:20] = rng.normal(size=20)
        return resonate(hit, frequency, width) + 0.3 * resonate(hit, 2.7 * frequency, 2 * width)

    return repeat_event(rng, n, (0.1, 0.8), knock)


def _drum(rng: np.random.Generator, n: int) -> Array:
    t, beat = np.arange(round(0.3 * RATE)) / RATE, rng.uniform(0.15, 0.5)

    def hit() -> Array:
        if rng.random() < 0.5:
            boom: Array = np.sin(2 * np.pi * (60 * t + 4 * (1 - np.exp(-t / 0.03)))) * np.exp(-t / 0.08)
            return boom
        return 0.5 * rng.normal(size=len(t)) * np.exp(-t / rng.uniform(0.02, 0.08))

    return repeat_event(rng, n, (beat, beat), hit)


def _clicks(rng: np.random.Generator, n: int) -> Array:
    def click() -> Array:
        hit = rng.normal(size=200) * np.exp(-np.arange(200) / 40)
        return resonate(hit, rng.uniform(1000, 5000), 800) * rng.uniform(0.3, 1)

    return repeat_event(rng, n, (0.04, 0.3), click)


SOUNDS: Mapping[str, Callable[[np.random.Generator, int], Array]] = MappingProxyType(
    {
        "tone": _tone,
        "hum": _hum,
        "vibrato": _vibrato,
        "chirp": _chirp,
        "siren": _siren,
        "beeps": _beeps,
        "chord": _chord,
        "melody": _melody,
        "music": _band,
        "pluck": _pluck,
        "bell": _bell,
        "whistle": _whistle,
        "bird": _bird,
        "motor": _motor,
        "engine": _engine,
        "drill": _drill,
        "fan": _fan,
        "wind": _wind,
        "hiss": _hiss,
        "cough": _cough,
        "bark": _bark,
        "clap": _clap,
        "knock": _knock,
        "drum": _drum,
        "clicks": _clicks,
    }
)
"""Kind -> function of a generator and a number of samples that returns samples of any level."""
