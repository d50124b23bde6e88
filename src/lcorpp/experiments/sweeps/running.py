"""Run a sweep: evaluate the configurations that are left, and keep each as soon as it is finished."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from lcorpp.errors import DecisionError
from lcorpp.experiments.sweeps.definition import Sweep
from lcorpp.experiments.sweeps.evaluation import Rows, find_key, try_configuration
from lcorpp.experiments.sweeps.hypotheses import judge_configuration
from lcorpp.files import make_folder
from lcorpp.notebook import html_table
from lcorpp.work_units.running import evaluate_units
from lcorpp.work_units.store import UnitStore

STORE = "units.sqlite"
"""The file of finished configurations in the folder of a sweep."""

Advance = Callable[[int, int, float | None], None]
"""Takes the finished and all configurations, and the remaining seconds; None before their pace is known."""


@dataclass(frozen=True, eq=False)
class SweepResult:
    """The scores of all configurations.

    rows: for each configuration its strategies in their order: the values of the axes, then the cells of
        `evaluate_configuration`, then the verdict on each hypothesis, see `list_hypotheses`.
    failures: messages of the configurations that are impossible, or in which a strategy fails; they have no
        rows.
    resumed: the number of configurations that an earlier run had finished.
    seconds: wall-clock time of this run.
    """

    sweep: Sweep
    rows: Rows
    failures: tuple[str, ...]
    resumed: int
    seconds: float

    def __repr__(self) -> str:
        counts = f"{len(self.sweep.configurations)} configurations, {len(self.failures)} failed"
        return f"<SweepResult {self.sweep.file.name}: {counts}>"

    def _repr_html_(self) -> str:
        axes = [".".join(axis) for axis in self.sweep.axes]
        shown = [
            *axes,
            "strategy",
            *(name for name in ("f1", "accuracy", "cost", "return") if name in self.rows[0]),
        ]
        rows = [
            [f"{x:.3f}" if isinstance(x, float) else str(x) for x in map(row.get, shown)] for row in self.rows
        ]
        return html_table(shown, rows, caption=repr(self)[1:-1])


def run_sweep(
    sweep: Sweep,
    folder: str | Path,
    *,
    jobs: int | None = None,
    cluster: str | None = None,
    progress: Advance = lambda done, total, seconds: None,
) -> SweepResult:
    r"""Score the strategies in all configurations of a sweep.

    The scores are the same for any number of workers: they depend on the sweep and the configuration alone.

    Args:
        folder: keeps finished configurations; with those of the same sweep, perhaps with other values of the
            axes, the run continues. Created if missing.
        jobs: processes; None takes joblib's active configuration, by default this process alone.
        cluster: address of a Dask scheduler, whose workers take the place of processes.
        progress: callback with (configurations done, configurations, estimated seconds left or None).

    Raises:
        DataError: the folder has results of another sweep or version.
        FileError: the folder cannot be written.
        WorkerError: worker processes or the cluster are lost.
        DecisionError: all configurations fail, e.g. an observation has probability 0 for the robot.
        KeyboardInterrupt: an interrupt. Finished configurations are kept in each case.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.experiments import read_sweep, run_sweep
        >>> text = 'domain = "intention"\nstrategies = ["LCORPP"]\n[axes]\nnoise = [0.1, 0.3]\n'
        >>> _ = Path("noise.toml").write_text(text)
        >>> result = run_sweep(read_sweep(Path("noise.toml")), "noise")  # the folder of the results
        >>> [(row["noise"], round(row["accuracy"], 3)) for row in result.rows]
        [(0.1, 0.984), (0.3, 0.88)]
    """
    began = perf_counter()
    units = {find_key(configuration): configuration for configuration in sweep.configurations}
    with UnitStore(make_folder(folder) / STORE, sweep.identity) as store:
        # neighbours share what is read from the domain's files
        left = {key: c for key, c in units.items() if key not in store}
        ordered = sorted(left, key=lambda key: str([s for s in left[key] if s.is_loaded]))
        resumed = done = len(units) - len(left)
        failures: dict[str, str] = {}
        progress(done, len(units), None)
        finished = evaluate_units(
            partial(try_configuration, sweep.problem),
            {key: left[key] for key in ordered},
            jobs=jobs,
            cluster=cluster,
        )
        for key, rows in finished:
            if isinstance(rows, str):
                failures[key] = rows
            else:
                store.add(key, rows)
            done += 1
            pace = (perf_counter() - began) / (done - resumed)
            progress(done, len(units), pace * (len(units) - done))
        failed = [failures[key] for key in units if key in failures]
        if len(failed) == len(units):
            raise DecisionError(failed[0])
        table = [
            {**{s.name: s.value for s in configuration}, **row}
            for key, configuration in units.items()
            if key not in failures
            for row in _add_verdicts(store[key])
        ]
    return SweepResult(sweep, table, tuple(failed), resumed, perf_counter() - began)


def _add_verdicts(rows: Rows) -> list[Mapping[str, Any]]:
    verdicts = judge_configuration(rows)
    return [{**row, **verdicts} for row in rows]
