"""`lcorpp run`: the paper's comparison of strategies on any domain."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.cli import console as show
from lcorpp.errors import DataError, DomainError, FileError

if TYPE_CHECKING:
    from rich.table import Table

    from lcorpp.domains import Domain
    from lcorpp.experiments.metrics import Scores
    from lcorpp.values import Interval


def run(
    domain: show.DomainArgument = "intention",
    preset: show.PresetOption = None,
    strategy: Annotated[
        list[str] | None, typer.Option("--strategy", help="L, R, P, L+R, R+P or LCORPP; again for more.")
    ] = None,
    trials: Annotated[int, typer.Option("--trials", min=1, help="How many people the robot meets.")] = 5000,
    seed: show.SeedOption = 0,
    classifier: Annotated[
        str | None,
        typer.Option(
            "--classifier",
            help="In place of training: channel (the domain's rates) or a file saved by an earlier run.",
        ),
    ] = None,
    learner: show.LearnerOption = None,
    evidence: show.EvidenceOption = show.Evidence.hard,
    data: show.DataOption = None,
    tracks: show.TracksOption = None,
    epochs: show.EpochsOption = None,
    device: show.DeviceOption = "cpu",
    channels: show.ChannelsOption = "x,y",
    smoothing: show.SmoothingOption = show.Smoothing.jeffreys,
    threshold: Annotated[
        str | None,
        typer.Option(
            "--threshold",
            help="From which probability on the positive class is called: a number, or best for accuracy, f1,"
            " youden or costs as MISSED:ALARM; by default the most probable class is.",
        ),
    ] = None,
    prevalence: Annotated[
        float | None,
        typer.Option(
            "--prevalence",
            min=1e-6,
            max=1 - 1e-6,
            help="How common the positive class is, for thresholds; by default as the knowledge says.",
        ),
    ] = None,
    policy: Annotated[
        Path | None, typer.Option("--policy", help="A policy of the domain's model, instead of solving it.")
    ] = None,
    exact: Annotated[
        bool,
        typer.Option("--exact", help="Enumerate people and answers instead of drawing them (channel only)."),
    ] = False,
    out: show.OutOption = None,
    jobs: show.JobsOption = None,
) -> None:
    """Train or load the classifier, solve the model, simulate the strategies and compare them.

    Ctrl-C during the trials keeps those that are done.
    """
    from lcorpp.cli import eyes as looking, preparation
    from lcorpp.decision import strategies
    from lcorpp.domains import load_domain
    from lcorpp.experiments.exact_evaluation import evaluate_exactly
    from lcorpp.experiments.trials import Experiment, run_trials
    from lcorpp.simulation.channel import NoisyChannel
    from lcorpp.values import JEFFREYS, LAPLACE

    rows = strategies(strategy or [])
    loaded = load_domain(domain, preset=preset)
    chosen = _chosen(loaded, classifier, learner, data)
    soft = evidence is show.Evidence.soft
    trust = looking.Trust(soft, LAPLACE if smoothing is show.Smoothing.laplace else JEFFREYS)
    if out is not None and out.exists() and not out.is_dir():
        raise FileError(f"{out}: is a file; --out expects a folder")
    if exact and chosen != "channel":
        raise DomainError(
            "--exact needs --classifier channel: how a trained one errs is only known from trials"
        )
    if soft and chosen == "channel":
        raise DomainError("--evidence soft needs a trained classifier: a channel says labels only")
    if soft and threshold is not None:
        raise DomainError("--threshold calls people by a label; --evidence soft uses none")
    if smoothing is show.Smoothing.laplace and (soft or chosen == "channel"):
        raise DomainError(
            "--smoothing is of the confusion matrix of a trained classifier whose labels are used"
        )
    preparation.introduce(loaded)
    training = {
        "tracks": tracks,
        "epochs": epochs,
        "threshold": threshold,
        "prevalence": prevalence,
        "device": device if device != "cpu" else None,
        "channels": channels if channels != "x,y" else None,
    }
    if chosen == "channel":
        _refuse("nothing is trained, as the classifier is a channel", data=data, **training)
    elif not any(row.learns for row in rows):
        _refuse("nothing is trained, as no strategy learns", learner=learner, **training)
    if chosen == "channel" or not any(row.learns for row in rows):
        eyes = looking.channel_eyes(loaded)
    elif chosen == "file":
        _refuse("nothing is trained, as --classifier gives a file", **training)
        eyes = looking.stored_eyes(loaded, Path(classifier or ""), trust, data=data, seed=seed)
    else:
        seen = tuple(name.strip() for name in channels.split(","))
        wanted = looking.Wanted(chosen, epochs, device, threshold, prevalence, features=seen)
        eyes = looking.trained_eyes(
            loaded, wanted, trust, data=data, tracks=tracks, seed=seed, jobs=show.cores(jobs)
        )
    robot = preparation.robot(loaded, eyes, policy)
    configuration: dict[str, Any] = {
        "domain": loaded.name,
        "preset": loaded.preset,
        "classifier": classifier if chosen == "file" else chosen,
        "evidence": evidence.value,
        "smoothing": smoothing.value,
        "channels": channels,
        "threshold": threshold,
        "prevalence": prevalence,
        "device": device,
        "rates": eyes.rates,
        "data": str(data) if data else None,
        "tracks": eyes.tracks,
        "epochs": epochs,
        "policy": str(policy) if policy else "solved",
        "trials": "exact" if exact else trials,
        "seed": seed,
    }
    if exact:
        assert isinstance(eyes.reader, NoisyChannel)
        results = evaluate_exactly(loaded, robot, eyes.reader, rows)
    else:
        experiment = Experiment(loaded, robot, eyes.reader, eyes.appearance, rows, seed)
        with show.progress("deciding", trials) as advance:
            results, done = run_trials(experiment, trials, jobs=show.cores(jobs), progress=advance)
        if done < trials:
            configuration["trials"] = done
    show.console.print(_table(results, loaded.learning.positive, configuration["trials"]))
    for note in eyes.notes:
        show.console.print(f"note: {note}", style="yellow", markup=False)
    if out is not None:
        _write(out, results, configuration, eyes)
    if configuration["trials"] not in ("exact", trials):
        show.messages.print(f"interrupted: {configuration['trials']} of {trials} decisions are kept")


def _chosen(domain: Domain, classifier: str | None, learner: str | None, data: Path | None) -> str:
    """Who classifies: "channel", "file", or the name of a learner."""
    from lcorpp.domains.sections.learning import CLASSIFIERS

    if classifier is not None:
        if learner is not None:
            raise DomainError(
                f"--classifier {classifier} and --learner {learner} both say who classifies; expected one"
            )
        return classifier if classifier in CLASSIFIERS else "file"
    if learner is not None:
        return learner
    return (
        "lstm" if data is not None and domain.learning.classifier == "channel" else domain.learning.classifier
    )


def _refuse(why: str, **options: object) -> None:
    """Complain about options that would do nothing."""
    for name, value in options.items():
        if value is not None:
            raise DomainError(f"--{name}: {why}")


def _table(results: list[Scores], positive: str | None, trials: int | str) -> Table:
    from rich import box
    from rich.table import Table

    about = f"F1, precision and recall of {positive!r}" if positive else "averaged over all values"
    count = "exact values" if trials == "exact" else f"{trials} decisions, ± half of the 95% intervals"
    table = Table(title=f"{count}; {about}", title_style="", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("strategy", style="bold")
    for name in ("F1", "precision", "recall", "accuracy", "cost", "return"):
        table.add_column(name, justify="right")
    for result in results:
        table.add_row(
            result.strategy,
            *(_cell(e, 3) for e in (result.f1, result.precision, result.recall, result.accuracy)),
            *(_cell(e, 2) for e in (result.cost, result.return_)),
        )
    return table


def _cell(interval: Interval, digits: int) -> str:
    half = (interval.high - interval.low) / 2
    return f"{interval.estimate:.{digits}f}" + (f"\n[dim]±{half:.{digits}f}[/dim]" if half else "")


def _write(out: Path, results: list[Scores], configuration: dict[str, Any], eyes: Any) -> None:
    from lcorpp.experiments.figures.files import write_figure
    from lcorpp.experiments.figures.strategies import plot_strategies
    from lcorpp.experiments.results import write_comparison
    from lcorpp.learning import SoftClassifier, TrainedClassifier, plot_report, save_classifier, write_report

    written = list(write_comparison(out, results, configuration))
    title = f"{configuration['domain']}, {configuration['classifier']}, {configuration['trials']} decisions"
    written += write_figure(plot_strategies(results, title), out, "results", ("png",))
    if eyes.report is not None:
        written += write_report(eyes.report, out)
        plot_report(eyes.report, out / "report.png")
        written.append(out / "report.png")
    reader = eyes.reader.trained if isinstance(eyes.reader, SoftClassifier) else eyes.reader
    if isinstance(reader, TrainedClassifier):
        try:
            save_classifier(reader, out / "classifier.npz")
            written.append(out / "classifier.npz")
        except DataError as error:
            show.console.print(f"note: the classifier is not saved: {error}", style="yellow", markup=False)
    show.console.print("wrote " + ", ".join(str(path) for path in written), markup=False)
