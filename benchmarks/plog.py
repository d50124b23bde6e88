"""Compare lcorpp with its installed peers on P-log programs of growing size.

    python benchmarks/plog.py [--only chain,dice] [--limit 60] [--out benchmarks/results/plog.md]

Every answer is compared with the exact one. Each engine runs in a separate process for each case, stopped at
the limit. The peers are plingo and ProbLog (`pip install plingo problog[sdd]`) and plog 2.0 (a `plog2`
command); the table marks peers that are not installed.
"""

from __future__ import annotations

import json
import os
import platform
import select
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from lcorpp.files import make_folder, write_atomically

HERE = Path(__file__).parent
ROOT = HERE.parent
ENGINES = {
    "lcorpp": ("lcorpp",),
    "plingo": ("plingo",),
    "problog-sdd": ("problog", "pysdd"),
    "problog-ddnnf": ("problog",),
    "plog2": (),
}
"""engine -> the modules that it needs; plog2 is a command."""

Row = dict[str, Any]

FAMILIES: dict[str, tuple[str, tuple[tuple[int, ...], ...]]] = {
    "lcorpp": ("The question of the paper: LCORPP's intention, all 12 full evidences", ((),)),
    "chain": ("A chain of n booleans", ((10,), (16,), (100,), (1000,))),
    "dice": ("n dice, one of which shows a six", ((4,), (7,), (40,), (200,))),
    "dice_sum": ("The sum of n dice", ((4,), (7,), (10,), (50,))),
    "squirrel": ("The Bayesian squirrel of n days", ((4,), (16,), (100,), (1000,))),
    "robot": (
        "A robot of n steps on a line of as many places, or of r rooms",
        ((10,), (16,), (100,), (300,), (1000, 20)),
    ),
    "blocks": ("The blocks map of 20 places with n blocks", ((1,), (3,), (5,))),
    "tree": ("A binary tree of booleans of depth n, all leaves observed", ((6,), (8,), (10,), (12,))),
    "noisy_or": (
        "A ring of n diseases and n symptoms (noisy or), all observed",
        ((10,), (14,), (20,), (200,)),
    ),
    "corridor": ("A corridor of n rooms with uncertain two-way doors", ((16,), (20,), (100,), (1000,))),
    "rooms": ("A grid of rooms with uncertain two-way doors", ((3, 3), (5, 3), (6, 6), (10, 4))),
    "assignment": ("n objects at n places, all different", ((5,), (8,), (10,), (14,))),
    "smokers": ("n people, 2 n friendships, three people observed", ((10,), (25,), (50,))),
    "contagion": ("n people in a circle with contacts both ways, some tested", ((8,), (12,), (40,))),
    "supplies": ("n layers of six plants with two lines each from the layer before", ((4,), (8,), (20,))),
    "courses": ("n courses, each after two others", ((15,), (30,), (120,))),
    "rumours": ("A rumour among n people with 3 n / 2 acquaintances", ((8,), (12,), (25,))),
    "outages": ("A power grid of n x n cells, whose outages lock doors of 4 x 4 rooms", ((4,), (8,), (14,))),
}

STRUCTURES = ("tree", "noisy_or", "corridor", "rooms", "assignment")
"""The families of `plog_structures`, written for lcorpp and ProbLog."""

RELATIONS = ("smokers", "contagion", "supplies", "courses", "rumours", "outages")
"""The families of `plog_relations`, in ProbLog, which lcorpp reads, too."""


def measure(engine: str, family: str, sizes: Sequence[int], limit: float) -> list[Row]:
    """Measure one engine on one case; if it fails or exceeds the limit, the last row says why."""
    command = [sys.executable, str(HERE / "plog_engines.py"), engine, family, *map(str, sizes)]
    output, ended = b"", False
    with tempfile.TemporaryFile() as errors:
        worker = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, start_new_session=True)
        assert worker.stdout is not None
        try:
            while not ended and select.select([worker.stdout], [], [], limit)[0]:
                chunk = os.read(worker.stdout.fileno(), 65536)
                output, ended = output + chunk, not chunk
        finally:
            if not ended:
                os.killpg(worker.pid, signal.SIGKILL)  # and the processes that it started
            worker.stdout.close()
            code = worker.wait()
        errors.seek(0)
        reasons = errors.read().decode(errors="replace").strip().splitlines()
    rows = [json.loads(line) for line in output.decode().splitlines() if line.startswith("{")]
    if not ended:
        rows.append({"failed": f"{'the next: ' if rows else ''}more than {limit:g} s"})
    elif code and "failed" not in (rows or [{}])[-1]:
        rows.append({"failed": (reasons or [f"exit code {code}"])[-1][:160]})
    return rows


