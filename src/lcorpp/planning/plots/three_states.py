"""Figure of a policy on the beliefs over three states: a triangle coloured by action."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon

from lcorpp.planning.plots.belief_regions import BeliefSlice, Region, area, grid, slice_policy
from lcorpp.planning.policy import Policy, UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.plot_style import INK, MUTED, Fill, with_style, wrap_text

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
"""(3, 2) coordinates of the certain beliefs."""

MAX_LINE_LETTERS = 26
"""Longer state names are broken into lines."""

STEPS = 60
"""Beliefs along an edge at which the upper bound is evaluated."""


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
        base: (S,) belief with the probabilities of all other states; 0 when None.
        bound: show the gap if the policy has an upper bound.
        title: of the figure.

    Raises:
        ModelError: a state is unknown or appears twice, or `base` leaves no probability for the states.
    """
    triangle = slice_policy(pomdp, policy, states, base)
    regions = triangle.regions()
    above = policy.upper_bound if bound else None
    figure = Figure(figsize=(6, 5.6) if above is None else (11, 5.6), layout="constrained")
    left, *right = figure.subplots(1, 1 if above is None else 2, squeeze=False)[0]
    for axes in (left, *right):
        _draw_frame(axes, states)
    _draw_regions(left, regions)
    lines = max(wrap_text(name, MAX_LINE_LETTERS).count("\n") + 1 for name in states[:2])
    _draw_legend(left, regions, pomdp.actions, lines)
    if above is not None:
        _draw_gap(right[0], triangle, above)
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


def _draw_regions(axes: Axes, regions: Sequence[Region]) -> None:
    for region in regions:
        fill = Fill.of(region.action)
        corners = region.points @ CORNERS
        axes.add_patch(Polygon(corners, facecolor=fill.colour, hatch=fill.hatch, edgecolor=INK, linewidth=0))
        axes.add_patch(Polygon(corners, facecolor="none", edgecolor="white", linewidth=0.5))


def _draw_legend(axes: Axes, regions: Sequence[Region], names: Sequence[str], lines: int) -> None:
    """List the actions with their shares of the triangle, below corner names of `lines` lines."""
    shares: dict[int, float] = {}
    for region in regions:
        shares[region.action] = shares.get(region.action, 0.0) + area(region.points)
    handles = []
    for action, share in sorted(shares.items()):
        fill = Fill.of(action)
        label = f"{names[action]} ({share:.0%})" if share >= 0.01 else f"{names[action]} (below 1%)"
        handles.append(Patch(facecolor=fill.colour, hatch=fill.hatch, label=label))
    columns = 1 if len(handles) == 1 else 2 if max(map(len, names)) > 14 else 3
    below = -0.02 - 0.045 * lines
    axes.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, below), ncols=columns, frameon=False
    )


def _draw_gap(axes: Axes, triangle: BeliefSlice, bound: UpperBound) -> None:
    """Draw the gap between upper bound and policy."""
    weights = grid(STEPS)
    high = np.array([bound.value(triangle.belief(weight)) for weight in weights])
    gap = np.maximum(0.0, high - triangle.value(weights))
    x, y = (weights @ CORNERS).T
    painted = axes.tripcolor(x, y, gap, shading="gouraud", cmap="cividis_r", vmin=0, rasterized=True)
    colours = axes.figure.colorbar(painted, ax=axes, shrink=0.7, pad=0.02)
    colours.set_label("gap: upper bound minus policy value")
    colours.outline.set_visible(False)
