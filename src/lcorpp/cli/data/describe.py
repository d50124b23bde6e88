"""Output of `lcorpp data describe`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lcorpp.cli import console
from lcorpp.errors import DataError
from lcorpp.learning.classifiers.learner_table import RECOMMENDED
from lcorpp.learning.data.describe import Description, Quantiles, describe, join_pairs
from lcorpp.learning.data.repairs import REPAIRS
from lcorpp.learning.data.tracks import Recording, Repair, count_repairs
from lcorpp.learning.evaluation.leakage import MAX_P_VALUE, MIN_SUSPICIOUS_AUC, measure_leakage
from lcorpp.values import Dataset, Kind

MAX_SHOWN = 20
"""Maximal number of features of which the range is shown."""


def print_description(recording: Recording, path: Path, seed: int) -> None:
    """Print counts, durations, speeds, sampling, duplicates, repairs and the leak check.

    Raises:
        DataError: there are no tracks.
    """
    emit = console.out.print
    if not recording.tracks:
        _print_repairs(recording.repairs)
        raise DataError("; ".join([f"{path}: no track remains", *recording.notes]))
    from lcorpp.learning.evaluation.folds import count_people

    description = describe(recording)
    people = count_people([track.group for track in recording.tracks])
    emit(
        f"{path}: {description.tracks} tracks of {people} people; {', '.join(description.channels)}",
        style="bold",
    )
    names = [part.name or "without a label" for part in description.classes]
    width = max(5, *map(len, names))
    emit(f"  {'class':<{width}}  tracks  people   samples  seconds of a track      m/s of a track")
    for name, part in zip(names, description.classes, strict=True):
        emit(
            f"  {name:<{width}}  {part.tracks:6}  {part.groups:6}  {part.samples:8}"
            f"  {_format_quantiles(part.duration, 1):<22}  {_format_quantiles(part.speed, 2)}"
        )
    steps, (speed, track) = description.interval, description.fastest
    emit(
        f"sampling: every {steps.median:.4g} s [{steps.min:.4g}, {steps.max:.4g}],"
        f" jitter {100 * description.jitter:.1f} %"
    )
    emit(f"fastest: {speed:.3g} m/s between two samples, in track {track}")
    _print_duplicates(description)
    _print_repairs(recording.repairs)
    _print_leaks(recording, seed)
    _print_recommendation("motion", recording.labels)
    for note in recording.notes:
        emit(f"note: {note}", style="yellow")


def print_features(dataset: Dataset, path: Path, repairs: Sequence[Repair], seed: int) -> None:
    """Print counts, ranges, repairs and the leak check of features, or of channels that are not motion."""
    from lcorpp.learning.evaluation.folds import count_people

    emit, people = console.out.print, count_people(dataset.groups)
    if dataset.kind == "table":
        kind, over_time = "features", ""
    else:
        kind, over_time = "channels", f"; {dataset.extent} every {dataset.interval:g} s"
    emit(
        f"{path}: {len(dataset)} cases of {people} people; {len(dataset.channels)} {kind}{over_time}",
        style="bold",
    )
    names = sorted(set(dataset.labels))
    width = max(5, *map(len, names))
    emit(f"  {'class':<{width}}   cases  people")
    for name in names:
        groups = [g for g, label in zip(dataset.groups, dataset.labels, strict=True) if label == name]
        emit(f"  {name:<{width}}  {len(groups):6}  {len(set(groups)):6}")
    shown = dataset.channels[:MAX_SHOWN]
    width = max(7, *map(len, shown))
    emit(f"  {kind[:-1]:<{width}}  median [minimum, maximum]")
    for index, name in enumerate(shown):
        values = dataset.trajectories[:, index]
        spread = Quantiles.of(values[~np.isnan(values)])
        numbers = f"{spread.median:.4g} [{spread.min:.4g}, {spread.max:.4g}]"
        emit(f"  {name:<{width}}  {numbers}")
    if len(dataset.channels) > MAX_SHOWN:
        emit(f"  ... ({len(dataset.channels)} in all)")
    repeated = len(dataset) - len({case.tobytes() for case in dataset.trajectories})
    emit(f"repeated cases: {repeated or 'none'}")
    _print_repairs(repairs)
    if dataset.kind == "series":
        _print_leaks(dataset, seed)
    _print_recommendation(dataset.kind, dataset.labels)
    for note in dataset.notes:
        emit(f"note: {note}", style="yellow")


def _print_recommendation(kind: Kind, labels: Sequence[str | None]) -> None:
    if len(set(labels) - {None}) < 2:
        return
    name, reason = RECOMMENDED[kind]
    console.out.print(f"recommended learner: {name}, because {reason}")


def _format_quantiles(spread: Quantiles, digits: int) -> str:
    """Return the median with the minimum and maximum."""
    return f"{spread.median:.{digits}f} [{spread.min:.{digits}f}, {spread.max:.{digits}f}]"


def _print_duplicates(description: Description) -> None:
    kinds = {"identical": description.identical, "near-identical": description.near}
    parts = [
        f"{kind} tracks: {f'{len(pairs)} pairs ({join_pairs(pairs)})' if pairs else 'none'}"
        for kind, pairs in kinds.items()
    ]
    reused = list(description.reused)
    people = ", ".join(reused[:5]) + (", ..." if len(reused) > 5 else "")
    parts.append(f"people with several tracks: {f'{len(reused)} ({people})' if reused else 'none'}")
    console.out.print(f"duplicates: {'; '.join(parts)}")


def _print_repairs(repairs: Sequence[Repair]) -> None:
    if not repairs:
        return
    console.out.print("repaired:")
    for reason, (rows, places) in count_repairs(repairs).items():
        first = next(repair for repair in repairs if repair.reason == reason)
        whose = f" (track {first.track})" if first.track else ""
        console.out.print(
            f"  {reason}: {rows} rows in {places} places ({REPAIRS[reason]});"
            f" first in line {first.line}{whose}: {first.done}"
        )


def _print_leaks(data: Dataset | Recording, seed: int) -> None:
    emit = console.out.print
    try:
        leaks = measure_leakage(data, seed=seed)
    except DataError as error:
        emit(f"leak check: not possible: {error}")
        return
    emit(
        f"leak check: AUC of the label predicted without motion; {MIN_SUSPICIOUS_AUC:g} or more,"
        f" not by chance (p at most {MAX_P_VALUE:g}), is a leak"
    )
    for leak in leaks:
        verdict = "LEAK" if leak.is_suspicious else "no leak"
        style = "bold red" if leak.is_suspicious else ""
        emit(f"  {leak.name:<14}  {leak.auc}  p {leak.p_value:.3f}  {verdict}", style=style)
