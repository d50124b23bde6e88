"""Pictures of recorded tracks: where people of each class walk, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lcorpp.errors import DataError
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.plot_style import COLOURS, INK, MUTED, despine, with_style
from lcorpp.values import Array

MOST = 300
"""Tracks of a class that are drawn, evenly chosen; more hide each other."""

STEP = 0.4
"""Seconds over which a speed is taken: at 30 Hz a tracker's noise alone would look like walking."""

SPEEDS = 2.3
"""Inches that the speeds are high."""

COMMON = 0.5
"""The share of a class's tracks that must reach back to a time for their speeds to be drawn there."""

ORDER = (5, 1, 2, 3, 6, 0)
"""Which of the house's colours the classes get."""


@with_style
def plot_tracks(recording: Recording, *, title: str = "", most: int = MOST) -> Figure:
    """A panel of tracks for each class, all to one scale, above the speeds of all classes.

    A dot is where a track ends, a cross where the robot stands. The speeds are the median of the class and
    the middle half of it, over the time before each track's end.

    Args:
        title: written above. most: tracks to draw of each class, evenly chosen.

    Raises:
        DataError: there are no tracks.
    """
    if not recording.tracks:
        raise DataError(f"{recording.source or 'the recording'}: there are no tracks to draw")
    names = sorted(set(recording.labels), key=lambda name: (name is None, name))
    classes = [[track for track in recording.tracks if track.label == name] for name in names]
    width = max(6.0, 3.8 * len(names))
    panel = _height(recording.tracks, width / len(names))
    figure = Figure(figsize=(width, panel + SPEEDS + 1.9), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=[panel + 0.8, SPEEDS + 0.8])
    above, below = parts
    first: Axes | None = None
    for column, (name, tracks) in enumerate(zip(names, classes, strict=True)):
        axes = above.add_subplot(1, len(names), column + 1, sharex=first, sharey=first)
        first = first or axes
        shown = _draw_class(axes, tracks, _colour(column), most)
        many = f"{len(tracks)} tracks" if shown == len(tracks) else f"{shown} of {len(tracks)} tracks"
        axes.set_title(f"{name or 'without a label'}: {many}", fontsize=10)
        axes.set_xlabel("x (m)")
        if column == 0:
            axes.set_ylabel("y (m)")
        else:
            axes.tick_params(labelleft=False)
    _draw_speeds(below.add_subplot(), names, classes)
    if title:
        figure.suptitle(title, fontsize=11)
    return figure


def _height(tracks: Sequence[Track], width: float) -> float:
    """Inches that a panel of this width needs for all tracks to one scale, within reason."""
    extent = np.ptp(np.concatenate([track.place for track in tracks], axis=1), axis=1)
    return float(np.clip((width - 0.6) * extent[1] / max(extent[0], 1e-9), 1.0, 5.0))


def _colour(number: int) -> str:
    return COLOURS[ORDER[number % len(ORDER)]]


def _draw_class(axes: Axes, tracks: Sequence[Track], colour: str, most: int) -> int:
    """Draw some tracks evenly chosen among those of a class; returned is how many."""
    chosen = np.unique(np.linspace(0, len(tracks) - 1, min(most, len(tracks))).round().astype(int))
    places = [tracks[i].place.T for i in chosen]
    alpha = float(np.clip(12 / len(places), 0.2, 0.8))
    axes.add_collection(LineCollection(places, colors=colour, linewidths=0.9, alpha=alpha))
    ends = np.array([place[-1] for place in places])
    axes.plot(*ends.T, ".", color=colour, markersize=4, alpha=min(1.0, 2 * alpha), markeredgewidth=0)
    axes.plot(0, 0, "+", color=INK, markersize=11, markeredgewidth=1.8)
    axes.set_aspect("equal", adjustable="box")
    axes.autoscale_view()
    axes.spines[["top", "right"]].set_visible(False)
    return len(places)


def _draw_speeds(axes: Axes, names: Sequence[str | None], classes: Sequence[Sequence[Track]]) -> None:
    for number, (name, tracks) in enumerate(zip(names, classes, strict=True)):
        times, speeds = _speeds_before_end(tracks)
        if not len(times):
            continue
        low, middle, high = np.nanquantile(speeds, [0.25, 0.5, 0.75], axis=0)
        axes.fill_between(times, low, high, color=_colour(number), alpha=0.16, linewidth=0)
        axes.plot(times, middle, color=_colour(number), linewidth=1.8, label=name or "without a label")
    axes.axvline(0, color=MUTED, linewidth=0.8)
    axes.set(xlabel="seconds before the track ends", ylabel="speed (m/s)")
    axes.set_ylim(bottom=0)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, ncols=len(names), loc="lower left", bbox_to_anchor=(0, 1))
    despine(axes)


def _speeds_before_end(tracks: Sequence[Track]) -> tuple[Array, Array]:
    """(times,) seconds, 0 at the end, and (tracks, times) speeds over `STEP`, NaN before a track begins.

    Times that fewer than `COMMON` of the tracks reach are left out.
    """
    durations = np.sort([track.duration for track in tracks])[::-1]
    reached = durations[max(0, int(np.ceil(COMMON * len(tracks))) - 1)]
    steps = int(reached / STEP + 1e-9)
    back = -STEP * np.arange(steps, -1, -1)
    speeds = np.full((len(tracks), steps), np.nan)
    for row, track in enumerate(tracks):
        at = back + track.times[-1]
        x, y = (np.interp(at, track.times, track.columns[name]) for name in ("x", "y"))
        seen = at[:-1] >= track.times[0] - 1e-9
        speeds[row, seen] = (np.hypot(np.diff(x), np.diff(y)) / STEP)[seen]
    return (back[:-1] + back[1:]) / 2, speeds