def is_installed(engine: str) -> bool:
    """Whether an engine is installed."""
    if engine == "plog2":
        return shutil.which(engine) is not None
    return all(find_spec(module) for module in ENGINES[engine])


def measure_family(family: str, limit: float, console: Console) -> list[list[str]]:
    """Measure one family; return rows of size, engine, what, wall, CPU, times lcorpp, notes."""
    rows: list[list[str]] = []
    stopped: dict[str, str] = {}
    for sizes in FAMILIES[family][1]:
        size = f"{sizes[0]}, {sizes[1]} rooms" if len(sizes) > 1 else "".join(map(str, sizes))
        ours: dict[str, Row] = {}
        answer: float | None = None  # the first one, if there is no formula
        for engine in ENGINES:
            if family in (*STRUCTURES, *RELATIONS) and engine in ("plingo", "plog2"):
                continue  # they enumerate the worlds
            if not is_installed(engine):
                found: list[Row] = [{"failed": "not installed"}] if sizes == FAMILIES[family][1][0] else []
            elif engine in stopped:
                found = [{"failed": f"not run: {stopped[engine]}"}]
            else:
                console.print(f"[dim]{family} {size} {engine}", highlight=False)
                found = measure(engine, family, sizes, limit)
            for row in found:
                if "failed" in row:
                    rows.append([size, engine, *[""] * 5, row["failed"]])
                    if row["failed"].startswith("more than") and len(found) == 1:
                        stopped[engine] = f"{row['failed']} at {size}"
                    continue
                if "answer" in row:
                    answer = row["answer"] if answer is None else answer
                    if abs(row["answer"] - answer) > 1e-9 * answer:
                        row["wrong"] = f"{row['answer']:.6g}, not {answer:.6g} as the first engine"
                if engine == "lcorpp":
                    ours.setdefault(row["kind"], row)
                rows.append([size, engine, *_format_cells(row, {} if engine == "lcorpp" else ours)])
    return rows


