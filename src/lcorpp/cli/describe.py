"""What `lcorpp data describe` says of a recording."""

from __future__ import annotations

from pathlib import Path

from lcorpp.cli import console as show
from lcorpp.errors import DataError
from lcorpp.learning.data.describe import ClassSummary, Description, Quantiles, describe, join_pairs
from lcorpp.learning.data.repairs import REPAIRS
from lcorpp.learning.data.tracks import Recording, count_repairs
from lcorpp.learning.evaluation.leakage import MIN_SUSPICIOUS_AUC, check_leakage


def tell(recording: Recording, path: Path, seed: int) -> None:
    """Print counts, durations, speeds, sampling, duplicates, repairs and the leak check.

    Raises:
        DataError: there are no tracks.
    """
    say = show.console.print
    if not recording.tracks:
        _repairs(recording)
        raise DataError(f"{path}: no track is left to describe")
    found = describe(recording)
    people = sum(part.groups for part in found.classes)
    say(f"{path}: {found.tracks} tracks of {people} people; {', '.join(found.channels)}", style="bold")
    width = max(5, *(len(_name(part)) for part in found.classes))
    say(f"  {'class':<{width}}  tracks  people   samples  seconds of a track      m/s of a track")
    for part in found.classes:
        say(
            f"  {_name(part):<{width}}  {part.tracks:6}  {part.groups:6}  {part.samples:8}"
            f"  {_range(part.duration, 1):<22}  {_range(part.speed, 2)}"
        )
    _sampling(found)
    _twice(found)
    _repairs(recording)
    _leaks(recording, seed)
    for note in recording.notes:
        say(f"note: {note}", style="yellow")


def _name(part: ClassSummary) -> str:
    return part.name or "without a label"


def _range(spread: Quantiles, digits: int) -> str:
    """The median with the extremes."""
    return f"{spread.median:.{digits}f} [{spread.min:.{digits}f}, {spread.max:.{digits}f}]"


def _sampling(found: Description) -> None:
    steps = found.interval
    show.console.print(
        f"sampling: every {steps.median:.4g} s [{steps.min:.4g}, {steps.max:.4g}],"
        f" jitter {100 * found.jitter:.1f} %"
    )
    speed, track = found.fastest
    show.console.print(f"fastest: {speed:.3g} m/s between two samples, in track {track}")


def _twice(found: Description) -> None:
    parts = [
        f"{kind} tracks: {len(pairs)} pairs ({join_pairs(pairs)})" if pairs else f"{kind} tracks: none"
        for kind, pairs in (("identical", found.identical), ("near-identical", found.near))
    ]
    reused = found.reused
    people = ", ".join(list(reused)[:5]) + (", ..." if len(reused) > 5 else "")
    parts.append(
        f"people with several tracks: {len(reused)} ({people})"
        if reused
        else "people with several tracks: none"
    )
    show.console.print(f"duplicates: {'; '.join(parts)}")


def _repairs(recording: Recording) -> None:
    if not recording.repairs:
        return
    show.console.print("repaired:")
    for reason, (rows, places) in count_repairs(recording.repairs).items():
        first = next(repair for repair in recording.repairs if repair.reason == reason)
        whose = f" (track {first.track})" if first.track else ""
        show.console.print(
            f"  {reason}: {rows} rows in {places} places ({REPAIRS[reason]});"
            f" first in line {first.line}{whose}: {first.done}"
        )


def _leaks(recording: Recording, seed: int) -> None:
    say = show.console.print
    try:
        leaks = check_leakage(recording, seed=seed)
    except DataError as error:
        say(f"leak check: not possible: {error}")
        return
    say(f"leak check: AUC of the label from what is not motion; {MIN_SUSPICIOUS_AUC:g} or more is a leak")
    for leak in leaks:
        verdict = "LEAK" if leak.flagged else "no leak"
        style = "bold red" if leak.flagged else ""
        say(f"  {leak.name:<12}  {leak.auc}  {verdict}", style=style)
