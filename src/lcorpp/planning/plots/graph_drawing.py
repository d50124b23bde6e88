"""Nodes and arrows on paper: boxes with words, smooth ways between them, labels where there is room.

All lengths are inches, so that words take the room that they are given.
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

from lcorpp.planning.plots.graph_layout import layout
from lcorpp.plot_style import INK, MUTED, Fill, wrap_text
from lcorpp.values import Array

LETTER, HALF, LINE = 0.082, 0.036, 0.15
"""Width of a letter, half of that of one in a label, height of a line: a little more than they take."""

BOX, ROW, LOOP, MARGIN = 0.34, 0.66, 0.24, 0.25
"""Height of a box, distance between boxes of a layer, height of a loop above its box, margin around all."""

ALONG = (0.42, 0.5, 0.34, 0.58, 0.26, 0.66, 0.18, 0.76)
"""Where along its arrow a label may stand, the best place first."""

CROSSED = 0.01
"""What it counts to hide a piece of another arrow, in square inches of hidden words."""

HIDDEN_BOX = 4.0
"""How much worse it is to hide a box than to hide other words."""

PIECE = 0.05
"""Length of the pieces of an arrow that a label may hide."""


class Node(NamedTuple):
    """words: in its box. fill: of the box. first: with a strong frame. cut: with a dashed one."""

    words: str
    fill: Fill
    depth: int
    first: bool = False
    cut: bool = False


class Arrow(NamedTuple):
    """From one node to another; label: lines of words. width: in points."""

    source: int
    target: int
    label: Sequence[str]
    colour: str
    style: str
    width: float


class Rectangle(NamedTuple):
    """Room that is taken."""

    left: float
    bottom: float
    right: float
    top: float

    def overlap(self, other: Rectangle) -> float:
        """The area that both take."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.top, other.top) - max(self.bottom, other.bottom)
        return max(0.0, width) * max(0.0, height)


def draw(nodes: Sequence[Node], arrows: Sequence[Arrow], *, title: str = "", caption: str = "") -> Figure:
    """Nodes in layers by their depth, from left to right, and arrows among them."""
    places, ways = layout([node.depth for node in nodes], [(arrow.source, arrow.target) for arrow in arrows])
    box = max(len(node.words) for node in nodes) * LETTER + 0.24
    longest = max((len(line) for arrow in arrows for line in arrow.label), default=0)
    step = box + max(0.9, longest * LETTER + 0.6)
    heights = np.concatenate([places[:, 1], *(way[:, 1] for way in ways)])
    low = float(heights.min())
    loops = [a for a in arrows if a.source == a.target and nodes[a.source].depth == 0]
    lead = max([MARGIN, *(HALF * max(map(len, loop.label)) - box / 2 + 0.1 for loop in loops)])
    width = max(float(places[:, 0].max()) * step + box, (len(title) + 4) * LETTER) + lead + MARGIN + 0.3
    caption = wrap_text(caption, int((width - 2 * MARGIN) / (0.9 * LETTER)))
    deepest = max((len(arrow.label) for arrow in arrows), default=1)
    top = MARGIN + LOOP + (deepest - 1) * LINE / 2 + (0.3 if title else 0.0)
    bottom = MARGIN + (0.1 + LINE * (caption.count("\n") + 1) if caption else 0.0)
    height = (float(heights.max()) - low) * ROW + BOX + top + bottom

    def on_paper(points: Array) -> Array:
        """From layers and heights to inches; the first of a layer is on top."""
        x = lead + box / 2 + points[:, 0] * step
        y = height - top - BOX / 2 - (points[:, 1] - low) * ROW
        return np.stack([x, y], axis=1)

    centres = on_paper(places)
    ports = _ports(arrows, centres, [on_paper(way) for way in ways])
    paths = [_path(on_paper(way), box, *ends) for way, ends in zip(ways, ports, strict=True)]
    lines = [_points(path) for path in paths]
    right = [
        line[:, 0].max() + HALF * max(map(len, arrow.label))
        for line, arrow in zip(lines, arrows, strict=True)
    ]
    width = max([width, *(float(x) + MARGIN for x in right)])
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.axis("off")
    boxes = [_paint(axes, node, centre, box) for node, centre in zip(nodes, centres, strict=True)]
    words: list[Rectangle] = []
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
        words.append(_label(axes, arrow, lines[number], boxes, words, others))
    if title:
        axes.text(width / 2, height - MARGIN, title, ha="center", va="center", fontsize=11)
    if caption:
        axes.text(MARGIN, MARGIN, caption, ha="left", va="bottom", fontsize=8.5, color=MUTED)
    return figure


