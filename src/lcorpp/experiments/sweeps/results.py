"""The files of a sweep: the table, the figure, the paragraph and a description."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lcorpp.experiments.sweeps.hypotheses import describe_results
from lcorpp.experiments.sweeps.running import SweepResult
from lcorpp.experiments.tables import has_parquet, write_csv, write_json, write_parquet
from lcorpp.files import choose_formats, make_folder, write_atomically

FORMATS = ("svg", "pdf", "png")


def summarise(result: SweepResult) -> str:
    """Return the paragraph of a sweep."""
    sweep = result.sweep
    problem = sweep.problem
    how = "exact scores" if problem.trials is None else f"{problem.trials} simulated people each"
    preset = f", preset {problem.preset}" if problem.preset else ""
    axes = [".".join(axis) for axis in sweep.axes]
    return describe_results(result.rows, axes, f"{problem.domain}{preset}, {how}")


def write_sweep(folder: Path, result: SweepResult, *, formats: Sequence[str] | None = None) -> list[Path]:
    r"""Write sweep.csv, sweep.parquet (with the extra `parquet`), sweep.txt, sweep.json and the figure.

    Args:
        folder: created if missing. result: of `run_sweep`.
        formats: of the figure: "png", "svg", "pdf"; by default all, or none without matplotlib.

    Returns:
        The files.

    Raises:
        FileError: a file cannot be written, or formats are given without matplotlib.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.experiments import read_sweep, run_sweep, write_sweep
        >>> text = 'domain = "intention"\nstrategies = ["LCORPP"]\n[axes]\nnoise = [0.1]\n'
        >>> _ = Path("one_noise.toml").write_text(text)
        >>> result = run_sweep(read_sweep(Path("one_noise.toml")), "one_noise")
        >>> files = write_sweep(Path("one_noise"), result, formats=[])  # no figure
        >>> [file.name for file in files if file.suffix != ".parquet"]  # which needs pyarrow
        ['sweep.csv', 'sweep.txt', 'sweep.json']
    """
    formats = choose_formats(formats, FORMATS)
    make_folder(folder)
    sweep, rows, text = result.sweep, result.rows, summarise(result)
    table = folder / "sweep.csv"
    write_csv(table, list(dict.fromkeys(name for row in rows for name in row)), rows)
    written = [table, *([write_parquet(folder / "sweep.parquet", rows)] if has_parquet() else [])]
    if formats:
        from lcorpp.experiments.sweeps.figure import plot_sweep  # imports matplotlib
        from lcorpp.plot_style import save_figures

        figure = plot_sweep(rows, [".".join(axis) for axis in sweep.map_axes], len(sweep.axes))
        written += save_figures(figure, folder / "sweep", formats)
    write_atomically(folder / "sweep.txt", f"{text}\n")
    description = {
        "file": str(sweep.file),
        **sweep.identity,
        "axes": {".".join(axis): [s.value for s in settings] for axis, settings in sweep.axes.items()},
        "configurations": len(sweep.configurations),
        "of an earlier run": result.resumed,
        "failed": list(result.failures),
        "seconds": result.seconds,
        "paragraph": text,
    }
    write_json(folder / "sweep.json", description)
    return [*written, folder / "sweep.txt", folder / "sweep.json"]
