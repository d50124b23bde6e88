"""A policy as a graph: what is done first, and what after each observation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from lcorpp.errors import ModelError
from lcorpp.planning.plots.graph_drawing import Arrow, Node, draw
from lcorpp.plot_style import COLOURS, INK, MUTED, Fill, with_style

if TYPE_CHECKING:
    from lcorpp.planning.evaluation.policy_graph import PolicyGraph

MOST_NODES, MOST_ARROWS = 30, 60
"""More than these are not read any longer."""

STAYING = 0.95
"""Chance to go on after each step, where it is worked out which nodes are met most."""

PASSES = 200
"""Steps for which that is followed."""

MOST_LINES = 2
"""Observations named at one arrow; of more, the others are added up."""

LINES = tuple(INK if colour == COLOURS[4] else colour for colour in COLOURS)  # yellow is lost on white
STYLES = ("-", "--", ":", "-.")


@with_style
def draw_graph(
    graph: PolicyGraph, *, nodes: int = MOST_NODES, arrows: int = MOST_ARROWS, title: str = ""
) -> Figure:
    """A policy graph in layers by the fewest steps to each node, from left to right.

    A box is an action, the one with the strong frame is the first. An arrow leads from it by observation,
    with the probability there; the thicker, the likelier. Of a graph with more nodes or arrows than are asked
    for those are shown that are met most; the picture says so, and a dashed frame tells whose arrows are
    missing.

    Raises:
        ModelError: `nodes` is below 1 or `arrows` below 0.
    """
    if nodes < 1 or arrows < 0:
        raise ModelError(f"a picture has at least one node, not {nodes}, and no fewer arrows than 0")
    all_arrows = graph.edges_by_nodes()
    kept, drawn_arrows = _most_met(graph, list(all_arrows), nodes, arrows)
    number = {node: place for place, node in enumerate(kept)}
    missing = {source for source, _ in all_arrows.keys() - set(drawn_arrows)}
    boxes = [
        Node(
            graph.action_names[graph.actions[node]],
            Fill.of(int(graph.actions[node])),
            int(graph.depths[node]),
            first=node == 0,
            cut=node in missing or not graph.complete[node],
        )
        for node in kept
    ]
    lines = [
        _arrow(
            graph, number[source], number[target], all_arrows[source, target], bool(graph.complete[source])
        )
        for source, target in drawn_arrows
    ]
    caption = []
    if len(kept) < len(graph) or len(lines) < len(all_arrows):
        caption.append(
            f"{len(kept)} of {len(graph)} nodes and {len(lines)} of {len(all_arrows)} arrows, those met most"
        )
    if any(box.cut for box in boxes):
        caption.append("a dashed frame has more arrows than are shown")
    return draw(boxes, lines, title=title, caption="; ".join(caption))


def _most_met(
    graph: PolicyGraph, arrows: Sequence[tuple[int, int]], max_nodes: int, most_arrows: int
) -> tuple[list[int], list[tuple[int, int]]]:
    """Nodes and arrows that hang together from the start on, each time the arrow that is taken most."""
    if len(graph) <= max_nodes and len(arrows) <= most_arrows:
        return list(range(len(graph))), list(arrows)
    met = np.zeros(len(graph))
    now = np.eye(1, len(graph))[0]
    for _ in range(PASSES):
        met += now
        moved = STAYING * now[graph.sources] * graph.probabilities
        now = np.bincount(graph.targets, moved, minlength=len(graph))
    flow = dict.fromkeys(arrows, 0.0)
    for edge, ends in enumerate(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True)):
        flow[ends] += float(met[ends[0]] * graph.probabilities[edge])
    nodes, kept = {0}, list[tuple[int, int]]()
    waiting = sorted(arrows, key=lambda ends: -flow[ends])
    while len(kept) < most_arrows:
        open_ones = (
            ends for ends in waiting if ends[0] in nodes and (ends[1] in nodes or len(nodes) < max_nodes)
        )
        taken = next(open_ones, None)
        if taken is None:
            break
        waiting.remove(taken)
        nodes.add(taken[1])
        kept.append(taken)
    return sorted(nodes), sorted(kept)


def _arrow(graph: PolicyGraph, source: int, target: int, edges: Sequence[int], whole: bool) -> Arrow:
    """The edges from one node to another as one arrow between two boxes."""
    total = float(graph.probabilities[edges].sum())
    width = 0.8 + 1.6 * total
    if len(edges) > 1:
        all_lead_here = whole and len(edges) == np.count_nonzero(graph.sources == graph.sources[edges[0]])
        return Arrow(source, target, ["any"] if all_lead_here else _listed(graph, edges), MUTED, "-", width)
    number = int(graph.observations[edges[0]])
    style = STYLES[number // len(LINES) % len(STYLES)]
    return Arrow(source, target, _listed(graph, edges), LINES[number % len(LINES)], style, width)


def _listed(graph: PolicyGraph, edges: Sequence[int]) -> list[str]:
    """A line for each observation with its probability, the likeliest first."""
    likely = sorted(edges, key=lambda edge: -graph.probabilities[edge])
    lines = []
    for edge in likely[:MOST_LINES] if len(likely) > MOST_LINES + 1 else likely:
        name, chance = graph.observation_names[graph.observations[edge]], graph.probabilities[edge]
        lines.append(name if chance > 0.9995 else f"{name}: {chance:.2g}")
    rest = likely[len(lines) :]
    if rest:
        lines.append(f"{len(rest)} others: {graph.probabilities[rest].sum():.2g}")
    return lines
