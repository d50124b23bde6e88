"""Attention among five people in the corridor of ir-sim: the index and simpler rules.

    OMP_NUM_THREADS=1 python benchmarks/robot/attention.py --folder RESULTS [--hours 30] [--out TABLE.md]

Each hour has equal people for all rules; it is simulated once and kept in the folder, so that a run that is
stopped continues. Intervals are of paired differences, by bootstrap over the hours.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from attending import RULES, Learners, Scenario, run_hour
from forecast import Forecast
from rich.console import Console
from training import train_streams
from walkers import Patience

from lcorpp import Planner, Reasoner, load_domain
from lcorpp.assembly import solve_domain
from lcorpp.files import make_folder, write_atomically

CONFIDENCE, RESAMPLES = 0.95, 10_000
RULE_NAMES = {
    "arrival": "order of arrival",
    "posterior": "highest posterior",
    "rate": "value per second (q = 0)",
    "index": "index",
}

HEADER = """| patience | rule | interested people served | of those who came | than in order of arrival | \
than highest posterior |
|---|---|---|---|---|---|
"""


def main(
    folder: Annotated[Path, typer.Option(help="Results, hour by hour.")],
    hours: Annotated[int, typer.Option(min=2)] = 30,
    per_minute: Annotated[float, typer.Option(min=0.1, help="People who come in a minute.")] = 7.5,
    people: Annotated[int, typer.Option(min=1, help="In the corridor at a time, at most.")] = 10,
    service: Annotated[float, typer.Option(min=0, help="Seconds that a served person takes.")] = 5.0,
    equal: Annotated[float, typer.Option(min=1, help="Mean patience if it is equal, in seconds.")] = 40.0,
    hurried: Annotated[float, typer.Option(min=1, help="Mean patience of half of the people.")] = 8.0,
    patient: Annotated[float, typer.Option(min=1, help="That of the others.")] = 72.0,
    shape: Annotated[float, typer.Option(min=0.1, help="Of the gamma distribution; 1: exponential.")] = 4.0,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    out: Annotated[Path | None, typer.Option(metavar="FILE")] = None,
) -> None:
    """Simulate the hours that are missing, and print or write the table."""
    kinds = {"hurried": Patience(0.5, hurried, shape), "patient": Patience(0.5, patient, shape)}
    scenarios = [
        Scenario("equal", {"usual": Patience(1.0, equal, shape)}, per_minute, people, service),
        Scenario("of two kinds", kinds, per_minute, people, service),
    ]
    make_folder(folder)
    for scenario in scenarios:
        simulate(folder, scenario, hours, seed)
    table = HEADER + "".join(row for scenario in scenarios for row in describe(folder, scenario, hours, seed))
    if out is None:
        Console().print(table, markup=False, soft_wrap=True)
    else:
        make_folder(out.parent)
        write_atomically(out, table)


def simulate(folder: Path, scenario: Scenario, hours: int, seed: int) -> None:
    """Simulate the missing hours of a scenario; what a rule learns is kept with its last hour."""
    files = {rule: name_file(folder, scenario, rule, seed) for rule in RULES}
    if all(len(read_hours(file)) >= hours for file in files.values()):
        return
    domain = load_domain("intention")
    streams_file = folder / f"streams-{seed}.pkl"
    if not streams_file.exists():
        streams_file.write_bytes(pickle.dumps(train_streams(domain, seed)))
    for hour in range(hours):
        for rule, file in files.items():
            if len(read_hours(file)) > hour:
                continue
            learnt = file.with_suffix(".pkl")
            learners = pickle.loads(learnt.read_bytes()) if learnt.exists() else Learners()
            planner = Planner(solve_domain(domain))
            streams = pickle.loads(streams_file.read_bytes())
            parts = streams, Reasoner(domain.soft_program()), planner, Forecast(domain, planner)
            result = run_hour(domain, parts, scenario, rule, hour, seed, learners)
            if rule == "index":
                learnt.write_bytes(pickle.dumps(learners))
            with file.open("a") as lines:
                lines.write(json.dumps(result) + "\n")


def name_file(folder: Path, scenario: Scenario, rule: str, seed: int) -> Path:
    """Return the file of the hours of a rule, one a line."""
    numbers = f"{scenario.per_minute:g}-{scenario.max_people}-{scenario.service:g}"
    means = "-".join(f"{own.mean:g}x{own.shape:g}" for own in scenario.patience.values())
    return folder / f"{means}-{numbers}-{seed}-{rule}.jsonl"


def read_hours(file: Path) -> list[Mapping[str, float]]:
    """Return the results of the hours so far."""
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def describe(folder: Path, scenario: Scenario, hours: int, seed: int) -> Iterator[str]:
    """Yield a row for each rule."""
    results = {rule: read_hours(name_file(folder, scenario, rule, seed))[:hours] for rule in RULES}
    served = {rule: np.array([hour.get("served", 0) for hour in own]) for rule, own in results.items()}
    came = sum(hour["interested"] for hour in results["arrival"])
    patience = " or ".join(f"{own.mean:g} s" for own in scenario.patience.values())
    for number, (rule, own) in enumerate(served.items()):
        compared = [compare(own, served[base]) if number > RULES.index(base) else "" for base in RULES[:2]]
        yield (
            f"| {scenario.name}, {patience} | {RULE_NAMES[rule]} | {own.sum()} | {own.sum() / came:.3f} |"
            f" {compared[0]} | {compared[1]} |\n"
        )


def compare(served: np.ndarray, base: np.ndarray) -> str:
    """Return how many more people are served, in %, and its interval."""
    rows = np.random.default_rng(0).integers(0, len(served), (RESAMPLES, len(served)))
    gains = served[rows].sum(axis=1) / base[rows].sum(axis=1) - 1
    low, high = np.quantile(gains, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return f"{served.sum() / base.sum() - 1:+.1%} ({low:+.1%} to {high:+.1%})"


if __name__ == "__main__":
    typer.run(main)
