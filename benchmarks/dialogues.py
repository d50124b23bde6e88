"""Gap between the bounds of dialogues: a hidden value that questions do not change, and a report that ends.

    python benchmarks/dialogues.py [--seconds 60] [--out TABLE.md] [--only office,medical]

`pomdpsol` of APPL (https://github.com/AdaCompNUS/sarsop) is included if it is on the PATH. Each solver runs
in a process of its own, with the model in a file; times are CPU times as in `sarsop.py`. The share of a gap
is that of what the policy gains at the start over the best one that repeats an action: it reports at once.
"""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from sarsop import History, bounds_at, run_appl, run_lcorpp

from lcorpp import load_domain
from lcorpp.files import make_folder, write_atomically
from lcorpp.planning import Pomdp, SparseTables, write_pomdp
from lcorpp.planning.evaluation.gap_share import compute_repeated_value
from lcorpp.values import Array

MARKS = (10.0, 60.0)
"""CPU times in seconds at which the table shows bounds."""


def make_dialogue(
    prior: Array, questions: Sequence[Array], costs: Sequence[float], reports: Array, discount: float = 0.95
) -> Pomdp:
    """Return a model of a hidden value with a prior (n,).

    questions: arrays (n, m) of P(answer | value). costs: of each. reports: (n, n) reward by report and value.
    """
    n, m = len(prior), max(question.shape[1] for question in questions)
    A = len(questions) + n
    T, Z, R = np.zeros((A, n + 1, n + 1)), np.zeros((A, n + 1, m + 1)), np.zeros((A, n + 1))
    T[:, n, n] = Z[:, n, m] = T[len(questions) :, :, n] = Z[len(questions) :, :, m] = 1
    T[len(questions) :, :n, :n] = 0
    for a, (question, cost) in enumerate(zip(questions, costs, strict=True)):
        T[a, :n, :n] = np.eye(n)
        Z[a, :n, : question.shape[1]] = question
        R[a, :n] = -cost
    R[len(questions) :, :n] = reports
    return make_model(T, Z, R, discount, np.append(prior, 0.0))


def make_model(T: Array, Z: Array, R: Array, discount: float, start: Array) -> Pomdp:
    """Return a model in which states, actions and observations have numbers as names."""
    states, actions, observations = (
        tuple(f"{kind}{i}" for i in range(count))
        for kind, count in (("s", R.shape[1]), ("a", R.shape[0]), ("o", Z.shape[2]))
    )
    tables = SparseTables.of(T), SparseTables.of(Z)
    return Pomdp(states, actions, observations, *tables, R, discount, start)


def make_sensor(values: int, steps: int) -> Pomdp:
    """Return a model of a sensor that is right with .3 at first and with .9 at last; each use costs 1."""
    n, A = values * steps, 1 + values
    T, Z, R = np.zeros((A, n + 1, n + 1)), np.zeros((A, n + 1, values + 1)), np.zeros((A, n + 1))
    T[:, n, n] = Z[:, n, values] = 1
    for s in range(n):
        step, value = divmod(s, values)
        T[0, s, min(step + 1, steps - 1) * values + value] = 1
        right = 0.3 + 0.6 * step / (steps - 1)
        Z[0, s, :values] = (1 - right) / (values - 1)
        Z[0, s, value] = right
        R[0, s], R[1:, s], R[1 + value, s] = -1, -10, 10
        T[1:, s, n] = Z[1:, s, values] = 1
    start = np.append(np.full(values, 1 / values), np.zeros(n + 1 - values))
    return make_model(T, Z, R, 0.95, start)


def make_medical(values: int, tests: int, seed: int) -> Pomdp:
    """Return a model of random diseases, tests with costs of .3 to 3, and wrong reports of random cost."""
    rng = np.random.default_rng(seed)
    prior, questions, costs = rng.dirichlet(np.ones(values)), [], []
    for _ in range(tests):
        positive = 0.05 + 0.9 * rng.beta(0.6, 0.6, size=values)
        questions.append(np.stack([positive, 1 - positive], axis=1))
        costs.append(rng.uniform(0.3, 3))
    reports = rng.uniform(-30, 0, (values, values))
    np.fill_diagonal(reports, 10)
    return make_dialogue(prior, questions, costs, reports)


