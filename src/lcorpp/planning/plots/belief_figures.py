"""Figures of a policy on the beliefs over two states, a line, or three states, a triangle."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon

from lcorpp.planning.plots.belief_regions import BeliefSlice, Region, area, grid, slice_policy
from lcorpp.planning.policy import Policy, UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.plot_style import INK, MUTED, ORANGE, Fill, despine, with_style, wrap_text

LINE_POINTS, TRIANGLE_POINTS = 201, 60
"""Beliefs along a line, and along an edge of a triangle, at which the upper bound is evaluated."""

MAX_GAP_HEIGHT = 1.5
"""The upper bound is shown up to this multiple of the curve's height above the curve."""

LETTER_WIDTH = 0.017
"""Approximate width of a letter relative to the bands; decides which names fit."""

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
"""(3, 2) coordinates of the certain beliefs."""

MAX_LINE_LETTERS = 26
"""Longer state names are broken into lines."""


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
        base: (S,) belief: the other states keep their probabilities, the two share the rest. When None the
            others have probability 0.
        bound: show the upper bound if the policy has one.

    Raises:
        ModelError: a state is unknown or appears twice, or `base` leaves no probability for the states.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import draw_line
        >>> pomdp = load_domain("intention").pomdp
        >>> figure = draw_line(pomdp, solve(pomdp).policy, pomdp.states[:2])
        >>> [axes.get_ylabel() for axes in figure.axes]
        ['value', 'action']
    """
    line = slice_policy(pomdp, policy, states, base)
    regions = line.regions()
    figure = Figure(figsize=(7, 4.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[6, 1])
    top = (
        _draw_line_gap(above, line, policy.upper_bound)
        if bound and policy.upper_bound is not None
        else -np.inf
    )
    _draw_value(above, line, regions, top)
    unnamed = _draw_bands(below, regions, pomdp.actions)
    above.set_ylabel("value")
    below.set_yticks([])
    below.set_xlim(0, 1)
    below.set_ylabel("action", rotation=0, ha="right", va="center")
    share = "" if line.share == 1 else f" as a share of the {line.share:.3g} given to both"
    below.set_xlabel(wrap_text(f"P({states[1]}){share}; the rest is {states[0]}", 76))
    despine(above)
    below.spines[:].set_visible(False)
    handles, _ = above.get_legend_handles_labels()
    handles += [_make_patch(action, pomdp.actions[action]) for action in unnamed]
    if handles:
        above.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.02), frameon=False)
    if title:
        figure.suptitle(title, fontsize=11)
    return figure


def _draw_line_gap(axes: Axes, line: BeliefSlice, bound: UpperBound) -> float:
    """Draw the upper bound and the gap to the policy; return the bound's maximum."""
    right = np.linspace(0, 1, LINE_POINTS)
    weights = np.stack([1 - right, right], axis=1)
    low = line.value(weights)
    high = np.maximum(low, [bound.value(line.belief(weight)) for weight in weights])
    axes.fill_between(right, low, high, color=ORANGE, alpha=0.16, linewidth=0)
    axes.plot(right, high, color=ORANGE, linewidth=1.2, linestyle="--", label="upper bound")
    axes.plot([], [], " ", label=f"largest gap {float((high - low).max()):.3g}")
    return float(high.max())


def _draw_value(axes: Axes, line: BeliefSlice, regions: Sequence[Region], top: float) -> None:
    """Draw the value function, and behind it each of its vectors from end to end."""
    heights = [region.points @ line.values[region.vector] for region in regions]
    low, high = float(np.min(heights)), float(np.max(heights))
    margin = 0.08 * (high - low) or 0.5
    for region, curve in zip(regions, heights, strict=True):
        colour = Fill.of(region.action).colour
        axes.plot([0, 1], line.values[region.vector], color=colour, linewidth=0.7, alpha=0.7, zorder=2)
        axes.plot(region.points[:, 1], curve, color=INK, linewidth=3.4, zorder=3, solid_capstyle="round")
        axes.plot(region.points[:, 1], curve, color=colour, linewidth=2.2, zorder=4)
    axes.set_ylim(low - margin, min(max(high, top), high + MAX_GAP_HEIGHT * (high - low)) + margin)


def _draw_bands(axes: Axes, regions: Sequence[Region], names: Sequence[str]) -> list[int]:
    """Draw a band for each run of one action; return the actions whose name does not fit."""
    named = set()
    for action, run in groupby(regions, key=lambda region: region.action):
        ends = np.concatenate([region.points[:, 1] for region in run])
        begin, end, fill = float(ends[0]), float(ends[-1]), Fill.of(action)
        axes.axvspan(begin, end, facecolor=fill.colour, hatch=fill.hatch, edgecolor="white", linewidth=0.8)
        if len(names[action]) * LETTER_WIDTH < end - begin:
            named.add(action)
            text = axes.text((begin + end) / 2, 0.5, names[action], ha="center", va="center")
            text.set(color=fill.text_colour, bbox=fill.text_background)
    return sorted({region.action for region in regions} - named)


