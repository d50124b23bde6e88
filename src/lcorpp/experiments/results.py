"""Result folders: the tables, configuration, figures and classifier of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lcorpp.errors import DataError
from lcorpp.experiments.comparison import Comparison, ComparisonOptions
from lcorpp.experiments.setup import StoredOptions, TrainingOptions
from lcorpp.experiments.tables import COLUMNS, METRICS, to_row, write_csv, write_json
from lcorpp.files import make_folder
from lcorpp.values import LAPLACE

if TYPE_CHECKING:
    from lcorpp.domains import Domain
    from lcorpp.experiments.active_learning import BatchResult
    from lcorpp.protocols import Classifier

FORMATS = ("png", "pdf")
"""The formats in which figures are written by default."""


@dataclass(frozen=True)
class WrittenFiles:
    """The files of a result folder. problem: why the classifier is not among them, None if it is."""

    paths: tuple[Path, ...]
    problem: str | None = None


def describe_run(
    domain: Domain, options: ComparisonOptions, comparison: Comparison, classifier: str, policy: Path | None
) -> dict[str, Any]:
    """Return the configuration of a comparison, for results.json.

    Args:
        classifier: "channel", the learner or the file. policy: the file of the policy, None if it was solved.
    """
    source = options.classifier
    training = source if isinstance(source, TrainingOptions) else TrainingOptions()
    data = source.data if isinstance(source, TrainingOptions | StoredOptions) else None
    return {
        "domain": domain.name,
        "preset": domain.preset,
        "classifier": classifier,
        "evidence": "soft" if options.evidence.soft else "hard",
        "smoothing": "laplace" if options.evidence.smoothing == LAPLACE else "jeffreys",
        "features": ",".join(training.features),
        "threshold": training.threshold,
        "prevalence": training.prevalence,
        "device": training.device,
        "rates": comparison.classifier.rates,
        "data": str(data) if data else None,
        "tracks": comparison.classifier.n_tracks,
        "epochs": training.epochs,
        "policy": str(policy) if policy else "solved",
        "trials": "exact" if comparison.trials is None else comparison.trials,
        "seed": options.seed,
    }


def write_comparison(
    folder: Path,
    comparison: Comparison,
    configuration: Mapping[str, Any],
    *,
    formats: Sequence[str] = FORMATS,
) -> WrittenFiles:
    """Write results.csv, results.json, the figures and, if it was trained now, the report and the classifier.

    Args:
        folder: created if missing.
        configuration: see `describe_run`.
        formats: of the figures: "png", "svg", "pdf".

    Raises:
        FileError: a file cannot be written.
    """
    from lcorpp.experiments.figures.files import write_figure
    from lcorpp.experiments.figures.strategies import plot_strategies

    make_folder(folder)
    classifier = comparison.classifier
    saved = save_if_trained(classifier.trained, folder)
    title = f"{configuration['domain']}, {configuration['classifier']}, {configuration['trials']} trials"
    rows = [to_row(scores) for scores in comparison.scores]
    write_csv(folder / "results.csv", COLUMNS, rows)
    detailed = [
        {**row, "cost_sd": scores.cost_sd, "counts": scores.counts.tolist()}
        for row, scores in zip(rows, comparison.scores, strict=True)
    ]
    write_json(folder / "results.json", {"configuration": dict(configuration), "strategies": detailed})
    written = [folder / "results.csv", folder / "results.json"]
    written += write_figure(plot_strategies(comparison.scores, title), folder, "results", formats)
    if classifier.report is not None:
        from lcorpp.learning import plot_report, write_report

        written += write_report(classifier.report, folder)
        for suffix in formats:
            plot_report(classifier.report, folder / f"report.{suffix}")
            written.append(folder / f"report.{suffix}")
    return WrittenFiles((*written, *saved.paths), saved.problem)


def write_batches(
    folder: Path, domain_name: str, result: BatchResult, *, formats: Sequence[str] = FORMATS
) -> WrittenFiles:
    """Write batches.csv, batches.json, the latest classifier and the figure of all batches so far.

    Raises:
        FileError: a file cannot be written.
    """
    make_folder(folder)
    write_csv(folder / "batches.csv", ("batch", "tracks", "change", *METRICS), result.rows)
    write_json(folder / "batches.json", {"domain": domain_name, "batches": list(result.rows)})
    saved = save_if_trained(result.batch.classifier, folder)
    written = [folder / "batches.csv", folder / "batches.json", *saved.paths]
    scored = [row for row in result.rows if "f1" in row]
    if scored:
        from lcorpp.experiments.figures.augmentation import plot_augmentation
        from lcorpp.experiments.figures.files import write_figure

        figure = plot_augmentation(
            [int(row["batch"]) for row in scored],
            [float(row["f1"]) for row in scored],
            [float(row["change"]) for row in scored],
        )
        written += write_figure(figure, folder, "batches", formats)
    return WrittenFiles(tuple(written), saved.problem)


def save_if_trained(classifier: Classifier | None, folder: Path) -> WrittenFiles:
    """Save a trained classifier as classifier.npz; others, and kinds that cannot be stored, are left out."""
    if classifier is None:
        return WrittenFiles(())
    from lcorpp.learning import SoftClassifier, TrainedClassifier, save_classifier

    if isinstance(classifier, SoftClassifier):
        classifier = classifier.trained
    if not isinstance(classifier, TrainedClassifier):
        return WrittenFiles(())
    try:
        save_classifier(classifier, folder / "classifier.npz")
    except DataError as error:
        return WrittenFiles((), str(error))
    return WrittenFiles((folder / "classifier.npz",))
