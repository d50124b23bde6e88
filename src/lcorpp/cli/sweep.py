"""`lcorpp sweep`: the scores of strategies in many variants of a domain."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.senses import reject_given

MAX_SHOWN = 10
"""Maximum number of messages about configurations that fail."""


@take_consent
def sweep(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A TOML file: docs/guides/results/sweeps.md.")],
    out: options.OutOption = None,
    formats: options.FormatOption = None,
    jobs: options.JobsOption = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="A Dask scheduler, e.g. tcp://127.0.0.1:8786, whose workers take the place of processes.",
        ),
    ] = None,
) -> None:
    """Score strategies over a grid of noise, costs or knowledge.

    Writes a table, a figure and a paragraph to --out, by default out/NAME of the file. Each configuration is
    kept as soon as it is finished: after Ctrl-C or a crash the same command continues.
    """
    from lcorpp.experiments.sweeps.definition import read_sweep
    from lcorpp.experiments.sweeps.results import summarise, write_sweep
    from lcorpp.experiments.sweeps.running import run_sweep
    from lcorpp.experiments.tables import has_parquet

    if cluster is not None:
        reject_given("the workers of --cluster evaluate everything", jobs=jobs)
    folder = out or Path("out") / file.stem
    with output_files.lock_results(folder, formats):
        read = read_sweep(file)
        total, left = len(read.configurations), ""
        finished = f"finished configurations are kept in {folder}; the same command continues"
        with console.show_progress(
            "evaluating configurations", total, kept=finished, left=lambda: left
        ) as show:

            def advance(done: int, total: int, seconds: float | None) -> None:
                nonlocal left
                left = "" if seconds is None else f", {console.format_time(seconds)} left"
                if seconds is None and done:
                    console.print_note(f"{done} of {total} configurations are of an earlier run")
                show(done, total)

            workers = None if cluster is not None else console.count_processes(jobs)
            result = run_sweep(read, folder, jobs=workers, cluster=cluster, progress=advance)
        for message in result.failures[:MAX_SHOWN]:
            console.warn(f"without scores: {message}")
        if len(result.failures) > MAX_SHOWN:
            console.warn(f"... ({len(result.failures)} in all, listed in sweep.json)")
        written = write_sweep(folder, result, formats=formats)
        console.out.print(summarise(result))
        if not has_parquet():
            console.print_note("the table is written as CSV alone; Parquet needs the extra lcorpp[parquet]")
        console.out.print("wrote " + ", ".join(map(str, written)))
