"""Figure of a policy graph: actions as nodes, observations as arrows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from lcorpp.errors import ModelError
from lcorpp.planning.evaluation.policy_graph import PolicyGraph
from lcorpp.planning.plots.graph_drawing import Arrow, Box, draw
from lcorpp.plot_style import COLOURS, INK, MUTED, Fill, with_style

MAX_NODES, MAX_ARROWS = 30, 60
"""Default limits of a readable figure."""

CONTINUATION = 0.95
"""Probability to continue after each step, for the expected visits of nodes."""

VISIT_STEPS = 200
"""Number of steps for the expected visits."""

MAX_LABEL_LINES = 2
"""An arrow's label names at most this many observations and sums up the others."""

ARROW_COLOURS = tuple(
    INK if colour == COLOURS[4] else colour for colour in COLOURS
)  # yellow is invisible on white
LINE_STYLES = ("-", "--", ":", "-.")


@with_style
def draw_graph(
    graph: PolicyGraph, *, nodes: int = MAX_NODES, arrows: int = MAX_ARROWS, title: str = ""
) -> Figure:
    """Draw a policy graph in layers by the nodes' depth, from left to right.

    A box shows an action; the first one has a strong frame. An arrow is labelled with its observations and
    their probabilities, and is thicker for likelier ones. Of a graph with more nodes or arrows than the
    limits, the most visited ones are drawn; a caption states this, and nodes with missing arrows have a
    dashed frame.

    Raises:
        ModelError: `nodes` is below 1 or `arrows` below 0.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import draw_graph, policy_graph
        >>> pomdp = load_domain("intention").pomdp
        >>> figure = draw_graph(policy_graph(pomdp, solve(pomdp).policy), title="intention")
        >>> [text.get_text() for text in figure.axes[0].texts if "report" in text.get_text()]
        ['report_interested', 'report_not_interested']
    """
    if nodes < 1 or arrows < 0:
        raise ModelError(f"a figure needs at least 1 node, not {nodes}, and at least 0 arrows, not {arrows}")
    all_arrows = graph.edges_by_nodes()
    selected, drawn_arrows = _select_most_visited(graph, list(all_arrows), nodes, arrows)
    number = {node: place for place, node in enumerate(selected)}
    missing = {source for source, _ in all_arrows.keys() - set(drawn_arrows)}
    boxes = [
        Box(
            graph.action_names[graph.actions[node]],
            Fill.of(int(graph.actions[node])),
            int(graph.depths[node]),
            first=node == 0,
            cut=node in missing or not graph.complete[node],
        )
        for node in selected
    ]
    lines = [
        _make_arrow(graph, number[source], number[target], all_arrows[source, target])
        for source, target in drawn_arrows
    ]
    caption = []
    if len(selected) < len(graph) or len(lines) < len(all_arrows):
        caption.append(
            f"the most visited {len(selected)} of {len(graph)} nodes"
            f" and {len(lines)} of {len(all_arrows)} arrows"
        )
    if any(box.cut for box in boxes):
        caption.append("nodes with a dashed frame have more arrows")
    return draw(boxes, lines, title=title, caption="; ".join(caption))


def _select_most_visited(
    graph: PolicyGraph, arrows: Sequence[tuple[int, int]], max_nodes: int, max_arrows: int
) -> tuple[list[int], list[tuple[int, int]]]:
    """Return the connected nodes and arrows that result from adding the most frequent arrow repeatedly."""
    if len(graph) <= max_nodes and len(arrows) <= max_arrows:
        return list(range(len(graph))), list(arrows)
    visits = np.zeros(len(graph))
    current = np.eye(1, len(graph))[0]
    for _ in range(VISIT_STEPS):
        visits += current
        moved = CONTINUATION * current[graph.sources] * graph.probabilities
        current = np.bincount(graph.targets, moved, minlength=len(graph))
    flow = dict.fromkeys(arrows, 0.0)
    for edge, ends in enumerate(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True)):
        flow[ends] += float(visits[ends[0]] * graph.probabilities[edge])
    nodes, selected = {0}, list[tuple[int, int]]()
    waiting = sorted(arrows, key=lambda ends: -flow[ends])
    while len(selected) < max_arrows:
        candidates = (
            ends for ends in waiting if ends[0] in nodes and (ends[1] in nodes or len(nodes) < max_nodes)
        )
        taken = next(candidates, None)
        if taken is None:
            break
        waiting.remove(taken)
        nodes.add(taken[1])
        selected.append(taken)
    return sorted(nodes), sorted(selected)


def _make_arrow(graph: PolicyGraph, source: int, target: int, edges: Sequence[int]) -> Arrow:
    """Return all edges from one node to another as one arrow between two boxes."""
    node, label = graph.sources[edges[0]], _label_lines(graph, edges)
    width = 0.8 + 1.6 * float(graph.probabilities[edges].sum())
    if len(edges) > 1:
        covers_all = graph.complete[node] and len(edges) == np.count_nonzero(graph.sources == node)
        return Arrow(source, target, ["any"] if covers_all else label, MUTED, "-", width)
    row, column = divmod(int(graph.observations[edges[0]]), len(ARROW_COLOURS))
    style = LINE_STYLES[row % len(LINE_STYLES)]
    return Arrow(source, target, label, ARROW_COLOURS[column], style, width)


def _label_lines(graph: PolicyGraph, edges: Sequence[int]) -> list[str]:
    """Return a line for each observation with its probability, the likeliest first."""
    likely = sorted(edges, key=lambda edge: -graph.probabilities[edge])
    lines = []
    for edge in likely[:MAX_LABEL_LINES] if len(likely) > MAX_LABEL_LINES + 1 else likely:
        name, probability = graph.observation_names[graph.observations[edge]], graph.probabilities[edge]
        lines.append(name if probability > 0.9995 else f"{name}: {probability:.2g}")
    rest = likely[len(lines) :]
    if rest:
        lines.append(f"{len(rest)} others: {graph.probabilities[rest].sum():.2g}")
    return lines
