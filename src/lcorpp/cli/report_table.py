"""Evaluation report of a classifier as a table on the console."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

    from lcorpp.learning import EvaluationReport
    from lcorpp.values import Interval


def table(report: EvaluationReport) -> Table:
    """Return a table of AUC, Brier score, calibration and best thresholds, with 95% intervals."""
    from rich import box
    from rich.table import Table

    made = Table(box=box.SIMPLE_HEAD)
    made.add_column("class")
    for one in report.classes:
        made.add_column(one.name, justify="right")
    rows = {
        "AUC": [_interval(one.auc) for one in report.classes],
        "Brier score": [_interval(one.raw.brier) for one in report.classes],
        "expected calibration error": [_interval(one.raw.ece) for one in report.classes],
        "  calibrated": [_interval(one.calibrated.ece) for one in report.classes],
        "  if perfectly calibrated": [f"{one.calibrated.ece_if_calibrated:.3f}" for one in report.classes],
    }
    for name, cells in rows.items():
        made.add_row(name, *cells)
    for number, threshold in enumerate(report.classes[0].thresholds):
        chosen = [one.thresholds[number] for one in report.classes]
        made.add_row(threshold.label, *(f"{t.score:.3f} at threshold {t.probability:.3f}" for t in chosen))
    common = ", ".join(f"{one.name} {one.thresholds[0].prevalence:.3g}" for one in report.classes)
    made.caption = f"thresholds are for the prevalence: {common}"
    made.caption_justify = "left"
    return made


def _interval(interval: Interval) -> str:
    return f"{interval.estimate:.3f} [dim][{interval.low:.3f}, {interval.high:.3f}][/dim]"
