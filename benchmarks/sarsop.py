"""Gap between the bounds over CPU time on published models, compared with APPL's `pomdpsol`.

    python benchmarks/sarsop.py MODEL... [--seconds 10] [--appl-seconds 60] [--out TABLE.md]

`pomdpsol` (https://github.com/AdaCompNUS/sarsop) is included if it is on the PATH. Each solver runs in a
process of its own for each model. Times are CPU times of that process without reading the model: APPL prints
them, those of lcorpp are measured at each change of a bound. Memory is the peak of the whole process; that of
lcorpp includes Python and numpy, some 35 MB, and the policy.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from datetime import date
from math import exp, log
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from lcorpp.files import make_folder, write_atomically

MARKS = (1.0, 10.0)
"""CPU times in seconds at which the table shows gaps."""

PRECISION = 1e-3

LCORPP_SCRIPT = """
import json, resource, sys, time
from lcorpp.planning import read_pomdp, solve
pomdp = read_pomdp(sys.argv[1])
solve(read_pomdp(sys.argv[2]), precision=1.0)  # load all lazily imported modules
history, began = [], time.process_time()
def note(now):
    if not history or (now.lower, now.upper) != (history[-1][1], history[-1][2]):
        history.append((time.process_time() - began, now.lower, now.upper))
    if time.process_time() - began > float(sys.argv[4]):
        raise KeyboardInterrupt
