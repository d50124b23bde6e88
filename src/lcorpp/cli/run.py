"""`lcorpp run`: the paper's comparison of strategies on any domain."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.cli import show
from lcorpp.errors import DomainError, FileError

if TYPE_CHECKING:
    from rich.table import Table

    from lcorpp.experiments.metrics import Estimate, Scores


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
            help="lstm (train one), channel (the domain's rates) or a file saved by an earlier run.",
        ),
    ] = None,
    data: show.DataOption = None,
    tracks: show.TracksOption = None,
    epochs: show.EpochsOption = None,
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
    from lcorpp.cli import preparation
    from lcorpp.decision import strategies
    from lcorpp.domains import load_domain
    from lcorpp.experiments.exact import exact as exact_scores
    from lcorpp.experiments.people import Channel
    from lcorpp.experiments.trials import Experiment, run_trials

    rows = strategies(strategy or [])
    loaded = load_domain(domain, preset=preset)
    chosen = classifier or ("lstm" if data else loaded.classifier)
    if out is not None and out.exists() and not out.is_dir():
        raise FileError(f"{out}: is a file; --out expects a folder")
    if exact and chosen != "channel":
        raise DomainError(
            "--exact needs --classifier channel: how a trained one errs is only known from trials"
        )
    preparation.introduce(loaded)
    if chosen == "channel" or not any(row.learns for row in rows):
        eyes = preparation.channel_eyes(loaded)
    else:
        file = None if chosen == "lstm" else Path(chosen)
        eyes = preparation.trained_eyes(
            loaded, file=file, data=data, tracks=tracks, epochs=epochs, seed=seed, jobs=show.cores(jobs)
        )
    robot = preparation.robot(loaded, eyes, policy)
    configuration: dict[str, Any] = {
        "domain": loaded.name,
        "preset": loaded.preset,
        "classifier": chosen,
        "rates": eyes.rates,
        "data": str(data) if data else None,
        "tracks": eyes.tracks,
        "epochs": eyes.epochs,
        "policy": str(policy) if policy else "solved",
        "trials": "exact" if exact else trials,
        "seed": seed,
    }
    if exact:
        assert isinstance(eyes.reader, Channel)
        results = exact_scores(loaded, robot, eyes.reader, rows)
    else:
        experiment = Experiment(loaded, robot, eyes.reader, eyes.appearance, rows, seed)
        with show.progress("deciding", trials) as advance:
            results, done = run_trials(experiment, trials, jobs=show.cores(jobs), progress=advance)
        if done < trials:
            configuration["trials"] = done
    show.console.print(_table(results, loaded.positive, configuration["trials"]))
    for note in eyes.notes:
        show.console.print(f"note: {note}", style="yellow")
    if out is not None:
        _write(out, results, configuration, eyes)
    if configuration["trials"] not in ("exact", trials):
        show.messages.print(f"interrupted: {configuration['trials']} of {trials} decisions are kept")


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
            *(_cell(e, 2) for e in (result.cost, result.earned)),
        )
    return table


def _cell(estimate: Estimate, digits: int) -> str:
    half = (estimate.high - estimate.low) / 2
    return f"{estimate.value:.{digits}f}" + (f"\n[dim]±{half:.{digits}f}[/dim]" if half else "")


def _write(out: Path, results: list[Scores], configuration: dict[str, Any], eyes: Any) -> None:
    from lcorpp.experiments.plotting import plot_comparison
    from lcorpp.experiments.results import write_comparison
    from lcorpp.learning import TrainedClassifier, save_classifier

    written = list(write_comparison(out, results, configuration))
    title = f"{configuration['domain']}, {configuration['classifier']}, {configuration['trials']} decisions"
    plot_comparison(results, title, out / "results.png")
    written.append(out / "results.png")
    if isinstance(eyes.reader, TrainedClassifier):
        save_classifier(eyes.reader, out / "classifier.npz")
        written.append(out / "classifier.npz")
    show.console.print("wrote " + ", ".join(str(path) for path in written))
