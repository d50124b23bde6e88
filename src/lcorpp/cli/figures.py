"""`lcorpp figures`: the figures of the paper and the report."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options import common as options
from lcorpp.files import check_matplotlib


def figures(
    name: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="strategies, knowledge, trust, partial, augmentation, confusion, trial; all by default.",
        ),
    ] = None,
    fast: Annotated[
        bool,
        typer.Option(
            "--fast",
            help="Fewer people, tracks and seeds: a look at all figures in a minute; less is decided.",
        ),
    ] = False,
    trials: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=options.MAX_TRIALS,
            help="Simulated people per setting, at least 100; 5000, or 1000 with --fast.",
        ),
    ] = None,
    seed: options.SeedOption = 0,
    again: Annotated[
        bool,
        typer.Option("--again", help="Replace the figures of another version or other options in --out."),
    ] = False,
    out: options.OutOption = Path("out/figures"),
    jobs: options.JobsOption = None,
) -> None:
    """Rebuild the paper's figures and tables.

    A report has our numbers beside the authors'.
    Each figure is written as soon as it is finished; after Ctrl-C the same command continues.
    """
    from lcorpp.experiments.figures.registry import find_figures

    names = find_figures(name or [])  # before the slow imports
    check_matplotlib()
    from lcorpp.experiments.figures.result import FigureOptions
    from lcorpp.experiments.figures.running import FigureRun
    from lcorpp.experiments.tables import has_parquet

    chosen = FigureOptions(fast, seed, console.count_processes(jobs), trials)
    folder = out or Path("out/figures")
    with output_files.lock_results(folder, ["png"]):
        if not has_parquet():
            console.print_note("tables are written as CSV alone; Parquet needs the extra lcorpp[parquet]")
        run = FigureRun(folder, names, chosen, again=again)

        def describe_remaining() -> str:
            parts = ((run.remaining.step_seconds, "of this step"), (run.remaining.seconds, "of all figures"))
            return "".join(f", {console.format_time(left)} {what}" for left, what in parts if left)

        progress = partial(console.show_progress, left=describe_remaining)
        for number, figure in enumerate(run.make(progress), 1):
            how = "kept from an earlier run" if figure.reused else f"{figure.seconds:.1f} s"
            left = run.remaining.seconds
            rest = f"; about {console.format_time(left)} left" if left else ""
            console.out.print(f"{figure.name}: {how} ({number} of {len(names)}{rest})")
        console.out.print(f"wrote {folder / 'report.html'}")