def _format_time(seconds: float) -> str:
    for unit, name in ((1, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}" if seconds < 1000 * unit else f"{seconds / unit:.0f} {name}"
    return f"{seconds * 1e9:.3g} ns"


def _format_cells(row: Row, ours: Mapping[str, Row]) -> list[str]:
    """Format what, wall, CPU, both over lcorpp's, and a note."""
    notes = [f"WRONG: {row['wrong']}"] if row["wrong"] else []
    if row["rounds"] == 1:
        notes.append("one round")
    same = ours.get(row["kind"])
    ratios = [_format_ratio(row[clock] / same[clock]) if same else "" for clock in ("wall", "cpu")]
    if row["kind"] in ("text", "compiled") and "compiled, new" in ours:
        never = f"{_format_ratio(row['wall'] / ours['compiled, new']['wall'])} × on new evidence"
        notes.append(f"{_format_ratio(row['wall'] / ours['compiled']['wall'])} × lcorpp compiled, {never}")
    return [row["what"], _format_time(row["wall"]), _format_time(row["cpu"]), *ratios, "; ".join(notes)]


def _format_ratio(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 10 else f"{ratio:.2g}"


def list_losses(rows: Sequence[Sequence[str]]) -> list[str]:
    """List the rows in which a correct peer was faster than lcorpp, or lcorpp failed, as Markdown items."""
    return [
        f"- {' '.join(filter(None, row[:2]))}: {row[7]}"
        if row[1] == "lcorpp"
        else f"- {' '.join(filter(None, row[:2]))}, {row[2]}: {row[3]}, {row[5]} × lcorpp's"
        for row in rows
        if (row[1] == "lcorpp" and (not row[2] or "WRONG" in row[7]))
        or (row[5] and float(row[5].replace(",", "")) < 1 and "WRONG" not in row[7])
    ]


COLUMNS = ("size", "engine", "what", "wall", "CPU", "× wall", "× CPU", "notes")


def make_table(title: str, rows: Sequence[Sequence[str]]) -> Table:
    """Return the table for a terminal."""
    table = Table(title=title, title_justify="left")
    for name in COLUMNS:
        table.add_column(name, justify="right" if name in COLUMNS[3:7] else "left")
    for row in rows:
        table.add_row(*row)
    return table


def format_markdown(title: str, rows: Sequence[Sequence[str]]) -> str:
    """Return the table as Markdown."""
    lines = [f"## {title}", "", _format_line(COLUMNS), _format_line([*["---"] * 3, *["--:"] * 4, "---"])]
    losses = list_losses(rows)
    summary = ["lcorpp lost here:", "", *losses] if losses else ["lcorpp was nowhere slower here."]
    return "\n".join([*lines, *map(_format_line, rows), "", *summary, ""])


def _format_line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def describe_conditions(limit: float) -> str:
    """Describe the machine, the versions and the method."""
    names = ("lcorpp", "plingo", "problog", "pysdd", "clingo", "numpy")
    versions = [f"{name} {_version(name)}" for name in names]
    versions.append("plog2 " + (shutil.which("plog2") or "not installed"))
    git = ["git", "--no-optional-locks", "-C", str(ROOT)]
    commit = subprocess.run(
        [*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True
    ).stdout.strip()
    status = [*git, "status", "--porcelain", "--", "src"]
    changed = subprocess.run(status, capture_output=True, text=True).stdout.strip()
    load = " ".join(f"{number:.1f}" for number in os.getloadavg())
    return f"""# P-log: lcorpp and its peers

{date.today()}, `python benchmarks/plog.py {" ".join(sys.argv[1:])}`

{_processor()}, {os.cpu_count()} cores, load {load} at the start, Python {platform.python_version()};
{", ".join(versions)}; commit {commit}{" with uncommitted changes in src" if changed else ""}.

Every answer was compared with the exact one: to a relative 1e-9, for plingo to 2e-3, for the output of
commands to 2e-3 and 1e-5. Of relational programs there is no formula: answers of engines are compared with
each other, where several end in time. Times are medians over rounds of repetitions, per question; the ×
columns are the wall and CPU time over lcorpp's for the same kind of question in this run. The machine also
did other work: trust ratios more than times, and CPU more than wall.

"Text to answer" begins with the program's text and ends with the probability, in one process, without
imports; a command is the whole process. plingo runs the steps of its own application without printing,
ProbLog its library with each of its compilers, which is fairer to both than their commands. plingo cannot
compile ahead: each of its questions starts from text. "Compiled" is a compiled program with open evidence.
"In turn" repeats a list of evidences: lcorpp has answered each before and looks the answer up; "new" is the
first time that a circuit gets an evidence. A process that takes more than {limit:g} s for one measurement
is stopped, and its engine gets no larger case of the family.
"""


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()


def main(
    only: Annotated[str, typer.Option(help="Families, with commas between.")] = ",".join(FAMILIES),
    limit: Annotated[float, typer.Option(help="Seconds for one engine on one case.")] = 60.0,
    out: Annotated[Path, typer.Option(help="The Markdown file to write.")] = HERE / "results" / "plog.md",
) -> None:
    """Compare lcorpp with its installed peers on families of P-log programs."""
    chosen = [name for name in only.split(",") if name]
    unknown = [name for name in chosen if name not in FAMILIES]
    if unknown:
        raise typer.BadParameter(f"unknown family {unknown[0]!r}; expected some of {', '.join(FAMILIES)}")
    console = Console()
    parts = [describe_conditions(limit)]
    for family in chosen:
        title, rows = FAMILIES[family][0], measure_family(family, limit, console)
        console.print(make_table(title, rows))
        parts.append(format_markdown(title, rows))
    make_folder(out.parent)
    write_atomically(out, "\n".join(parts))
    console.print(f"written to {out}")


if __name__ == "__main__":
    typer.run(main)