solution = solve(pomdp, precision=float(sys.argv[3]), time_limit=100 * float(sys.argv[4]), callback=note)
history.append((time.process_time() - began, solution.lower, solution.upper))
sizes = [len(pomdp.states), len(pomdp.actions), len(pomdp.observations)]
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps({"sizes": sizes, "history": history, "memory": memory}))
"""

_APPL_ROW = re.compile(
    r"^\s*([\d.e+-]+)\s+\d+\s+\d+\s+([\d.e+-]+)\s+([\d.e+-]+)\s+[\d.e+-]+\s+\d+\s+\d+\s*$", re.M
)

History = list[tuple[float, float, float]]
"""(CPU seconds, lower, upper), by rising time."""


def main(
    models: Annotated[list[Path], typer.Argument(help="Model files.")],
    seconds: Annotated[float, typer.Option(help="CPU time for lcorpp.")] = 10.0,
    appl_seconds: Annotated[float, typer.Option(help="CPU time for APPL.")] = 60.0,
    out: Annotated[Path, typer.Option(help="The table; the plot is written beside it.")] = Path(
        "benchmarks/results/sarsop.md"
    ),
) -> None:
    """Measure, then write a table and a plot."""
    console = Console(stderr=True)
    appl = shutil.which("pomdpsol")
    if not appl:
        console.print("pomdpsol is not on the PATH: measuring lcorpp only")
    found: dict[str, dict[str, History]] = {}
    sizes: dict[str, Sequence[int]] = {}
    memory: dict[str, list[float]] = {}
    for model in models:
        console.print(f"{model.name} ...")
        own = run_lcorpp(model, seconds)
        if own is None:
            console.print(f"{model.name}: lcorpp rejects it")
            continue
        sizes[model.name], found[model.name] = own["sizes"], {"lcorpp": own["history"]}
        memory[model.name] = [own["memory"]]
        if appl:
            found[model.name]["APPL"], peak = run_appl(appl, model, appl_seconds)
            memory[model.name].append(peak)
    if not found:
        raise SystemExit("no model was measured")
    make_folder(out.parent)
    write_atomically(out, _table(found, sizes, memory, seconds, appl_seconds))
    _plot(found, out.with_suffix(".png"))
    console.print(f"wrote {out} and {out.with_suffix('.png')}")


def run_lcorpp(model: Path, seconds: float) -> dict[str, Any] | None:
    warm = Path(__file__).parents[1] / "src/lcorpp/domains/intention/authors.pomdp"
    command = [sys.executable, "-c", LCORPP_SCRIPT, str(model), str(warm), str(PRECISION), str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stderr.strip().splitlines()[-1], file=sys.stderr)
        return None
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def run_appl(command: str, model: Path, seconds: float) -> tuple[History, float]:
    """Parse what APPL prints, empty if it rejects the model; and its peak memory in KiB."""
    options = ["--timeout", str(seconds), "--precision", str(PRECISION), "--output", os.devnull]
    running = subprocess.Popen(
        [command, str(model), *options], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert running.stdout is not None
    printed = running.stdout.read()
    _, _, usage = os.wait4(running.pid, 0)
    return [
        (float(t), float(low), float(high)) for t, low, high in _APPL_ROW.findall(printed)
    ], usage.ru_maxrss


def bounds_at(history: History, seconds: float) -> tuple[float, float] | None:
    """The bounds at a time, None before the first."""
    known = [(low, high) for t, low, high in history if t <= seconds]
    return known[-1] if known else None


def _time_of_gap(history: History, gap: float) -> float | None:
    """The first time at which the gap was at most this wide."""
    return next((t for t, low, high in history if high - low <= gap), None)


def _table(
    found: dict[str, dict[str, History]],
    sizes: dict[str, Sequence[int]],
    memory: dict[str, list[float]],
    seconds: float,
    appl_seconds: float,
) -> str:
    lines = [
        "# SARSOP: gap over CPU time",
        "",
        f"`python benchmarks/sarsop.py MODELS --seconds {seconds:g} --appl-seconds {appl_seconds:g}`,"
        f" {date.today()}, {platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()};"
        f" one core each, CPU time without reading the model; precision {PRECISION:g}. Gap: upper minus"
        " lower bound at the start.",
        "",
        "| model | states, actions, observations | gap at 1 s: lcorpp | APPL | gap at 10 s: lcorpp | APPL"
        " | last bounds: lcorpp | APPL | APPL's last gap after: lcorpp | APPL | ratio"
        " | peak memory: lcorpp | APPL |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    ratios = []
    for model, histories in found.items():
        ours, theirs = histories["lcorpp"], histories.get("APPL", [])
        cells = [model, ", ".join(map(str, sizes[model]))]
        for mark in MARKS:
            cells += [_gap(bounds_at(ours, mark)), _gap(bounds_at(theirs, mark))]
        cells += [_bounds(ours), _bounds(theirs)]
        if theirs:
            gap = max(theirs[-1][2] - theirs[-1][1], PRECISION)
            mine, other = _time_of_gap(ours, gap), _time_of_gap(theirs, gap)
            ratio = other / max(mine, 1e-4) if mine is not None and other is not None else None
            if ratio:
                ratios.append(ratio)
            cells += [_time(mine), _time(other), f"{ratio:.1f}" if ratio else "-"]
        else:
            cells += ["-", "-", "-"]
        cells += [f"{size / 1024:.0f} MB" for size in memory[model]] + ["-"] * (2 - len(memory[model]))
        lines.append("| " + " | ".join(cells) + " |")
    if ratios:
        mean = exp(sum(map(log, ratios)) / len(ratios))
        lines += [
            "",
            f"APPL's time over lcorpp's to APPL's last gap, geometric mean of {len(ratios)}: {mean:.1f}.",
        ]
    return "\n".join(lines) + "\n"


def _gap(bounds: tuple[float, float] | None) -> str:
    return f"{bounds[1] - bounds[0]:.4g}" if bounds else "-"


def _bounds(history: History) -> str:
    return f"{history[-1][1]:.6g}, {history[-1][2]:.6g} ({history[-1][0]:.2f} s)" if history else "-"


def _time(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds:.3g} s"


def _plot(found: dict[str, dict[str, History]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    columns = 3
    rows = -(-len(found) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(12, 2.6 * rows), squeeze=False, layout="constrained")
    for axis, (model, histories) in zip(axes.flat, found.items(), strict=False):
        for (name, history), colour in zip(histories.items(), ("#1b6ca8", "#c0392b"), strict=False):
            if history:
                times = [max(t, 1e-4) for t, _, _ in history]
                axis.step(times, [max(high - low, PRECISION / 10) for _, low, high in history], where="post",
                          label=name, color=colour)  # fmt: skip
        axis.set(title=model, xscale="log", yscale="log")
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.title.set_fontsize(9)
        axis.grid(alpha=0.3)
    for axis in list(axes.flat)[len(found) :]:
        axis.axis("off")
    axes[0, 0].legend()
    figure.supxlabel("CPU time (s)")
    figure.supylabel("upper minus lower bound at the start (reward)")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    typer.run(main)