def _paint(axes: Axes, node: Node, centre: Array, width: float) -> Rectangle:
    """The box of a node; returned is the room it takes."""
    x, y = centre.tolist()
    shape = FancyBboxPatch(
        (x - width / 2, y - BOX / 2),
        width,
        BOX,
        boxstyle="round,pad=0,rounding_size=0.08",
        facecolor=node.fill.colour,
        hatch=node.fill.hatch,
        edgecolor=INK,
        linewidth=2.4 if node.first else 0.9,
        linestyle="--" if node.cut else "-",
        zorder=3,
    )
    axes.add_patch(shape)
    ground = {"facecolor": node.fill.colour, "linewidth": 0, "pad": 1.5} if node.fill.hatch else None
    words = axes.text(x, y, node.words, ha="center", va="center", fontsize=9, color=node.fill.text_colour)
    words.set(bbox=ground, zorder=4)
    return Rectangle(x - width / 2, y - BOX / 2, x + width / 2, y + BOX / 2)


def _ports(arrows: Sequence[Arrow], centres: Array, ways: Sequence[Array]) -> list[tuple[float, float]]:
    """How far above the middle of its side each arrow leaves and arrives, so that none hides another."""
    sides: dict[tuple[int, int], list[tuple[float, int, int]]] = {}
    for number, (arrow, way) in enumerate(zip(arrows, ways, strict=True)):
        for end, node, near in ((0, arrow.source, way[1]), (1, arrow.target, way[-2])):
            if arrow.source != arrow.target:
                side = 1 if near[0] >= centres[node, 0] else -1
                sides.setdefault((node, side), []).append((float(near[1]), number, end))
    ports = [[0.0, 0.0] for _ in arrows]
    for ends in sides.values():
        room = 0.7 * BOX * min(1.0, (len(ends) - 1) / 3)
        for (_, number, end), up in zip(
            sorted(ends), np.linspace(-room / 2, room / 2, len(ends)), strict=True
        ):
            ports[number][end] = float(up)
    return [(leaves, arrives) for leaves, arrives in ports]


def _path(way: Array, box: float, leaves: float, arrives: float) -> Path:
    """Curves from the side of a box to that of another, level where they pass a layer."""
    (x, y), (u, v) = way[0], way[-1]
    half, top = box / 2, BOX / 2
    if len(way) == 2 and x == u and y == v:  # to itself: a loop on top
        right, left = (x + 0.32 * half, y + top), (x - 0.32 * half, y + top)
        lift = LOOP + 0.1  # a curve stays below its control points
        return Path([right, (right[0] + 0.1, right[1] + lift), (left[0] - 0.1, left[1] + lift), left], _CURVE)
    if x == u:  # within a layer: out to the right and back
        out = 0.45 + 0.06 * abs(y - v)
        begin, end = (x + half, y + leaves), (u + half, v + arrives)
        return Path([begin, (begin[0] + out, begin[1]), (end[0] + out, end[1]), end], _CURVE)
    ahead = 1 if u > x else -1
    points = [(x + ahead * half, y + leaves)]
    for passed in way[1:-1]:
        points += [(passed[0] - ahead * half, passed[1]), (passed[0] + ahead * half, passed[1])]
    points.append((u - ahead * half, v + arrives))
    vertices, codes = [points[0]], [Path.MOVETO]
    for number, ((a, b), (c, d)) in enumerate(pairwise(points)):
        if number % 2:  # along a box of the layer that is passed
            vertices.append((c, d))
            codes.append(Path.LINETO)
        else:
            vertices += [((a + c) / 2, b), ((a + c) / 2, d), (c, d)]
            codes += [Path.CURVE4] * 3
    return Path(vertices, codes)


_CURVE = [Path.MOVETO, Path.CURVE4, Path.CURVE4, Path.CURVE4]


def _points(path: Path) -> Array:
    """(m, 2) points on a path, `PIECE` apart."""
    corners = np.asarray(path.to_polygons(closed_only=False)[0], dtype=np.float64)
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    steps = np.linspace(0, run[-1], max(2, int(run[-1] / PIECE)))
    points: Array = np.stack([np.interp(steps, run, corners[:, i]) for i in (0, 1)], axis=1)
    return points


def _label(
    axes: Axes,
    arrow: Arrow,
    line: Array,
    boxes: Sequence[Rectangle],
    words: Sequence[Rectangle],
    others: Array,
) -> Rectangle:
    """The words of an arrow where they hide least of boxes, words and other lines; returned is their room."""
    width = 2 * HALF * max(map(len, arrow.label))
    height = len(arrow.label) * LINE
    found: list[tuple[float, int, Rectangle]] = []
    for rank, share in enumerate(ALONG):
        x, y = line[round(share * (len(line) - 1))].tolist()
        room = Rectangle(x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        hidden = sum(map(room.overlap, words)) + HIDDEN_BOX * sum(map(room.overlap, boxes))
        crossed = ((others > room[:2]) & (others < room[2:])).all(axis=1).sum()
        found.append((hidden + CROSSED * float(crossed), rank, room))
    room = min(found)[2]
    axes.text(
        (room.left + room.right) / 2,
        (room.bottom + room.top) / 2,
        "\n".join(arrow.label),
        ha="center",
        va="center",
        fontsize=7.5,
        color=INK,
        linespacing=1.05,
        bbox={"facecolor": "white", "alpha": 0.85, "linewidth": 0, "pad": 0.8},
        zorder=5,
    )
    return room
