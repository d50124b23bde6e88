"""A report on a classifier as JSON, CSV and Markdown."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lcorpp.files import make_folder, write_atomically
from lcorpp.learning.evaluation.intervals import Interval
from lcorpp.learning.evaluation.report import Probabilities, Report

COLUMNS = ("class", "figure", "value", "low", "high")
Row = tuple[str, str, float, float | None, float | None]


def write_report(report: Report, folder: str | Path) -> tuple[Path, ...]:
    """Write report.json, report.csv and report.md; see `report_figure.plot_report` for the figure.

    Args:
        folder: made if missing.

    Returns:
        The paths.

    Raises:
        FileError: they cannot be written.
    """
    home = make_folder(folder)
    texts = {
        "report.json": json.dumps(as_json(report), indent=2) + "\n",
        "report.csv": _csv(report),
        "report.md": as_markdown(report),
    }
    for name, text in texts.items():
        write_atomically(home / name, text)
    return tuple(home / name for name in texts)


def rows(report: Report) -> Iterator[Row]:
    """Every figure of a report: class, figure, value, low, high; None where there is no interval."""
    yield "", "accuracy", *_ends(report.accuracy)
    for given in report.rates:
        for rate in given:
            yield rate.given, f"called {rate.called}", rate.value, rate.low, rate.high
    for one in report.classes:
        yield one.name, "AUC", *_ends(one.auc)
        for name, found in (("", one.said), (", calibrated", one.calibrated)):
            yield one.name, f"Brier score{name}", *_ends(found.brier)
            yield one.name, f"calibration error{name}", *_ends(found.error)
            yield one.name, f"calibration error by chance{name}", found.by_chance, None, None
        for threshold in one.thresholds:
            words, honest = threshold.told
            best = f"{words} at prevalence {threshold.prevalence:.3g}"
            yield one.name, f"threshold for {best}", threshold.probability, None, None
            yield one.name, best, honest, None, None


def as_json(report: Report) -> dict[str, Any]:
    """The whole report, curves and thresholds included, in plain values."""
    return {
        "learner": report.learner,
        "source": report.source,
        "cases": report.cases,
        "people": report.people,
        "folds": report.folds,
        "accuracy": asdict(report.accuracy),
        "confusion": [[asdict(rate) for rate in row] for row in report.rates],
        "classes": {
            one.name: {
                "cases": one.cases,
                "auc": asdict(one.auc),
                "roc": {"alarms": one.roc[0].tolist(), "hits": one.roc[1].tolist()},
                "said": _probabilities(one.said),
                "calibrated": _probabilities(one.calibrated),
                "thresholds": [asdict(threshold) for threshold in one.thresholds],
            }
            for one in report.classes
        },
        "calibration": report.calibration.to_json(),
    }


def as_markdown(report: Report) -> str:
    """The report as tables."""
    lines = [
        f"# {report.learner or 'Classifier'}",
        "",
        f"{report.cases} cases of {report.people} people, {report.folds} folds; 95 % intervals.",
        report.source,
        "",
        *_table(("is", *(f"called {rate.called}" for rate in report.rates[0]), "cases"), _matrix(report)),
        "",
        *_table(("class", "figure", "value", "95 % interval"), _figures(report)),
    ]
    return "\n".join(lines) + "\n"


def _matrix(report: Report) -> Iterator[Sequence[str]]:
    for row in report.rates:
        cells = (f"{rate.count} ({rate.value:.3f}, {rate.low:.3f} to {rate.high:.3f})" for rate in row)
        yield row[0].given, *cells, str(row[0].cases)


def _figures(report: Report) -> Iterator[Sequence[str]]:
    for name, figure, value, low, high in rows(report):
        if not figure.startswith("called "):
            yield name, figure, f"{value:.3f}", "" if low is None else f"{low:.3f} to {high:.3f}"


def _table(head: Sequence[str], body: Iterator[Sequence[str]]) -> Iterator[str]:
    for cells in (head, ["---"] * len(head), *body):
        yield f"| {' | '.join(cells)} |"


def _csv(report: Report) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows(report))
    return text.getvalue()


def _probabilities(found: Probabilities) -> dict[str, Any]:
    return {
        "brier": asdict(found.brier),
        "calibration_error": asdict(found.error),
        "calibration_error_by_chance": found.by_chance,
        "reliability": [asdict(part) for part in found.reliability],
    }


def _ends(interval: Interval) -> tuple[float, float, float]:
    return interval.value, interval.low, interval.high
