"""A report on a classifier as a table on the console."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

    from lcorpp.learning import EvaluationReport
    from lcorpp.learning.evaluation.intervals import Interval


def table(report: EvaluationReport) -> Table:
    """A column for each class: AUC, Brier score, calibration and the best thresholds, with 95% intervals."""
    from rich import box
    from rich.table import Table

    made = Table(box=box.SIMPLE_HEAD)
    made.add_column("of the class")
    for one in report.classes:
        made.add_column(one.name, justify="right")
    rows = {
        "AUC": [_interval(one.auc) for one in report.classes],
        "Brier score": [_interval(one.said.brier) for one in report.classes],
        "calibration error": [_interval(one.said.error) for one in report.classes],
        "  calibrated": [_interval(one.calibrated.error) for one in report.classes],
        "  of right probabilities, by chance": [f"{one.calibrated.by_chance:.3f}" for one in report.classes],
    }
    for name, cells in rows.items():
        made.add_row(name, *cells)
    for number, threshold in enumerate(report.classes[0].thresholds):
        chosen = [one.thresholds[number] for one in report.classes]
        made.add_row(
            threshold.told[0], *(f"{t.told[1]:.3f} calling from {t.probability:.3f} on" for t in chosen)
        )
    common = ", ".join(f"{one.name} {one.thresholds[0].prevalence:.3g}" for one in report.classes)
    made.caption = f"best where the share is: {common}"
    made.caption_justify = "left"
    return made


def _interval(interval: Interval) -> str:
    return f"{interval.value:.3f} [dim][{interval.low:.3f}, {interval.high:.3f}][/dim]"
