"""Plots of recorded tracks by class, and of their speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import count, cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.plot_style import COLOURS, INK, MUTED, despine, with_style
from lcorpp.values import Array

MAX_TRACKS = 300
"""Maximum number of tracks drawn per class; more hide each other."""

SPEED_STEP = 0.4
"""Seconds per speed value: at 30 Hz a tracker's noise alone looks like walking."""

SPEEDS_HEIGHT = 2.3
"""Height of the speed panel in inches."""

MIN_SHARE = 0.5
"""Minimum share of a class's tracks that cover a time for their speeds to be drawn there."""

CLASS_COLOURS = tuple(COLOURS[number] for number in (5, 1, 2, 3, 6, 0))
"""Colours that the classes take in turn."""


@with_style
@check_arguments
def plot_tracks(recording: Recording, *, title: str = "", max_tracks: int = MAX_TRACKS) -> Figure:
    """Plot the tracks of each class to one scale, above the speeds of all classes.

    A dot marks the end of a track, a cross the robot. Speeds are the median and the interquartile range of
    the class over the time before the end.

    Args:
        title: of the figure. max_tracks: maximum number of tracks per class, evenly selected.

    Raises:
        DataError: there are no tracks, or `max_tracks` is below 1.

    Examples:
        >>> from lcorpp.learning import Recording, Track, plot_tracks
        >>> track = Track("7", [0.0, 1.0], {"x": [5.0, 4.0], "y": [2.0, 2.0]}, "interested")
        >>> figure = plot_tracks(Recording([track]), title="One person")
        >>> [axes.get_xlabel() for axes in figure.axes]
        ['x (m)', 'seconds before the track ends']
    """
    if max_tracks < 1:
        raise DataError(f"max_tracks is {max_tracks}; expected 1 or more")
    if not recording.tracks:
        raise DataError(f"{recording.source or 'the recording'}: there are no tracks to draw")
    classes = recording.by_class()
    width = max(6.0, 3.8 * len(classes))
    panel = _height(recording.tracks, width / len(classes))
    figure = Figure(figsize=(width, panel + SPEEDS_HEIGHT + 1.9), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=[panel + 0.8, SPEEDS_HEIGHT + 0.8])
    above, below = parts
    first: Axes | None = None
    for (name, tracks), column, colour in zip(classes.items(), count(1), cycle(CLASS_COLOURS), strict=False):
        axes = above.add_subplot(1, len(classes), column, sharex=first, sharey=first)
        first = first or axes
        n_drawn = _draw_class(axes, tracks, colour, max_tracks)
        drawn = f"{len(tracks)} tracks" if n_drawn == len(tracks) else f"{n_drawn} of {len(tracks)} tracks"
        axes.set_title(f"{name or 'without a label'}: {drawn}", fontsize=10)
        axes.set(xlabel="x (m)", ylabel="y (m)")
        axes.label_outer()
    _draw_speeds(below.add_subplot(), classes)
    if title:
        figure.suptitle(title, fontsize=11)
    return figure


def _height(tracks: Sequence[Track], width: float) -> float:
    """Return the height in inches of a panel of this width at equal scale, within limits."""
    extent = np.ptp(np.concatenate([track.positions for track in tracks], axis=1), axis=1)
    return float(np.clip((width - 0.6) * extent[1] / max(extent[0], 1e-9), 1.0, 5.0))


def _draw_class(axes: Axes, tracks: Sequence[Track], colour: str, max_tracks: int) -> int:
    """Draw evenly selected tracks of a class; return their number."""
    chosen = np.unique(np.linspace(0, len(tracks) - 1, min(max_tracks, len(tracks))).round().astype(int))
    positions = [tracks[i].positions.T for i in chosen]
    alpha = float(np.clip(12 / len(positions), 0.2, 0.8))
    axes.add_collection(LineCollection(positions, colors=colour, linewidths=0.9, alpha=alpha))
    ends = np.array([track_positions[-1] for track_positions in positions])
    axes.plot(*ends.T, ".", color=colour, markersize=4, alpha=min(1.0, 2 * alpha), markeredgewidth=0)
    axes.plot(0, 0, "+", color=INK, markersize=11, markeredgewidth=1.8)
    axes.set_aspect("equal", adjustable="box")
    axes.autoscale_view()
    axes.spines[["top", "right"]].set_visible(False)
    return len(positions)


def _draw_speeds(axes: Axes, classes: Mapping[str | None, Sequence[Track]]) -> None:
    for (name, tracks), colour in zip(classes.items(), cycle(CLASS_COLOURS), strict=False):
        times, speeds = _speeds_before_end(tracks)
        if not len(times):
            continue
        low, middle, high = np.nanquantile(speeds, [0.25, 0.5, 0.75], axis=0)
        axes.fill_between(times, low, high, color=colour, alpha=0.16, linewidth=0)
        axes.plot(times, middle, color=colour, linewidth=1.8, label=name or "without a label")
    axes.axvline(0, color=MUTED, linewidth=0.8)
    axes.set(xlabel="seconds before the track ends", ylabel="speed (m/s)")
    axes.set_ylim(bottom=0)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, ncols=len(classes), loc="lower left", bbox_to_anchor=(0, 1))
    despine(axes)


def _speeds_before_end(tracks: Sequence[Track]) -> tuple[Array, Array]:
    """(times,) seconds, 0 at the end, and (tracks, times) speeds over `SPEED_STEP`, NaN before the track.

    Times covered by less than `MIN_SHARE` of the tracks are left out.
    """
    durations = np.sort([track.duration for track in tracks])[::-1]
    reached = durations[max(0, int(np.ceil(MIN_SHARE * len(tracks))) - 1)]
    steps = int(reached / SPEED_STEP + 1e-9)
    back = -SPEED_STEP * np.arange(steps, -1, -1)
    speeds = np.full((len(tracks), steps), np.nan)
    for row, track in enumerate(tracks):
        at = back + track.times[-1]
        x, y = (np.interp(at, track.times, track.columns[name]) for name in ("x", "y"))
        covered = at[:-1] >= track.times[0] - 1e-9
        speeds[row, covered] = (np.hypot(np.diff(x), np.diff(y)) / SPEED_STEP)[covered]
    return (back[:-1] + back[1:]) / 2, speeds
