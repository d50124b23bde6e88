"""The result folder of a comparison: its table, configuration, figures and classifiers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lcorpp.assembly.options import ClassifierOptions, TrainingOptions
from lcorpp.assembly.senses import SenseSetup
from lcorpp.domains import Domain
from lcorpp.domains.own_world import OwnWorlds
from lcorpp.domains.sections.learning import Sense
from lcorpp.experiments.comparison import Comparison, ComparisonOptions
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
from lcorpp.scoring.metrics import Scores, find_reference, make_cells
from lcorpp.values import LAPLACE


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
            name: _describe_sense(domain.find_sense(name), options.classifiers.get(name), setup)
            for name, setup in comparison.senses.items()
        },
        "evidence": ", ".join(dict.fromkeys(map(str, options.evidence.kinds.values()))) or "hard",
        "smoothing": "laplace" if options.evidence.smoothing == LAPLACE else "jeffreys",
        "policy": str(policy) if policy else "solved",
        "solution": describe_solution(comparison.solution),
        "gap_at_priors": comparison.gap,
        "trials": "exact" if comparison.trials is None else comparison.trials,
        "seed": options.seed,
        "people": None if options.people is None else str(options.people.folder),
        "world": repr(world) if isinstance(world := domain.simulation.world, OwnWorlds) else None,
    }


def _describe_sense(sense: Sense, options: ClassifierOptions, setup: SenseSetup) -> dict[str, Any]:
    from lcorpp.learning.classifiers.learner_table import default_features

    training = (options if isinstance(options, TrainingOptions) else TrainingOptions()).complete(sense)
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
        "balance": training.balance,
    }


def write_comparison(
    folder: Path,
    comparison: Comparison,
    configuration: Mapping[str, Any],
    *,
    formats: Sequence[str] | None = None,
) -> WrittenFiles:
    """Write results.csv, results.json, the figures and, if trained now, the reports and the classifiers.

    With several senses, the files of each are in a folder of its name.

    Args:
        folder: created if missing. comparison: of `compare_strategies`.
        configuration: of `describe_run`, for results.json.
        formats: of the figures: "png", "svg", "pdf"; by default png and pdf, or none without matplotlib.

    Raises:
        FileError: a file cannot be written, or formats are given without matplotlib.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.experiments import ComparisonOptions, compare_strategies, write_comparison
        >>> from lcorpp.experiments.results import describe_run
        >>> options = ComparisonOptions(strategies(["R+P", "LCORPP"]), trials=None)  # exact scores
        >>> comparison = compare_strategies(load_domain("intention"), options)
        >>> configuration = describe_run(load_domain("intention"), options, comparison, policy=None)
        >>> _ = write_comparison(Path("comparison"), comparison, configuration, formats=[])  # no figures
        >>> sorted(file.name for file in Path("comparison").iterdir())
        ['results.csv', 'results.json']
    """
    formats = choose_formats(formats, FORMATS)
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
    content = {"configuration": dict(configuration), "strategies": detailed}
    if comparison.failures:
        content["failures"] = dict(comparison.failures)
    write_json(folder / "results.json", content)
    written = [folder / "results.csv", folder / "results.json"]
    if formats:
        from lcorpp.experiments.figures.strategies import plot_strategies  # imports matplotlib
        from lcorpp.plot_style import save_figures

        written += save_figures(plot_strategies(comparison.scores, title), folder / "results", formats)
    return join_files(
        written,
        [_write_sense(own, setup, formats) for own, setup in make_folders(folder, comparison.senses)],
    )


def _write_sense(folder: Path, setup: SenseSetup, formats: Sequence[str]) -> WrittenFiles:
    """Write the evaluation of a classifier that was trained now, and the classifier if it was trained."""
    written = list[Path]()
    if setup.report is not None:
        from lcorpp.learning import write_report

        written += write_report(setup.report, folder)
        for figure in [folder / f"report.{suffix}" for suffix in formats]:
            from lcorpp.learning import plot_report  # imports matplotlib

            plot_report(setup.report, figure)
            written.append(figure)
    saved = save_if_trained(setup.trained, folder)
    return WrittenFiles((*written, *saved.paths), saved.problem)


def _describe_difference(reference: Scores, scores: Scores) -> dict[str, Any] | None:
    """Return how much higher the reference's scores are, with paired intervals; None for itself."""
    if scores is reference:
        return None
    return {"reference": reference.strategy, **make_cells(reference.subtract(scores))}
