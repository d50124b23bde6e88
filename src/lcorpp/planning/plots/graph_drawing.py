"""Drawing of layered graphs: boxes with text, curved arrows, and labels at free places.

All lengths are in inches, because the size of text is.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.path import Path

from lcorpp.planning.plots.graph_layout import layout_graph
from lcorpp.plot_style import INK, MUTED, Fill, wrap_text
from lcorpp.values import Array

LETTER_WIDTH, LABEL_HALF_LETTER, LINE_HEIGHT = 0.082, 0.036, 0.15
"""Upper bounds of the width of a letter in a box, half the width of one in a label, the height of a line."""

BOX_HEIGHT, ROW_HEIGHT, LOOP_HEIGHT, MARGIN = 0.34, 0.66, 0.24, 0.25
"""Heights of a box, of a row of boxes and of a loop above its box; margin of the figure."""

LABEL_POSITIONS = (0.42, 0.5, 0.34, 0.58, 0.26, 0.66, 0.18, 0.76)
"""Candidate positions of a label along its arrow, in order of preference."""

ARROW_COST = 0.01
"""Cost of a label over one segment of another arrow, in square inches of covered text."""

BOX_COST = 4.0
"""Cost of a label over a box, relative to a label over other text."""

SEGMENT = 0.05
"""Length of an arrow's segments in the cost of labels."""


class Box(NamedTuple):
    """A node. depth: its layer. first: whether it has a strong frame. cut: a dashed frame."""

    text: str
    fill: Fill
    depth: int
    first: bool = False
    cut: bool = False


class Arrow(NamedTuple):
    """An arrow between two nodes. label: lines of text. width: in points."""

    source: int
    target: int
    label: Sequence[str]
    colour: str
    style: str
    width: float


