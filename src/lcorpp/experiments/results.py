"""Result folders: the tables, configuration, figures and classifier of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from lcorpp.assembly.options import ClassifierOptions, TrainingOptions
from lcorpp.assembly.senses import SenseSetup
from lcorpp.domains.own_world import OwnWorlds
from lcorpp.errors import DataError
from lcorpp.experiments.comparison import Comparison, ComparisonOptions
from lcorpp.experiments.tables import write_csv, write_json
from lcorpp.files import make_folder
from lcorpp.planning import Solution
from lcorpp.planning.solution import describe_start
from lcorpp.scoring.metrics import METRICS, Scores, find_reference, make_cells
from lcorpp.values import LAPLACE, Interval

if TYPE_CHECKING:
    from lcorpp.domains import Domain
    from lcorpp.protocols import Classifier
    from lcorpp.runs.batches import BatchResult, Row

T = TypeVar("T")

FORMATS = ("png", "pdf")
"""The formats in which figures are written by default."""


@dataclass(frozen=True)
class WrittenFiles:
    """The files of a result folder. problem: why the classifier is not among them, None if it is."""

    paths: tuple[Path, ...]
    problem: str | None = None


def describe_run(
    domain: Domain, options: ComparisonOptions, comparison: Comparison, policy: Path | None
) -> dict[str, Any]:
    """Return the configuration of a comparison, for results.json.

    Args:
        policy: the file of the policy, None if it was solved.
    """
    return {
        "domain": domain.name,
        "preset": domain.preset,
        "shared": domain.reasoning.shared,
        "values": domain.values,
        "senses": {
            name: _describe_sense(options.classifiers.get(name), setup)
            for name, setup in comparison.senses.items()
        },
        "evidence": ", ".join(dict.fromkeys(map(str, options.evidence.kinds.values()))) or "hard",
        "smoothing": "laplace" if options.evidence.smoothing == LAPLACE else "jeffreys",
        "policy": str(policy) if policy else "solved",
        "solution": describe_solution(comparison.solution),
        "gap_at_priors": comparison.gap,
        "trials": "exact" if comparison.trials is None else comparison.trials,
        "seed": options.seed,
        "world": repr(world) if isinstance(world := domain.simulation.world, OwnWorlds) else None,
    }


def describe_solution(solution: Solution | None) -> dict[str, Any] | None:
    """Return the bounds of a solution and how its search ended; None if a policy was given."""
    if solution is None:
        return None
    return {
        "solver": solution.solver,
        "lower": solution.lower,
        "upper": solution.upper,
        "gap": solution.upper - solution.lower,
        "bounds_at": describe_start(solution.start_count),
        "converged": solution.converged,
        "reason": solution.reason,
        "seconds": solution.seconds,
        "cached": solution.cached,
    }


def _describe_sense(options: ClassifierOptions, setup: SenseSetup) -> dict[str, Any]:
    from lcorpp.learning.classifiers.table import default_features

    training = options if isinstance(options, TrainingOptions) else TrainingOptions()
    return {
        "classifier": setup.source,
        "features": ",".join(training.features or default_features(setup.source)),
        "rate": training.rate,
        "seconds": options.seconds if options else None,
        "threshold": training.threshold,
        "prevalence": training.prevalence,
        "device": training.device,
        "evidence": str(setup.evidence),
        "rates": setup.rates,
        "data": str(setup.data) if setup.data else None,
        "tracks": setup.n_tracks,
        "epochs": training.epochs,
    }


def write_comparison(
    folder: Path,
    comparison: Comparison,
    configuration: Mapping[str, Any],
    *,
    formats: Sequence[str] = FORMATS,
) -> WrittenFiles:
    """Write results.csv, results.json, the figures and, if trained now, the reports and the classifiers.

    With several senses, the files of each are in a folder of its name.

    Args:
        folder: created if missing.
        configuration: see `describe_run`.
        formats: of the figures: "png", "svg", "pdf".

    Raises:
        FileError: a file cannot be written.
    """
    from lcorpp.experiments.figures.strategies import plot_strategies  # imports matplotlib
    from lcorpp.plot_style import save_figures

    make_folder(folder)
    sources = [sense["classifier"] for sense in configuration["senses"].values()]
    title = ", ".join([configuration["domain"], *sources, f"{configuration['trials']} trials"])
    rows: list[dict[str, Any]] = [
        {"strategy": scores.strategy, **scores.cells} for scores in comparison.scores
    ]
    write_csv(folder / "results.csv", list(rows[0]), rows)
    reference = find_reference(comparison.scores)
    detailed = [
        {
            **row,
            "cost_sd": scores.cost_sd,
            "difference": _describe_difference(reference, scores),
            "counts": scores.counts.tolist(),
        }
        for row, scores in zip(rows, comparison.scores, strict=True)
    ]
    write_json(folder / "results.json", {"configuration": dict(configuration), "strategies": detailed})
    written = [folder / "results.csv", folder / "results.json"]
    written += save_figures(plot_strategies(comparison.scores, title), folder / "results", formats)
    return _join(
        written,
        [_write_sense(own, setup, formats) for own, setup in _make_folders(folder, comparison.senses)],
    )


def _make_folders(folder: Path, senses: Mapping[str, T]) -> Iterator[tuple[Path, T]]:
    """Yield the folder for the files of each sense, which is created if it is missing, and the sense."""
    for name, sense in senses.items():
        yield make_folder(folder if len(senses) == 1 else folder / name), sense


def _join(paths: Sequence[Path], parts: Sequence[WrittenFiles]) -> WrittenFiles:
    """Return some files and those of each sense as one."""
    problems = [part.problem for part in parts if part.problem]
    complete = (*paths, *[path for part in parts for path in part.paths])
    return WrittenFiles(complete, "; ".join(problems) or None)


def _write_sense(folder: Path, setup: SenseSetup, formats: Sequence[str]) -> WrittenFiles:
    """Write the evaluation of a classifier that was trained now, and the classifier if it was trained."""
    written = list[Path]()
    if setup.report is not None:
        from lcorpp.learning import plot_report, write_report

        written += write_report(setup.report, folder)
        for figure in [folder / f"report.{suffix}" for suffix in formats]:
            plot_report(setup.report, figure)
            written.append(figure)
    saved = _save_if_trained(setup.trained, folder)
    return WrittenFiles((*written, *saved.paths), saved.problem)


def write_batches(
    folder: Path,
    domain_name: str,
    result: BatchResult,
    *,
    solution: Solution | None = None,
    formats: Sequence[str] = FORMATS,
) -> WrittenFiles:
    """Write batches.csv, batches.json, the latest classifiers and the figure of all batches so far.

    The JSON file contains the confusion matrices, too. With several senses, the classifier of each is in a
    folder of its name.

    Args:
        solution: of the POMDP, for batches.json.

    Raises:
        FileError: a file cannot be written.
    """
    make_folder(folder)
    flat = [{name: cell for name, cell in row.items() if name != "matrices"} for row in result.rows]
    columns = dict.fromkeys(name for row in flat for name in row if name not in METRICS)
    write_csv(folder / "batches.csv", (*columns, *METRICS), flat)
    head = {"domain": domain_name, "solution": describe_solution(solution)}
    write_json(folder / "batches.json", {**head, "batches": list(result.rows)})
    written = [folder / "batches.csv", folder / "batches.json"]
    saved = [
        _save_if_trained(sense.classifier, own) for own, sense in _make_folders(folder, result.batch.senses)
    ]
    scored = [row for row in result.rows if "f1" in row]
    if scored:
        from lcorpp.experiments.figures.batches import plot_batches
        from lcorpp.plot_style import save_figures

        batches = [int(row["batch"]) for row in scored]
        f1 = [float(row["f1"]) for row in scored]
        changes = [_read_change(row) for row in scored]
        figure = plot_batches(batches, f1, changes)
        written += save_figures(figure, folder / "batches", formats)
    return _join(written, saved)


def _read_change(row: Row) -> Interval:
    """Return the change of a batch with its interval; rows of older stores have none."""
    change, low, high = (
        float(row[name if name in row else "change"]) for name in ("change", "change_low", "change_high")
    )
    return Interval(change, low, high)


def _save_if_trained(classifier: Classifier | None, folder: Path) -> WrittenFiles:
    """Save a trained classifier as classifier.npz; others, and kinds that cannot be stored, are left out."""
    if classifier is None:  # a noisy channel does without scikit-learn, which takes seconds to load
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


def _describe_difference(reference: Scores, scores: Scores) -> dict[str, Any] | None:
    """Return how much higher the reference's scores are, with paired intervals; None for itself."""
    if scores is reference:
        return None
    return {"reference": reference.strategy, **make_cells(reference.subtract(scores))}
