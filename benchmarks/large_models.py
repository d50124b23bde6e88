"""Load and solve RockSample models as flat .pomdp text with up to 100,000 states.

    python benchmarks/large_models.py [--seconds 60] [--out TABLE.md]

The robot knows its place on a grid and learns by a sensor which rocks are good (Smith and Simmons, "Heuristic
search value iteration for POMDPs", UAI 2004). Every transition and observation is an entry of its own. With a
slip of 0.1 a step may fail, and observations show the place. Times are CPU times of one process; the relative
gap is upper minus lower bound at the start, divided by the lower bound. Memory is the peak of the process.
"""

from __future__ import annotations

import json
import os
import platform
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from datetime import date
from math import dist
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from lcorpp.files import make_folder, write_atomically

MODELS = ((7, 8, 0.0), (14, 6, 0.0), (10, 10, 0.0), (10, 10, 0.1))
"""Grid size, rocks and slip."""

HALF_DISTANCE = 20.0
"""Distance at which the sensor's accuracy has fallen halfway from 1 to 0.5."""

SCRIPT = """
import json, resource, sys, time
from lcorpp.planning import read_pomdp, solve
memory = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
began = time.process_time()
pomdp = read_pomdp(sys.argv[1])
found = {"states": len(pomdp.states), "load": time.process_time() - began, "load_memory": memory()}
found["quarter"] = None
began = time.process_time()
def note(now):
    spent = time.process_time() - began
    if found["quarter"] is None and now.upper - now.lower <= 0.25 * abs(now.lower):
        found["quarter"] = spent
    if spent > float(sys.argv[2]):
        raise KeyboardInterrupt
solution = solve(pomdp, precision=1e-3, time_limit=100 * float(sys.argv[2]), callback=note)
found |= {"lower": solution.lower, "upper": solution.upper, "memory": memory(), "vectors": solution.vectors}
print(json.dumps(found))
"""


def main(
    seconds: Annotated[float, typer.Option(help="CPU time of each search.")] = 60.0,
    out: Annotated[Path, typer.Option(help="The table.")] = Path("benchmarks/results/large-models.md"),
) -> None:
    """Measure, then write a table."""
    console = Console(stderr=True)
    lines = [
        "# Large models: RockSample as flat text",
        "",
        f"`python benchmarks/large_models.py --seconds {seconds:g}`, {date.today()}, {platform.machine()},"
        f" {os.cpu_count()} cores, Python {platform.python_version()}; one core, CPU time.",
        "",
        "| grid, rocks, slip | states | text | load | peak after it | relative gap of 25 % after"
        " | bounds at the end | relative gap | vectors | peak memory |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for grid, rocks, slip in MODELS:
            console.print(f"{grid} x {grid}, {rocks} rocks, slip {slip:g} ...")
            path = Path(folder) / "model.pomdp"
            with path.open("w") as file:
                file.writelines(format_rock_sample(grid, rocks, slip))
            found = _measure(path, seconds)
            quarter = "-" if found["quarter"] is None else f"{found['quarter']:.1f} s"
            gap = (found["upper"] - found["lower"]) / abs(found["lower"])
            cells = [
                f"{grid} x {grid}, {rocks}, {slip:g}",
                f"{found['states']}",
                f"{path.stat().st_size / 1e6:.0f} MB",
                f"{found['load']:.1f} s",
                f"{found['load_memory']:.0f} MB",
                quarter,
                f"{found['lower']:.4g}, {found['upper']:.4g}",
                f"{gap:.1%}",
                f"{found['vectors']}",
                f"{found['memory']:.0f} MB",
            ]
            lines.append("| " + " | ".join(cells) + " |")
    make_folder(out.parent)
    write_atomically(out, "\n".join(lines) + "\n")
    console.print(f"wrote {out}")


def _measure(path: Path, seconds: float) -> dict[str, Any]:
    command = [sys.executable, "-c", SCRIPT, str(path), str(seconds)]
    found: dict[str, Any] = json.loads(
        subprocess.run(command, capture_output=True, text=True, check=True).stdout
    )
    return found


def format_rock_sample(grid: int, rocks: int, slip: float, seed: int = 1) -> Iterator[str]:
    """Yield the lines of a model with `rocks` rocks at random places."""
    places = [(x, y) for y in range(grid) for x in range(grid)]
    rock_places = random.Random(seed).sample(places, rocks)
    sets = 2**rocks  # bit i: rock i is good
    end = len(places) * sets
    moves = {"north": (0, 1), "south": (0, -1), "west": (-1, 0), "east": (1, 0)}
    actions = [*moves, "sample", *(f"check{i}" for i in range(rocks))]
    seen = {place: f"at{number}" for number, place in enumerate(places)} if slip else {}
    names = [
        "none",
        "good",
        "bad",
        *(f"{name}{kind}" for name in seen.values() for kind in ("", "good", "bad")),
    ]
    start = places.index((0, grid // 2)) * sets
    yield f"discount: 0.95\nvalues: reward\nstates: {end + 1}\nactions: {' '.join(actions)}\n"
    yield f"observations: {' '.join(names)}\n"
    yield f"start include: {' '.join(map(str, range(start, start + sets)))}\n"
    for action in actions:
        for number, (x, y) in enumerate(places):
            step = moves.get(action, (0, 0))
            x_next, y_next = x + step[0], min(max(y + step[1], 0), grid - 1)
            leaves = x_next == grid
            there = places.index((max(x_next, 0), y_next)) if not leaves else 0
            for good in range(sets):
                state, target, reward = number * sets + good, there * sets + good, 0.0
                if leaves:
                    target, reward = end, 10.0
                elif action == "sample" and (x, y) in rock_places:
                    bit = 1 << rock_places.index((x, y))
                    target, reward = number * sets + (good & ~bit), 10.0 if good & bit else -10.0
                elif action == "sample":
                    reward = -100.0
                stays = slip if action in moves and target != state else 0.0
                yield f"T: {action} : {state} : {target} {1 - stays}\n"
                if stays:
                    yield f"T: {action} : {state} : {state} {stays}\n"
                if reward:
                    yield f"R: {action} : {state} : * : * {reward * (1 - stays)}\n"
                place = seen.get((x, y), "")
                if action.startswith("check"):
                    rock = int(action.removeprefix("check"))
                    right = (1 + 2 ** (-dist((x, y), rock_places[rock]) / HALF_DISTANCE)) / 2
                    is_good = right if good >> rock & 1 else 1 - right
                    yield f"O: {action} : {state} : {place}good {is_good:.6f}\n"
                    yield f"O: {action} : {state} : {place}bad {1 - is_good:.6f}\n"
                else:
                    yield f"O: {action} : {state} : {place or 'none'} 1\n"
        yield f"T: {action} : {end} : {end} 1\nO: {action} : {end} : none 1\n"


if __name__ == "__main__":
    typer.run(main)
