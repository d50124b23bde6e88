"""Write an evaluation report as JSON, CSV and Markdown."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lcorpp.arguments import check_arguments
from lcorpp.csv_text import format_csv
from lcorpp.files import make_folder, write_atomically
from lcorpp.learning.evaluation.report import EvaluationReport, ProbabilityQuality
from lcorpp.learning.evaluation.validation import Rate
from lcorpp.values import Interval

COLUMNS = ("class", "quantity", "value", "low", "high")


@check_arguments
def write_report(report: EvaluationReport, folder: str | Path) -> tuple[Path, ...]:
    """Write report.json, report.csv and report.md; `plot_report` draws the figure.

    Args:
        folder: created if missing.

    Returns:
        The paths.

    Raises:
        FileError: a file cannot be written.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, build_report, cross_validate, write_report
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> files = write_report(build_report(cross_validate(QuadraticLogistic(), data)), "report")
        >>> [file.name for file in files]
        ['report.json', 'report.csv', 'report.md']
    """
    directory = make_folder(folder)
    texts = {
        "report.json": json.dumps(as_json(report), indent=2) + "\n",
        "report.csv": format_csv(_list_rows(report)),
        "report.md": as_markdown(report),
    }
    for name, text in texts.items():
        write_atomically(directory / name, text)
    return tuple(directory / name for name in texts)


def as_json(report: EvaluationReport) -> dict[str, Any]:
    """Return the whole report, including curves and thresholds, as plain values."""
    return {
        "learner": report.learner,
        "source": report.source,
        "cases": report.cases,
        "people": report.people,
        "folds": report.folds,
        "accuracy": _interval_as_json(report.accuracy),
        "confusion": [[_rate_as_json(rate) for rate in row] for row in report.rates],
        "classes": {
            one.name: {
                "cases": one.cases,
                "auc": _interval_as_json(one.auc),
                "roc": dict(
                    zip(("false_positive_rate", "true_positive_rate"), one.roc.tolist(), strict=True)
                ),
                "raw": _quality_as_json(one.raw),
                "calibrated": _quality_as_json(one.calibrated),
                "thresholds": [asdict(choice) for choice in one.thresholds],
            }
            for one in report.classes
        },
        "calibration": report.calibration.to_json(),
        "prediction_sets": {
            "coverage": report.sets.coverage,
            "covered": dict(
                zip(report.sets.classes, map(_interval_as_json, report.sets.coverages), strict=True)
            ),
            **{name: getattr(report.sets, name) for name in ("mean_size", "full", "empty")},
        },
    }


def as_markdown(report: EvaluationReport) -> str:
    """Return the report as Markdown tables."""
    lines = [
        f"# {report.learner or 'Classifier'}",
        "",
        f"{report.cases} cases of {report.people} people, {report.folds} folds; 95 % intervals.",
        report.source,
        "",
        *_format_table(
            ("true class", *(f"predicted {rate.predicted}" for rate in report.rates[0]), "cases"),
            _format_confusion(report),
        ),
        "",
        *_format_table(("class", "quantity", "value", "95 % interval"), _format_quantities(report)),
    ]
    return "\n".join(lines) + "\n"


def _format_confusion(report: EvaluationReport) -> Iterator[Sequence[str]]:
    for row in report.rates:
        cells = (
            f"{rate.count} ({rate.value:.3f}, {rate.interval.low:.3f} to {rate.interval.high:.3f})"
            for rate in row
        )
        yield row[0].true, *cells, str(row[0].cases)


def _format_quantities(report: EvaluationReport) -> Iterator[Sequence[str]]:
    for row in report.rows():
        if not row.predicted:
            interval = f"{row.interval.low:.3f} to {row.interval.high:.3f}" if row.has_interval else ""
            yield row.class_name, row.quantity, f"{row.interval.estimate:.3f}", interval


def _format_table(header: Sequence[str], body: Iterable[Sequence[str]]) -> Iterator[str]:
    for cells in (header, ["---"] * len(header), *body):
        yield f"| {' | '.join(cells)} |"


def _list_rows(report: EvaluationReport) -> Iterator[Sequence[object]]:
    yield COLUMNS
    for row in report.rows():
        ends = (row.interval.low, row.interval.high) if row.has_interval else ("", "")
        yield row.class_name, row.quantity, row.interval.estimate, *ends


def _rate_as_json(rate: Rate) -> dict[str, Any]:
    names = ("true", "predicted", "count", "cases")
    return {**{name: getattr(rate, name) for name in names}, **_interval_as_json(rate.interval)}


def _quality_as_json(quality: ProbabilityQuality) -> dict[str, Any]:
    return {
        "brier": _interval_as_json(quality.brier),
        "expected_calibration_error": _interval_as_json(quality.ece),
        "expected_calibration_error_if_calibrated": quality.ece_if_calibrated,
        "reliability": [
            {"predicted": part.predicted, "observed": _interval_as_json(part.observed), "cases": part.cases}
            for part in quality.reliability
        ],
    }


def _interval_as_json(interval: Interval) -> dict[str, float]:
    return {"value": interval.estimate, "low": interval.low, "high": interval.high}