def make_twenty_questions(values: int, questions: int, seed: int) -> Pomdp:
    """Return a model of random yes/no questions, of which one answer in ten is wrong."""
    rng = np.random.default_rng(seed)
    yes = np.where(rng.random((questions, values)) < 0.5, 0.9, 0.1)
    asked = [np.stack([own, 1 - own], axis=1) for own in yes]
    reports = np.where(np.eye(values) == 1, 20.0, -20.0)
    return make_dialogue(np.full(values, 1 / values), asked, [1.0] * questions, reports)


def make_two_sensors(values: int, seed: int) -> Pomdp:
    """Return a model of places on a line: one sensor confuses neighbours, the other those 3, 6, ... apart."""
    rng, places = np.random.default_rng(seed), np.arange(values)
    near = np.exp(-np.abs(places[:, None] - places) / 0.8)
    alike = np.where(places[:, None] % 3 == places % 3, 1.0, 0.1)
    sensors = [own / own.sum(axis=1, keepdims=True) for own in (near, alike)]
    reports = -10.0 - 2 * np.abs(places[:, None] - places)
    np.fill_diagonal(reports, 10)
    return make_dialogue(rng.dirichlet(np.full(values, 3.0)), sensors, [1.0, 0.7], reports)


MODELS: Mapping[str, Callable[[], Pomdp]] = {
    "office": lambda: load_domain("shopping", preset="office").pomdp,
    "sensor 12 x 8": lambda: make_sensor(12, 8),
    "medical 8, 10 tests": lambda: make_medical(8, 10, 0),
    "medical 20, 20 tests": lambda: make_medical(20, 20, 1),
    "twenty questions, 20 values": lambda: make_twenty_questions(20, 30, 0),
    "twenty questions, 64 values": lambda: make_twenty_questions(64, 40, 1),
    "two sensors, 10 places": lambda: make_two_sensors(10, 0),
}


def main(
    seconds: Annotated[float, typer.Option(help="CPU time for each solver and model.")] = 60.0,
    out: Annotated[Path, typer.Option(help="The table.")] = Path("benchmarks/results/dialogues.md"),
    only: Annotated[str, typer.Option(help="Models whose names begin so, separated by commas.")] = "",
) -> None:
    """Measure, then write a table."""
    console, appl = Console(stderr=True), shutil.which("pomdpsol")
    lines = [
        "# Dialogues: gap over CPU time",
        "",
        f"`python benchmarks/dialogues.py --seconds {seconds:g}`, {date.today()}, {platform.machine()},"
        f" {os.cpu_count()} cores, Python {platform.python_version()}; one core each, CPU time without"
        " reading the model. In brackets: the gap as a share of what lcorpp's last policy gains over"
        " reporting at once.",
        "",
        "| model | states, actions, observations | reports at once | lcorpp, 10 s | lcorpp, 60 s | APPL, 10 s"
        " | APPL, 60 s |",
        "|---|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, make) in enumerate(MODELS.items()):
            if only and not any(name.startswith(part) for part in only.split(",")):
                continue
            console.print(f"{name} ...")
            pomdp, file = make(), Path(folder) / f"{number}.pomdp"
            write_pomdp(pomdp, file)
            found = run_lcorpp(file, seconds)
            ours: History = found["history"] if found else []
            theirs = run_appl(appl, file, seconds)[0] if appl else []
            repeated = compute_repeated_value(pomdp, 1e-6)
            sizes = (len(pomdp.states), len(pomdp.actions), len(pomdp.observations))
            cells = [name, ", ".join(map(str, sizes)), f"{repeated:.2f}"]
            for history in (ours, theirs):
                for mark in MARKS:
                    bounds = bounds_at(history, 1.05 * mark)
                    if bounds is None:
                        cells.append("-")
                        continue
                    share = (bounds[1] - bounds[0]) / (ours[-1][1] - repeated)
                    cells.append(f"{bounds[0]:.3f}, {bounds[1]:.3f} ({share:.1%})")
            lines.append("| " + " | ".join(cells) + " |")
            console.print(lines[-1])
    make_folder(out.parent)
    write_atomically(out, "\n".join(lines) + "\n")


if __name__ == "__main__":
    typer.run(main)
