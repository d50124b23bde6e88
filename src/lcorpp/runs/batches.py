"""Results of the batches of Algorithm 1: scores, a line of text and a row of a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcorpp.assembly.strategies.strategy_table import ASK_COST, NOISE, WEIGHT
from lcorpp.decision import LCORPP, Batch, Strategy, TrainedSense
from lcorpp.decision.stopping import choose_epsilon
from lcorpp.domains import Domain
from lcorpp.learning.evaluation.folds import FOLDS
from lcorpp.notebook import html_table
from lcorpp.scoring.decision_scores import score_decisions
from lcorpp.scoring.metrics import Scores, get_format, make_cells
from lcorpp.simulation.people_stream import DecisionResult
from lcorpp.values import ConfusionMatrix

Row = dict[str, Any]
"""Column -> number or text; and "matrices", the confusion matrices of each sense, which are not columns."""

LEFT_OUT = ("precision", "recall", "accuracy")
"""Scores that the line of a batch leaves out; with several variables there are others."""

SHOWN_WEIGHTS = 2
"""Number of weights in the line of a batch, the largest ones."""


@dataclass(frozen=True, eq=False)
class BatchResult:
    """A batch with its scores.

    batch: the classifiers, data sets and confusion matrices after the training.
    scores: of the batch's decisions; None without decisions, and for a batch of an earlier run.
    rows: one table row per batch so far, of earlier runs too.
    resumed: whether an earlier run completed the batch.
    decisions: the batch's decisions with the truth, in their order; () for a batch of an earlier run.
    """

    batch: Batch
    scores: Scores | None
    rows: tuple[Row, ...]
    resumed: bool
    decisions: tuple[DecisionResult, ...] = ()

    def _repr_html_(self) -> str:
        names = list(
            dict.fromkeys(name for row in self.rows for name in row if not name.endswith(("_low", "_high")))
        )
        rows = [
            [f"{x:.4g}" if isinstance(x, float) else str(x) for x in map(row.get, names)] for row in self.rows
        ]
        return html_table(names, rows, caption=self.summary())

    def summary(self) -> str:
        """Return the size of each data set, the recall of each class and the scores in one line."""
        texts = [
            self._summarise_sense(name, prefix=f"{name}: " if len(self.batch.senses) > 1 else "")
            for name in self.batch.senses
        ]
        if self.scores is not None:
            cells = {name: cell for name, cell in self.scores.columns.items() if name not in LEFT_OUT}
            formatted = [f"{name} {cell.estimate:{get_format(name)}}" for name, cell in cells.items()]
            texts.append(", ".join(formatted))
        row = self.rows[-1] if self.rows else {}
        weights = {name: row[name] for name in row if name.startswith(WEIGHT)}
        if weights:
            best = sorted(weights, key=lambda name: -weights[name])[:SHOWN_WEIGHTS]
            shown = ", ".join(f"{name.removeprefix(WEIGHT)} {weights[name]:.2f}" for name in best)
            texts.append(f"trust: {shown}; noise {row[NOISE]:.2f}; asking to learn costs {row[ASK_COST]:.2f}")
        if row.get("drift"):
            texts.append(f"drift: {row['drift']}")
        return "; ".join(texts)

    def _summarise_sense(self, name: str, prefix: str) -> str:
        sense, dataset = self.batch.senses[name], self.batch.datasets[name]
        size = f"{prefix}{dataset.n_people:g} {dataset.unit}"
        if not sense.is_trained:
            return f"{size}; random labels, as cross-validation needs {FOLDS} of each class"
        recall = _describe_recall(sense.confusion)
        if sense.against_reports is not None:
            recall += f" (against the reports: {_describe_recall(sense.against_reports)})"
        return f"{size}; recall: {recall}; change {self.batch.changes[name]:.3f}"

    def __repr__(self) -> str:
        return f"<BatchResult {self.batch.number}: {self.summary()}>"


def _describe_recall(confusion: ConfusionMatrix) -> str:
    rates = np.diag(confusion.probabilities)
    return ", ".join(f"{name} {rate:.3f}" for name, rate in zip(confusion.classes, rates, strict=True))


def explain_end(batch: Batch, epsilon: float | None) -> str:
    """Return why a run of Algorithm 1 ends after a batch, in one sentence."""
    if not all(sense.is_trained for sense in batch.senses.values()):
        return f"stopped after {batch.number} batches; not all classifiers could be trained"
    limits = {
        name: choose_epsilon(epsilon, len(sense.confusion.classes)) for name, sense in batch.senses.items()
    }
    name = max(limits, key=lambda name: batch.changes[name].high - limits[name])
    change, matrix = batch.changes[name], f"the confusion matrix{f' of {name}' if len(limits) > 1 else ''}"
    known = f"with {100 * change.confidence:g} % confidence " if change.confidence else ""
    text = f"{known}it changed by at most {change.high:.3f},"
    if batch.converged:
        return f"{matrix} has converged: {text} not above {limits[name]:g}"
    text = f"{matrix} has not converged: {text} above {limits[name]:g}"
    return f"stopped after {batch.number} batches; {text}"


def make_row(batch: Batch, scores: Scores | None) -> Row:
    """Return a batch as a row of a table; with several senses the sizes and changes of each.

    The matrix in the rules is that of which the rules of the next decisions are made.
    """
    sizes = {name: round(dataset.n_people) for name, dataset in batch.datasets.items()}
    row: Row = {"batch": batch.number}
    if len(sizes) == 1:
        row |= {"tracks": sum(sizes.values()), **make_cells({"change": batch.change})}
    else:
        row |= {f"tracks_{name}": size for name, size in sizes.items()}
        row |= make_cells({"change": batch.change})
        row |= make_cells({f"change_{name}": change for name, change in batch.changes.items()})
    if scores is not None:
        row |= {f"accuracy_{name}": accuracy.estimate for name, accuracy in scores.variables.items()}
        row |= {name: interval.estimate for name, interval in scores.metrics.items()}
    row["matrices"] = {name: _describe_matrices(sense) for name, sense in batch.senses.items()}
    return row


def _describe_matrices(sense: TrainedSense) -> dict[str, Any]:
    """Return the counts, true class by predicted class; more if the labels are corrected."""
    matrix = sense.confusion.to_json()
    described = {"classes": sense.confusion.classes, "in_rules": matrix["counts"]}
    if "effective_cases" in matrix:
        described["effective_cases"] = matrix["effective_cases"]
    if sense.against_reports is not None:
        described["against_reports"] = sense.against_reports.counts.tolist()
    return described


def score_batch(domain: Domain, results: Sequence[DecisionResult], strategy: Strategy = LCORPP) -> Scores:
    """Score the decisions of a batch, which the strategy made."""
    values = domain.values
    reports = [result.report for result in results]
    return score_decisions(
        strategy.name,
        np.array([values.index(result.actual) for result in results]),
        np.array([len(values) if report is None else values.index(report) for report in reports]),
        np.array([result.cost for result in results]),
        np.array([result.return_ for result in results]),
        values=values,
        positive=domain.positive,
        variables=domain.reasoning.shared,
    )