class Rectangle(NamedTuple):
    """An axis-parallel rectangle."""

    left: float
    bottom: float
    right: float
    top: float

    def overlap(self, other: Rectangle) -> float:
        """Return the area of the intersection."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.top, other.top) - max(self.bottom, other.bottom)
        return max(0.0, width) * max(0.0, height)


def draw(nodes: Sequence[Box], arrows: Sequence[Arrow], *, title: str = "", caption: str = "") -> Figure:
    """Draw nodes in layers by their depth, from left to right, and arrows between them."""
    positions, routes = layout_graph(
        [node.depth for node in nodes], [(arrow.source, arrow.target) for arrow in arrows]
    )
    box = max(len(node.text) for node in nodes) * LETTER_WIDTH + 0.24
    longest = max((len(line) for arrow in arrows for line in arrow.label), default=0)
    step = box + max(0.9, longest * LETTER_WIDTH + 0.6)
    heights = np.concatenate([positions[:, 1], *(route[:, 1] for route in routes)])
    low = float(heights.min())
    loops = [a for a in arrows if a.source == a.target and nodes[a.source].depth == 0]
    lead = max([MARGIN, *(LABEL_HALF_LETTER * max(map(len, loop.label)) - box / 2 + 0.1 for loop in loops)])
    width = (
        max(float(positions[:, 0].max()) * step + box, (len(title) + 4) * LETTER_WIDTH) + lead + MARGIN + 0.3
    )
    caption = wrap_text(caption, int((width - 2 * MARGIN) / (0.9 * LETTER_WIDTH)))
    deepest = max((len(arrow.label) for arrow in arrows), default=1)
    top = MARGIN + LOOP_HEIGHT + (deepest - 1) * LINE_HEIGHT / 2 + (0.3 if title else 0.0)
    bottom = MARGIN + (0.1 + LINE_HEIGHT * (caption.count("\n") + 1) if caption else 0.0)
    height = (float(heights.max()) - low) * ROW_HEIGHT + BOX_HEIGHT + top + bottom

    def to_inches(points: Array) -> Array:
        """Convert layers and heights to inches; the first node of a layer is on top."""
        x = lead + box / 2 + points[:, 0] * step
        y = height - top - BOX_HEIGHT / 2 - (points[:, 1] - low) * ROW_HEIGHT
        return np.stack([x, y], axis=1)

    centres = to_inches(positions)
    ports = _place_ports(arrows, centres, [to_inches(route) for route in routes])
    paths = [_make_path(to_inches(route), box, *ends) for route, ends in zip(routes, ports, strict=True)]
    lines = [_sample_points(path) for path in paths]
    right = [
        line[:, 0].max() + LABEL_HALF_LETTER * max(map(len, arrow.label))
        for line, arrow in zip(lines, arrows, strict=True)
    ]
    width = max([width, *(float(x) + MARGIN for x in right)])
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.axis("off")
    boxes = [_draw_box(axes, node, centre, box) for node, centre in zip(nodes, centres, strict=True)]
    labels: list[Rectangle] = []
    for number, (arrow, path) in enumerate(zip(arrows, paths, strict=True)):
        head = FancyArrowPatch(
            path=path,
            arrowstyle="-|>,head_length=5,head_width=2.5",
            color=arrow.colour,
            linestyle=arrow.style,
            linewidth=arrow.width,
            zorder=2,
        )
        axes.add_patch(head)
        others = np.concatenate([np.zeros((0, 2)), *lines[:number], *lines[number + 1 :]])
        labels.append(_draw_label(axes, arrow, lines[number], boxes, labels, others))
    if title:
        axes.text(width / 2, height - MARGIN, title, ha="center", va="center", fontsize=11)
    if caption:
        axes.text(MARGIN, MARGIN, caption, ha="left", va="bottom", fontsize=8.5, color=MUTED)
    return figure


def _draw_box(axes: Axes, node: Box, centre: Array, width: float) -> Rectangle:
    """Draw the box of a node; return its rectangle."""
    x, y = centre.tolist()
    shape = FancyBboxPatch(
        (x - width / 2, y - BOX_HEIGHT / 2),
        width,
        BOX_HEIGHT,
        boxstyle="round,pad=0,rounding_size=0.08",
        facecolor=node.fill.colour,
        hatch=node.fill.hatch,
        edgecolor=INK,
        linewidth=2.4 if node.first else 0.9,
        linestyle="--" if node.cut else "-",
        zorder=3,
    )
    axes.add_patch(shape)
    text = axes.text(x, y, node.text, ha="center", va="center", fontsize=9, color=node.fill.text_colour)
    text.set(bbox=node.fill.text_background, zorder=4)
    return Rectangle(x - width / 2, y - BOX_HEIGHT / 2, x + width / 2, y + BOX_HEIGHT / 2)


def _place_ports(
    arrows: Sequence[Arrow], centres: Array, routes: Sequence[Array]
) -> list[tuple[float, float]]:
    """Return the offsets at which each arrow leaves and enters its boxes, so that no two coincide."""
    sides: dict[tuple[int, int], list[tuple[float, int, int]]] = {}
    for number, (arrow, route) in enumerate(zip(arrows, routes, strict=True)):
        for end, node, near in ((0, arrow.source, route[1]), (1, arrow.target, route[-2])):
            if arrow.source != arrow.target:
                side = 1 if near[0] >= centres[node, 0] else -1
                sides.setdefault((node, side), []).append((float(near[1]), number, end))
    ports = [[0.0, 0.0] for _ in arrows]
    for ends in sides.values():
        height = 0.7 * BOX_HEIGHT * min(1.0, (len(ends) - 1) / 3)
        for (_, number, end), up in zip(
            sorted(ends), np.linspace(-height / 2, height / 2, len(ends)), strict=True
        ):
            ports[number][end] = float(up)
    return [(leaves, arrives) for leaves, arrives in ports]


def _make_path(route: Array, box: float, leaves: float, arrives: float) -> Path:
    """Return curves from one box to another, horizontal where they cross a layer."""
    (x, y), (u, v) = route[0], route[-1]
    half, top = box / 2, BOX_HEIGHT / 2
    if len(route) == 2 and x == u and y == v:  # a loop on top of the box
        right, left = (x + 0.32 * half, y + top), (x - 0.32 * half, y + top)
        lift = LOOP_HEIGHT + 0.1  # the curve stays below its control points
        return Path([right, (right[0] + 0.1, right[1] + lift), (left[0] - 0.1, left[1] + lift), left], _CURVE)
    if x == u:  # within a layer: a bend to the right
        out = 0.45 + 0.06 * abs(y - v)
        begin, end = (x + half, y + leaves), (u + half, v + arrives)
        return Path([begin, (begin[0] + out, begin[1]), (end[0] + out, end[1]), end], _CURVE)
    ahead = 1 if u > x else -1
    points = [(x + ahead * half, y + leaves)]
    for dummy in route[1:-1]:
        points += [(dummy[0] - ahead * half, dummy[1]), (dummy[0] + ahead * half, dummy[1])]
    points.append((u - ahead * half, v + arrives))
    vertices, codes = [points[0]], [Path.MOVETO]
    for number, ((a, b), (c, d)) in enumerate(pairwise(points)):
        if number % 2:  # across a layer
            vertices.append((c, d))
            codes.append(Path.LINETO)
        else:
            vertices += [((a + c) / 2, b), ((a + c) / 2, d), (c, d)]
            codes += [Path.CURVE4] * 3
    return Path(vertices, codes)


_CURVE = [Path.MOVETO, Path.CURVE4, Path.CURVE4, Path.CURVE4]


def _sample_points(path: Path) -> Array:
    """Return (m, 2) points on a path, `SEGMENT` apart."""
    corners = np.asarray(path.to_polygons(closed_only=False)[0], dtype=np.float64)
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    steps = np.linspace(0, run[-1], max(2, int(run[-1] / SEGMENT)))
    points: Array = np.stack([np.interp(steps, run, corners[:, i]) for i in (0, 1)], axis=1)
    return points


def _draw_label(
    axes: Axes,
    arrow: Arrow,
    line: Array,
    boxes: Sequence[Rectangle],
    labels: Sequence[Rectangle],
    others: Array,
) -> Rectangle:
    """Draw an arrow's label where it covers least of boxes, labels and other arrows; return its rectangle."""
    width = 2 * LABEL_HALF_LETTER * max(map(len, arrow.label))
    height = len(arrow.label) * LINE_HEIGHT
    candidates: list[tuple[float, int, Rectangle]] = []
    for rank, share in enumerate(LABEL_POSITIONS):
        x, y = line[round(share * (len(line) - 1))].tolist()
        area = Rectangle(x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        covered = sum(map(area.overlap, labels)) + BOX_COST * sum(map(area.overlap, boxes))
        segments = ((others > area[:2]) & (others < area[2:])).all(axis=1).sum()
        candidates.append((covered + ARROW_COST * float(segments), rank, area))
    area = min(candidates)[2]
    axes.text(
        (area.left + area.right) / 2,
        (area.bottom + area.top) / 2,
        "\n".join(arrow.label),
        ha="center",
        va="center",
        fontsize=7.5,
        color=INK,
        linespacing=1.05,
        bbox={"facecolor": "white", "alpha": 0.85, "linewidth": 0, "pad": 0.8},
        zorder=5,
    )
    return area
