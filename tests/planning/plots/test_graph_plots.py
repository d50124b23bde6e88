"""Figures of policy graphs: positions and routes without overlap, and complete texts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from lcorpp.errors import ModelError
from lcorpp.planning import Policy, draw_graph, parse_pomdp, read_pomdp, solve
from lcorpp.planning.evaluation.policy_graph import policy_graph
from lcorpp.planning.plots.graph_layout import DUMMY_SIZE, layout_graph
from tests.planning.models import LCORPP, TIGER, shared_model
from tests.planning.plots.test_belief_plots import shown


@st.composite
def graphs(draw: st.DrawFn) -> tuple[list[int], list[tuple[int, int]]]:
    """Draw nodes with depths, and arrows that may go back, within a layer or to the same node."""
    depths = [0]
    arrows = []
    for node in range(1, draw(st.integers(1, 12))):
        parent = draw(st.integers(0, node - 1))
        depths.append(depths[parent] + 1)
        arrows.append((parent, node))
    ends = st.integers(0, len(depths) - 1)
    arrows += draw(st.lists(st.tuples(ends, ends), max_size=8))
    return depths, list(dict.fromkeys(arrows))


@settings(max_examples=20)
@given(graphs())
def test_nodes_do_not_overlap(graph):
    depths, arrows = graph
    positions, routes = layout_graph(*graph)
    assert positions[:, 0].tolist() == depths
    for node, (layer, height) in enumerate(positions):
        others = positions[(positions[:, 0] == layer) & (np.arange(len(positions)) != node)]
        assert (np.abs(others[:, 1] - height) > 1 - 1e-9).all()
        # routes across the layer
        inner = np.concatenate([np.zeros((0, 2)), *(route[1:-1] for route in routes)])
        passing = inner[inner[:, 0] == layer]
        assert (np.abs(passing[:, 1] - height) > (1 + DUMMY_SIZE) / 2 - 1e-9).all()
    for (source, target), route in zip(arrows, routes, strict=True):
        assert route[0].tolist() == positions[source].tolist()
        assert route[-1].tolist() == positions[target].tolist()
        step = np.sign(depths[target] - depths[source])
        assert (np.diff(route[:, 0]) == step).all()


def test_avoidable_crossings_are_avoided():
    """Two parallel chains in crossed order, and a tree."""
    positions, _ = layout_graph([0, 0, 1, 1, 2, 2], [(0, 3), (1, 2), (3, 4), (2, 5)])
    above = positions[:, 1]
    assert (above[0] < above[1]) == (above[3] < above[2]) == (above[4] < above[5])
    assert above[0] == pytest.approx(above[3]) == pytest.approx(above[4])  # and straight
    depths = [0, 1, 1, 2, 2, 2, 2]
    arrows = [(0, 1), (0, 2), (1, 4), (1, 6), (2, 3), (2, 5)]
    above = layout_graph(depths, arrows).positions[:, 1]
    first, second = sorted((1, 2), key=above.__getitem__)
    children = {1: (4, 6), 2: (3, 5)}
    assert max(above[list(children[first])]) < min(above[list(children[second])])
    assert above[0] == pytest.approx(above[[3, 4, 5, 6]].mean())  # a parent is centred on its children


def test_the_tigers_graph():
    """A hand-made policy: listen until one side was heard once more often, then open the other door."""
    pomdp = parse_pomdp(TIGER)
    vectors = [[0.0, 0.0], [-0.5, 0.2], [0.2, -0.5]]
    actions = [pomdp.action_index(name) for name in ("listen", "open-left", "open-right")]
    graph = policy_graph(pomdp, Policy.of(pomdp, vectors, actions))
    assert len(graph) == 3
    figure = draw_graph(graph, title="the tiger")
    words = shown(figure)
    actions_and_arrows = [
        "listen",
        "open-left",
        "open-right",
        "tiger-left: 0.5",
        "tiger-right: 0.5",
        "any",
        "any",
    ]
    assert sorted(words) == sorted(["the tiger", *actions_and_arrows])
    boxes = [patch for patch in figure.axes[0].patches if isinstance(patch, FancyBboxPatch)]
    assert [box.get_linewidth() > 2 for box in boxes] == [True, False, False]
    assert {box.get_linestyle() for box in boxes} == {"-"}


def test_certain_observations_need_no_number():
    pomdp = parse_pomdp(LCORPP)
    graph = policy_graph(pomdp, solve(pomdp).policy, [0, 0, 0, 0, 1])
    words = shown(draw_graph(graph))
    assert [word for word in words if "none" in word] == ["none"]


def test_large_graphs_show_the_most_visited_nodes():
    pomdp = read_pomdp(shared_model("4x3.95.pomdp"))
    graph = policy_graph(pomdp, solve(pomdp).policy)
    assert len(graph) > 12
    figure = draw_graph(graph, nodes=12, arrows=20)
    patches = figure.axes[0].patches
    boxes = [patch for patch in patches if isinstance(patch, FancyBboxPatch)]
    assert len(boxes) == 12
    assert sum(isinstance(patch, FancyArrowPatch) for patch in patches) == 20
    words = " ".join(shown(figure)).replace("\n", " ")
    assert (
        f"the most visited 12 of {len(graph)} nodes and 20 of {len(graph.edges_by_nodes())} arrows" in words
    )
    assert "nodes with a dashed frame have more arrows" in words
    assert "--" in {box.get_linestyle() for box in boxes}
    with pytest.raises(ModelError, match="at least 1 node"):
        draw_graph(graph, nodes=0)
    assert "1 of" in " ".join(shown(draw_graph(graph, nodes=1, arrows=0)))


@pytest.mark.parametrize("name", ["cheese.95.pomdp", "light_maze.POMDP", "shuttle.95.pomdp"])
def test_all_text_of_a_graph_lies_inside_the_figure(name):
    pomdp = read_pomdp(shared_model(name))
    graph = policy_graph(pomdp, solve(pomdp, time_limit=0.5).policy)
    words = shown(draw_graph(graph, title=name))
    assert name in words
    assert len(words) > min(len(graph), 30)
