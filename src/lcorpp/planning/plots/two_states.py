"""Figure of a policy on the beliefs over two states: value above, actions below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from lcorpp.planning.plots.belief_regions import BeliefSlice, Region, slice_policy
from lcorpp.planning.policy import Policy, UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.plot_style import INK, ORANGE, Fill, despine, with_style, wrap_text

POINTS = 201
"""Beliefs at which the upper bound is evaluated."""

MAX_GAP_HEIGHT = 1.5
"""The upper bound is shown up to this multiple of the curve's height above the curve."""

LETTER_WIDTH = 0.017
"""Approximate width of a letter relative to the bands; decides which names fit."""


@with_style
def draw_line(
    pomdp: Pomdp,
    policy: Policy,
    states: Sequence[str],
    *,
    base: npt.ArrayLike | None = None,
    bound: bool = True,
    title: str = "",
) -> Figure:
    """Draw a policy on the beliefs over two states.

    Above, the value: each segment of the curve belongs to an alpha vector, drawn as a thin line in the colour
    of its action. If the policy has an upper bound, the gap is shaded. Below, the actions.

    Args:
        states: names of two states, at the left and at the right end.
        base: (S,) belief with the probabilities of all other states; 0 when None.
        bound: show the upper bound if the policy has one.
        title: of the figure.

    Raises:
        ModelError: a state is unknown or appears twice, or `base` leaves no probability for the states.
    """
    line = slice_policy(pomdp, policy, states, base)
    regions = line.regions()
    figure = Figure(figsize=(7, 4.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[6, 1])
    top = _draw_gap(above, line, policy.upper_bound) if bound and policy.upper_bound is not None else -np.inf
    _draw_value(above, line, regions, top)
    fills = {region.action: Fill.of(region.action) for region in regions}
    unnamed = _draw_bands(below, regions, fills, pomdp.actions)
    above.set_ylabel("value")
    below.set_yticks([])
    below.set_xlim(0, 1)
    below.set_ylabel("action", rotation=0, ha="right", va="center")
    share = "" if line.share == 1 else f" as a share of the {line.share:.3g} given to both"
    below.set_xlabel(wrap_text(f"P({states[1]}){share}; the rest is {states[0]}", 76))
    despine(above)
    below.spines[:].set_visible(False)
    handles, names = above.get_legend_handles_labels()
    if unnamed:
        handles += [
            Patch(facecolor=fills[a].colour, hatch=fills[a].hatch, label=pomdp.actions[a]) for a in unnamed
        ]
        names += [pomdp.actions[a] for a in unnamed]
    if handles:
        above.legend(handles, names, loc="upper left", bbox_to_anchor=(1.01, 1.02), frameon=False)
    if title:
        figure.suptitle(title, fontsize=11)
    return figure


def _draw_gap(axes: Axes, line: BeliefSlice, bound: UpperBound) -> float:
    """Draw the upper bound and the gap to the policy; return the bound's maximum."""
    right = np.linspace(0, 1, POINTS)
    weights = np.stack([1 - right, right], axis=1)
    low = line.value(weights)
    high = np.maximum(low, [bound.value(line.belief(weight)) for weight in weights])
    axes.fill_between(right, low, high, color=ORANGE, alpha=0.16, linewidth=0)
    axes.plot(right, high, color=ORANGE, linewidth=1.2, linestyle="--", label="upper bound")
    axes.plot([], [], " ", label=f"largest gap {float((high - low).max()):.3g}")
    return float(high.max())


def _draw_value(axes: Axes, line: BeliefSlice, regions: Sequence[Region], top: float) -> None:
    """Draw the value function, and behind it each of its vectors from end to end."""
    ends = np.concatenate([line.values[region.vector] @ region.points.T for region in regions])
    low, high = float(ends.min()), float(ends.max())
    margin = 0.08 * (high - low) or 0.5
    for region in regions:
        colour = Fill.of(region.action).colour
        axes.plot([0, 1], line.values[region.vector], color=colour, linewidth=0.7, alpha=0.7, zorder=2)
        heights = region.points @ line.values[region.vector]
        axes.plot(region.points[:, 1], heights, color=INK, linewidth=3.4, zorder=3, solid_capstyle="round")
        axes.plot(region.points[:, 1], heights, color=colour, linewidth=2.2, zorder=4)
    axes.set_ylim(low - margin, min(max(high, top), high + MAX_GAP_HEIGHT * (high - low)) + margin)


def _draw_bands(
    axes: Axes, regions: Sequence[Region], fills: Mapping[int, Fill], names: Sequence[str]
) -> list[int]:
    """Draw a band for each run of one action; return the actions whose name does not fit."""
    runs: list[tuple[int, float, float]] = []
    for region in regions:
        begin, end = region.points[:, 1].tolist()
        if runs and runs[-1][0] == region.action:
            runs[-1] = (region.action, runs[-1][1], end)
        else:
            runs.append((region.action, begin, end))
    named = set()
    for action, begin, end in runs:
        fill = fills[action]
        axes.axvspan(begin, end, facecolor=fill.colour, hatch=fill.hatch, edgecolor="white", linewidth=0.8)
        if len(names[action]) * LETTER_WIDTH < end - begin:
            named.add(action)
            ground = {"facecolor": fill.colour, "linewidth": 0, "pad": 1.5} if fill.hatch else None
            axes.text(
                (begin + end) / 2,
                0.5,
                names[action],
                ha="center",
                va="center",
                color=fill.text_colour,
                bbox=ground,
            )
    return sorted({action for action, _, _ in runs} - named)
