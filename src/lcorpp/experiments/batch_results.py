"""The result folder of Algorithm 1: the table and figure of its batches, and the latest classifiers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lcorpp.experiments.result_folder import (
    FORMATS,
    WrittenFiles,
    describe_solution,
    join_files,
    make_folders,
    save_if_trained,
)
from lcorpp.experiments.tables import write_csv, write_json
from lcorpp.files import choose_formats, make_folder
from lcorpp.planning import Solution
from lcorpp.runs.batches import BatchResult, Row
from lcorpp.scoring.metrics import METRICS
from lcorpp.values import Interval


def write_batches(
    folder: Path,
    domain_name: str,
    result: BatchResult,
    *,
    solution: Solution | None = None,
    formats: Sequence[str] | None = None,
) -> WrittenFiles:
    """Write batches.csv, batches.json, the latest classifiers and the figure of all batches so far.

    The JSON file contains the confusion matrices, too. With several senses, the classifier of each is in a
    folder of its name.

    Args:
        folder: created if missing. domain_name: for batches.json.
        result: of `run_active_learning`; without decisions there is no figure.
        solution: of the POMDP, for batches.json.
        formats: of the figure: "png", "svg", "pdf"; by default png and pdf, or none without matplotlib.

    Raises:
        FileError: a file cannot be written, or formats are given without matplotlib.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_robot
        >>> from lcorpp.assembly import TrainingOptions
        >>> from lcorpp.experiments import write_batches
        >>> from lcorpp.runs import ActiveLearningOptions, run_active_learning, set_up_learning
        >>> full = load_robot("intention", cache=False)
        >>> options = ActiveLearningOptions({"motion": TrainingOptions("summaries", tracks=20)})
        >>> senses = set_up_learning(full.domain, options)
        >>> first = next(run_active_learning(full.domain, senses, full.robot.planner, options))
        >>> _ = write_batches(Path("batches"), "intention", first)  # a figure comes with the decisions
        >>> sorted(file.name for file in Path("batches").iterdir())
        ['batches.csv', 'batches.json', 'classifier.npz']
    """
    formats = choose_formats(formats, FORMATS)
    make_folder(folder)
    flat = [{name: cell for name, cell in row.items() if name != "matrices"} for row in result.rows]
    columns = dict.fromkeys(name for row in flat for name in row if name not in METRICS)
    write_csv(folder / "batches.csv", (*columns, *METRICS), flat)
    head = {"domain": domain_name, "solution": describe_solution(solution)}
    write_json(folder / "batches.json", {**head, "batches": list(result.rows)})
    written = [folder / "batches.csv", folder / "batches.json"]
    saved = [
        save_if_trained(sense.classifier, own) for own, sense in make_folders(folder, result.batch.senses)
    ]
    scored = [row for row in result.rows if "f1" in row]
    if scored and formats:
        from lcorpp.experiments.figures.batches import plot_batches
        from lcorpp.plot_style import save_figures

        batches = [int(row["batch"]) for row in scored]
        f1 = [float(row["f1"]) for row in scored]
        changes = [_read_change(row) for row in scored]
        figure = plot_batches(batches, f1, changes)
        written += save_figures(figure, folder / "batches", formats)
    return join_files(written, saved)


def _read_change(row: Row) -> Interval:
    """Return the change of a batch with its interval; rows of older stores have none."""
    change, low, high = (
        float(row[name if name in row else "change"]) for name in ("change", "change_low", "change_high")
    )
    return Interval(change, low, high)
