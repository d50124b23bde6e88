"""P-log programs of growing size, answered by lcorpp and by every peer that is installed, side by side.

    python benchmarks/plog.py [--only chain,dice] [--limit 60] [--out benchmarks/results/plog.md]

Every answer is compared with the exact one before its time is shown. Each engine has a process of its own for
each case, stopped at the limit. The peers are plingo and ProbLog (`pip install plingo problog[sdd]`) and plog
2.0 (a `plog2` command); one that is missing is shown as such.
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
"""Each engine with the modules that it takes; plog2 is a command."""

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
}


def measure(engine: str, family: str, sizes: Sequence[int], limit: float) -> list[Row]:
    """The measurements of one engine on one case; the last says so if it failed or one took too long."""
    command = [sys.executable, str(HERE / "plog_engines.py"), engine, family, *map(str, sizes)]
    said, ended = b"", False
    with tempfile.TemporaryFile() as errors:
        worker = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, start_new_session=True)
        assert worker.stdout is not None
        try:
            while not ended and select.select([worker.stdout], [], [], limit)[0]:
                chunk = os.read(worker.stdout.fileno(), 65536)
                said, ended = said + chunk, not chunk
        finally:
            if not ended:
                os.killpg(worker.pid, signal.SIGKILL)  # with whatever the peer started
            worker.stdout.close()
            code = worker.wait()
        errors.seek(0)
        reasons = errors.read().decode(errors="replace").strip().splitlines()
    rows = [json.loads(line) for line in said.decode().splitlines() if line.startswith("{")]
    if not ended:
        rows.append({"failed": f"{'the next: ' if rows else ''}more than {limit:g} s"})
    elif code and "failed" not in (rows or [{}])[-1]:
        rows.append({"failed": (reasons or [f"exit code {code}"])[-1][:160]})
    return rows


def installed(engine: str) -> bool:
    """Whether an engine can be measured."""
    if engine == "plog2":
        return shutil.which(engine) is not None
    return all(find_spec(module) for module in ENGINES[engine])


def family_rows(family: str, limit: float, console: Console) -> list[list[str]]:
    """The rows of one family's table: size, engine, what, wall, CPU, times lcorpp, notes."""
    rows: list[list[str]] = []
    stopped: dict[str, str] = {}
    for sizes in FAMILIES[family][1]:
        size = f"{sizes[0]}, {sizes[1]} rooms" if len(sizes) > 1 else str(*sizes)
        ours: dict[str, Row] = {}
        for engine in ENGINES:
            if not installed(engine):
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
                if engine == "lcorpp":
                    ours.setdefault(row["kind"], row)
                rows.append([size, engine, *_cells(row, {} if engine == "lcorpp" else ours)])
    return rows


def _time(seconds: float) -> str:
    for unit, name in ((1, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}" if seconds < 1000 * unit else f"{seconds / unit:.0f} {name}"
    return f"{seconds * 1e9:.3g} ns"


def _cells(row: Row, ours: Mapping[str, Row]) -> list[str]:
    """What, wall, CPU, both over ours, and a note."""
    notes = [f"WRONG: {row['wrong']}"] if row["wrong"] else []
    if row["rounds"] == 1:
        notes.append("one round")
    same = ours.get(row["kind"])
    ratios = [_ratio(row[clock] / same[clock]) if same else "" for clock in ("wall", "cpu")]
    if row["kind"] in ("text", "compiled") and "compiled, new" in ours:
        never = f"{_ratio(row['wall'] / ours['compiled, new']['wall'])} × on evidence never met"
        notes.append(f"{_ratio(row['wall'] / ours['compiled']['wall'])} × lcorpp compiled, {never}")
    return [row["what"], _time(row["wall"]), _time(row["cpu"]), *ratios, "; ".join(notes)]


def _ratio(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 10 else f"{ratio:.2g}"


def slower(rows: Sequence[Sequence[str]]) -> list[str]:
    """Where a peer was right and took less wall time than lcorpp, or lcorpp failed, as items of a list."""
    return [
        f"- {' '.join(filter(None, row[:2]))}: {row[7]}"
        if row[1] == "lcorpp"
        else f"- {' '.join(filter(None, row[:2]))}, {row[2]}: {row[3]}, {row[5]} × lcorpp's"
        for row in rows
        if (row[1] == "lcorpp" and (not row[2] or "WRONG" in row[7]))
        or (row[5] and float(row[5].replace(",", "")) < 1 and "WRONG" not in row[7])
    ]


COLUMNS = ("size", "engine", "what", "wall", "CPU", "× wall", "× CPU", "notes")


def shown(title: str, rows: Sequence[Sequence[str]]) -> Table:
    """The table for a terminal."""
    table = Table(title=title, title_justify="left")
    for name in COLUMNS:
        table.add_column(name, justify="right" if name in COLUMNS[3:7] else "left")
    for row in rows:
        table.add_row(*row)
    return table


def markdown(title: str, rows: Sequence[Sequence[str]]) -> str:
    """The same as Markdown."""
    lines = [f"## {title}", "", _line(COLUMNS), _line([*["---"] * 3, *["--:"] * 4, "---"])]
    lost = slower(rows)
    found = ["lcorpp lost here:", "", *lost] if lost else ["lcorpp was nowhere slower here."]
    return "\n".join([*lines, *map(_line, rows), "", *found, ""])


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def conditions(limit: float) -> str:
    """What was measured, where and how."""
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

Every answer was compared with the exact one: to a relative 1e-9, for plingo to 2e-3, for what commands print
to 2e-3 and 1e-5. Times are medians over rounds of repetitions, per question; the × columns are the wall and
CPU time over lcorpp's for the same kind of question in this run. The machine does other work meanwhile: trust
ratios more than times, and CPU more than wall.

"Text to answer" begins with the program's text and ends with the probability, in one process, imports not
counted; a command is the whole process. plingo is called by the steps of its own application less the
printing, ProbLog by its library with each of its compilers, which is fairer to both than their commands.
plingo has no form compiled ahead: each of its questions is one from text. "Compiled" is a program prepared
before with its evidence left open. "In turn" means that the evidences are asked one after the other, again
and again: each was asked before, so lcorpp finds its answer by a look-up; "never met" is the first time that
a circuit meets an evidence. A process that takes more than {limit:g} s for one measurement is stopped, and
its engine not asked larger cases of the family.
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
    parts = [conditions(limit)]
    for family in chosen:
        title, rows = FAMILIES[family][0], family_rows(family, limit, console)
        console.print(shown(title, rows))
        parts.append(markdown(title, rows))
    make_folder(out.parent)
    write_atomically(out, "\n".join(parts))
    console.print(f"written to {out}")


if __name__ == "__main__":
    typer.run(main)