@with_style
def draw_triangle(
    pomdp: Pomdp,
    policy: Policy,
    states: Sequence[str],
    *,
    base: npt.ArrayLike | None = None,
    bound: bool = True,
    title: str = "",
) -> Figure:
    """Draw a policy on the beliefs over three states; each vector's region has a thin white outline.

    If the policy has an upper bound, a second triangle shows the gap.

    Args:
        states: names of three states: at the left, at the right and on top.
        base, bound: as for `draw_line`.

    Raises:
        ModelError: a state is unknown or appears twice, or `base` leaves no probability for the states.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import draw_triangle
        >>> pomdp = load_domain("intention").pomdp
        >>> figure = draw_triangle(pomdp, solve(pomdp).policy, pomdp.states[:3])
        >>> len(figure.axes)
        3
    """
    triangle = slice_policy(pomdp, policy, states, base)
    regions = triangle.regions()
    above = policy.upper_bound if bound else None
    figure = Figure(figsize=(6, 5.6) if above is None else (11, 5.6), layout="constrained")
    left, *right = figure.subplots(1, 1 if above is None else 2, squeeze=False)[0]
    for axes in (left, *right):
        _draw_frame(axes, states)
    for region in regions:
        fill, corners = Fill.of(region.action), region.points @ CORNERS
        left.add_patch(Polygon(corners, facecolor=fill.colour, hatch=fill.hatch, edgecolor=INK, linewidth=0))
        left.add_patch(Polygon(corners, facecolor="none", edgecolor="white", linewidth=0.5))
    lines = max(wrap_text(name, MAX_LINE_LETTERS).count("\n") + 1 for name in states[:2])
    _draw_legend(left, regions, pomdp.actions, lines)
    if above is not None:
        _draw_triangle_gap(right[0], triangle, above)
    if triangle.share < 1:
        rest = f"the other states keep {1 - triangle.share:.3g} in all"
        figure.supxlabel(rest, fontsize=9, color=MUTED)
    if title:
        figure.suptitle(title, fontsize=11)
    return figure


def _draw_frame(axes: Axes, states: Sequence[str]) -> None:
    """Draw the outline, with a state's name at each corner."""
    axes.set_aspect("equal")
    axes.axis("off")
    axes.add_patch(Polygon(CORNERS, facecolor="none", edgecolor=INK, linewidth=1.2, zorder=4))
    for name, corner, side, up in zip(states, CORNERS, ("left", "right", "center"), (-1, -1, 1), strict=True):
        axes.annotate(
            wrap_text(name, MAX_LINE_LETTERS),
            corner,
            xytext=(0, 6 * up),
            textcoords="offset points",
            ha=side,
            va="bottom" if up > 0 else "top",
        )
    axes.set_xlim(-0.01, 1.01)
    axes.set_ylim(-0.01, CORNERS[2, 1] + 0.01)


def _draw_legend(axes: Axes, regions: Sequence[Region], names: Sequence[str], lines: int) -> None:
    """List the actions with their shares of the triangle, below corner names of `lines` lines."""
    shares: dict[int, float] = {}
    for region in regions:
        shares[region.action] = shares.get(region.action, 0.0) + area(region.points)
    handles = [
        _make_patch(
            action, f"{names[action]} ({share:.0%})" if share >= 0.01 else f"{names[action]} (below 1%)"
        )
        for action, share in sorted(shares.items())
    ]
    columns = 1 if len(handles) == 1 else 2 if max(map(len, names)) > 14 else 3
    below = -0.02 - 0.045 * lines
    axes.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, below), ncols=columns, frameon=False
    )


def _draw_triangle_gap(axes: Axes, triangle: BeliefSlice, bound: UpperBound) -> None:
    """Draw the gap between upper bound and policy."""
    weights = grid(TRIANGLE_POINTS)
    high = np.array([bound.value(triangle.belief(weight)) for weight in weights])
    gap = np.maximum(0.0, high - triangle.value(weights))
    x, y = (weights @ CORNERS).T
    painted = axes.tripcolor(x, y, gap, shading="gouraud", cmap="cividis_r", vmin=0, rasterized=True)
    colours = axes.figure.colorbar(painted, ax=axes, shrink=0.7, pad=0.02)
    colours.set_label("gap: upper bound minus policy value")
    colours.outline.set_visible(False)


def _make_patch(action: int, label: str) -> Patch:
    """Return the entry of an action for a legend."""
    fill = Fill.of(action)
    return Patch(facecolor=fill.colour, hatch=fill.hatch, label=label)
