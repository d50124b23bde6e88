"""A small delivery domain, what, for whom and where to, made with shared variables or with one record."""

from __future__ import annotations

from itertools import product
from pathlib import Path

VARIABLES = {"item": ("tea", "soup"), "person": ("ann", "bob"), "room": ("lab", "hall")}
SHARED = 'shared = ["item", "person", "room"]'
PATTERN = 'reports = "give_{item}_{person}_{room}"'
TRIPLES = tuple(product(*VARIABLES.values()))

PLOG = """
items = {tea, soup}. people = {ann, bob}. rooms = {lab, hall}. times = {noon, night}. sides = {left, right}.
noises = {low, high}.
time : times. item : items. person : people. room : rooms. gaze : sides. voice : noises.
[t] random(time). [p] random(person). [i] random(item). [r] random(room). [g] random(gaze). [v] random(voice).
[p] pr(person=ann | time=noon) = 3/4.
[p] pr(person=ann | time=night) = 1/5.
[i] pr(item=tea | person=ann) = 7/10.
[i] pr(item=tea | person=bob) = 1/10.
[r] pr(room=lab | person=ann, item=tea) = 9/10.
[r] pr(room=lab | person=bob) = 1/3.
[g] pr(gaze=left | item=tea) = 4/5.
[g] pr(gaze=left | item=soup) = 1/4.
[v] pr(voice=low | person=ann) = 2/3.
[v] pr(voice=low | person=bob) = 1/6.
"""
GAZE = """[[learning]]
name = "gaze"
attribute = "gaze"
of = "item"
labels = { left = "tea", right = "soup" }
classifier = "channel"
"""
VOICE = """[[learning]]
name = "voice"
attribute = "voice"
of = "person"
labels = { low = "ann", high = "bob" }
classifier = "channel"
"""


def make_pomdp() -> str:
    """A question about each variable, answered rightly with probability .8, and a report for each triple."""
    states = ["_".join(triple) for triple in TRIPLES]
    answers = [value for values in VARIABLES.values() for value in values]
    lines = [
        "discount: 0.95",
        "values: reward",
        f"states: {' '.join(states)} end",
        f"actions: {' '.join(f'ask_{name}' for name in VARIABLES)} {' '.join(f'give_{s}' for s in states)}",
        f"observations: {' '.join(answers)} none",
        f"start: {' '.join(['0.125'] * 8)} 0",
    ]
    for k, (name, values) in enumerate(VARIABLES.items()):
        lines += [f"T: ask_{name} identity", f"O: ask_{name} : end : none 1", f"R: ask_{name} : * : * : * -1"]
        for triple, state in zip(TRIPLES, states, strict=True):
            lines += [
                f"O: ask_{name} : {state} : {value} {0.8 if value == triple[k] else 0.2}" for value in values
            ]
    for state in states:
        lines += [
            f"T: give_{state} : * : end 1",
            f"O: give_{state} : * : none 1",
            f"R: give_{state} : * : * : * -8",
            f"R: give_{state} : {state} : * : * 8",
        ]
    return "\n".join([*lines, "R: * : end : * : * 0", ""])


def write_domain(
    folder: Path,
    *,
    senses: str = "",
    shared: str = SHARED,
    observed: str = '["time"]',
    reports: str = PATTERN,
    plog: str = PLOG,
    end: str = "",
) -> Path:
    """Write the domain folder with these parts and return it."""
    folder.mkdir(exist_ok=True)
    (folder / "wishes.plog").write_text(plog)
    (folder / "give.pomdp").write_text(make_pomdp())
    states = "" if "item" in shared else 'states = "{wish}"\n'
    (folder / "domain.toml").write_text(
        f'name = "deliveries"\n[reasoning]\nprogram = "wishes.plog"\nobserved = {observed}\n{shared}\n'
        f'{senses}[planning]\nmodel = "give.pomdp"\nterminal = "end"\n{states}{reports}\n{end}'
    )
    return folder


PEOPLE = """
import numpy as np


def gaze(people, rng):
    steps = rng.normal(0.1, 0.1, (len(people), 2, 12))
    steps[[person["item"] == "tea" for person in people]] += 0.08
    return np.cumsum(steps, axis=2)


def voice(people, rng):
    numbers = rng.normal(0, 1, (len(people), 2))
    numbers[[person["person"] == "ann" for person in people]] += 1
    return numbers
"""


def write_learning_domain(folder: Path, *, end: str = "") -> Path:
    """Write the domain with tracks of the gaze and two features of the voice, both simulated."""
    voice = VOICE + 'channels = ["pitch", "pace"]\n'
    senses = (GAZE + voice).replace('classifier = "channel"\n', "")
    write_domain(folder, senses=senses, end=f'[simulation]\npeople = "people.py"\n{end}')
    (folder / "people.py").write_text(PEOPLE)
    return folder
