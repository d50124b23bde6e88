"""Figures of policies: they agree with the policy, are complete and use distinct colours."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from lcorpp.errors import ModelError
from lcorpp.planning import (
    AlphaVectors,
    BatchPolicy,
    Policy,
    Pomdp,
    draw_bounds,
    draw_line,
    draw_triangle,
    parse_pomdp,
    solve,
)
from lcorpp.planning.plots.belief_regions import BeliefSlice, area, grid, slice_policy
from lcorpp.plot_style import Fill
from tests.planning.models import LCORPP, TIGER, shared_model

TURNED = ("interested_turned", "not_interested_turned", "term")


@pytest.fixture(scope="module")
def authors():
    pomdp = parse_pomdp(LCORPP, file="lcorpp.pomdp")
    return pomdp, solve(pomdp)


@pytest.fixture(scope="module")
def tiger():
    pomdp = parse_pomdp(TIGER, file="tiger.pomdp")
    return pomdp, solve(pomdp)


def model(S: int, A: int = 3) -> Pomdp:
    """Return a problem of which only the names matter."""
    return Pomdp(
        tuple(f"s{i}" for i in range(S)),
        tuple(f"a{i}" for i in range(A)),
        ("o",),
        np.full((A, S, S), 1 / S),
        np.ones((A, S, 1)),
        np.zeros((A, S)),
        0.9,
        np.full(S, 1 / S),
    )


@st.composite
def policies(draw: st.DrawFn) -> tuple[Pomdp, Policy]:
    """Draw policies over four states, including equal, parallel and dominated vectors."""
    rows = draw(st.lists(st.lists(st.integers(-3, 3), min_size=4, max_size=4), min_size=1, max_size=12))
    pomdp = model(4)
    actions = draw(st.lists(st.integers(0, 2), min_size=len(rows), max_size=len(rows)))
    return pomdp, Policy.of(pomdp, rows, actions)


@given(policies())
def test_a_line_agrees_with_the_policy(drawn):
    pomdp, policy = drawn
    line = slice_policy(pomdp, policy, ["s2", "s0"])
    regions = line.regions()
    ends = [region.points[:, 1] for region in regions]
    assert ends[0][0] == 0
    assert ends[-1][1] == 1
    for (_, end), (begin, _) in pairwise(ends):
        assert end == begin
    for region in regions:
        middle = line.belief(region.points.mean(axis=0))
        assert policy.action(middle) == region.action
        assert policy.value(middle) == pytest.approx(line.values[region.vector] @ region.points.mean(axis=0))


@given(policies())
def test_a_triangle_agrees_with_the_policy(drawn):
    pomdp, policy = drawn
    triangle = slice_policy(pomdp, policy, ["s3", "s0", "s1"])
    regions = triangle.regions()
    assert sum(area(region.points) for region in regions) == pytest.approx(1)
    for region in regions:
        middle = region.points.mean(axis=0)
        best = policy.value(triangle.belief(middle))
        assert best == pytest.approx(triangle.values[region.vector] @ middle)
        assert policy.action(triangle.belief(middle)) == region.action
    values, _ = BatchPolicy(policy).values_and_actions(grid(7) @ triangle.corners)
    assert triangle.value(grid(7)) == pytest.approx(values)


def test_listening_is_best_between_two_beliefs(tiger):
    """The first and the last region open a door; by symmetry both are equally wide."""
    pomdp, solution = tiger
    regions = slice_policy(pomdp, solution.policy, pomdp.states).regions()
    names = [pomdp.actions[region.action] for region in regions]
    assert names[0] == "open-right"  # the tiger is at the left
    assert names[-1] == "open-left"
    assert set(names[1:-1]) == {"listen"}
    left, right = regions[0].points[1, 1], 1 - regions[-1].points[0, 1]
    # listening and opening have equal value there; computed independently
    assert left == pytest.approx(right, abs=1e-3)
    assert 0.02 < left < 0.06


def test_other_states_keep_their_probabilities(authors):
    pomdp, solution = authors
    base = np.array([0.1, 0.2, 0.3, 0.3, 0.1])
    line = slice_policy(pomdp, solution.policy, TURNED[:2], base)
    assert line.share == pytest.approx(0.6)
    assert line.corners.tolist() == [
        [0.1, 0.2, pytest.approx(0.6), 0, 0.1],
        [0.1, 0.2, 0, pytest.approx(0.6), 0.1],
    ]
    assert line.value(np.array([[0.5, 0.5]])) == pytest.approx(solution.policy.value(base))
    with pytest.raises(
        ModelError, match="gives no probability to interested_turned or not_interested_turned"
    ):
        slice_policy(pomdp, solution.policy, TURNED[:2], [0.5, 0.5, 0, 0, 0])
    with pytest.raises(ModelError, match="sums to 2"):
        slice_policy(pomdp, solution.policy, TURNED[:2], [1, 1, 0, 0, 0])


def test_only_covering_vector_sets_are_drawn():
    pomdp = model(5)
    pieces = [
        AlphaVectors(np.array([0, 1, 2]), np.array([[1.0, 0, 0], [0, 1, 0]]), np.array([0, 1])),
        AlphaVectors(np.array([2, 3, 4]), np.array([[9.0, 9, 9]]), np.array([2])),
    ]
    policy = Policy.of_sets(pomdp, pieces)
    inside = slice_policy(pomdp, policy, ["s0", "s1"])
    assert [region.action for region in inside.regions()] == [0, 1]
    across = slice_policy(pomdp, policy, ["s1", "s3"])
    for right in (0.2, 0.5, 0.8):
        weights = np.array([1 - right, right])
        assert across.value(weights[None])[0] == pytest.approx(policy.value(across.belief(weights)))


@pytest.mark.parametrize(
    ("states", "words"),
    [
        (["s0"], "two or three states, not 1"),
        (["s0", "s1", "s2", "s3"], "two or three states, not 4"),
        (["s0", "s0"], "differ"),
        (["s0", "s9"], "unknown state 's9'; expected one of s0, s1"),
    ],
)
def test_invalid_states_of_a_figure(states, words):
    pomdp = model(4)
    with pytest.raises(ModelError, match=words):
        slice_policy(pomdp, Policy.of(pomdp, [[1, 2, 3, 4]], [0]), states)


def shown(figure: Figure) -> list[str]:
    """Return the texts of a figure; check that all are inside of it."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    axis_labels = set()  # labels beyond the end of an axis exist but are not drawn
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            axis_labels |= {*axis.get_ticklabels(which="both")}
    words = []
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text().strip() and text not in axis_labels:
            box = text.get_window_extent(canvas.get_renderer())
            assert figure.bbox.padded(1).count_contains(box.get_points()) == 2, text
            words.append(text.get_text())
    return words


def test_a_line_names_all_actions_and_the_gap(authors):
    pomdp, solution = authors
    words = shown(draw_line(pomdp, solution.policy, TURNED[:2], title="lcorpp.pomdp"))
    actions = {pomdp.actions[r.action] for r in slice_policy(pomdp, solution.policy, TURNED[:2]).regions()}
    assert len(actions) >= 4
    assert actions <= set(words)
    assert {"upper bound", "lcorpp.pomdp", "P(not_interested_turned); the rest is interested_turned"} <= set(
        words
    )
    assert any(word.startswith("largest gap ") for word in words)
    assert "upper bound" not in shown(draw_line(pomdp, solution.policy, TURNED[:2], bound=False))
    assert "upper bound" not in shown(draw_line(pomdp, replace_bound(solution.policy), TURNED[:2]))


def replace_bound(policy: Policy) -> Policy:
    """Return the same policy without its upper bound, as read from a file."""
    return Policy(policy.vector_sets, policy.state_names, policy.action_names)


def test_a_triangle_names_actions_and_corners(authors):
    pomdp, solution = authors
    words = shown(draw_triangle(pomdp, solution.policy, TURNED))
    for name in TURNED:
        assert words.count(name) == 2  # once more in the gap's triangle
    shares = {word.rpartition(" (")[0] for word in words if word.endswith("%)")}
    assert shares == {pomdp.actions[r.action] for r in slice_policy(pomdp, solution.policy, TURNED).regions()}
    words = shown(draw_triangle(pomdp, solution.policy, TURNED, bound=False, base=pomdp.start))
    assert words.count("term") == 1
    assert "the other states keep 0.4 in all" in words


def test_many_actions_are_distinguishable():
    """20 actions, each best somewhere, have distinct fills."""
    right = np.linspace(0, 1, 20)
    pomdp = model(2, A=20)
    policy = Policy.of(pomdp, np.stack([-(right**2), 2 * right - right**2], axis=1), np.arange(20))
    regions = slice_policy(pomdp, policy, pomdp.states).regions()
    assert [region.action for region in regions] == list(range(20))
    assert len({Fill.of(region.action) for region in regions}) == 20
    assert set(pomdp.actions) <= set(shown(draw_line(pomdp, policy, pomdp.states)))


def test_bounds_over_time_show_the_last_gap(authors):
    _, solution = authors
    figure = draw_bounds(solution.history, title="lcorpp.pomdp")
    words = shown(figure)
    assert f"gap {solution.upper - solution.lower:.3g}" in words
    assert {"upper bound", "lower bound: the policy", "vectors", "milliseconds"} <= set(words)
    above = figure.axes[0]
    upper, lower = (line.get_ydata() for line in above.lines)
    assert (upper[-1], lower[-1]) == (solution.upper, solution.lower)
    assert (upper >= lower).all()
    assert len(upper) == len(solution.history) + 1


@pytest.mark.parametrize("last", [0.5, 3.0, 500.0])
def test_long_searches_have_a_log_scale(last):
    history = [(0.0, 0.0, 9.0, 1), (0.2, 1.0, 8.0, 4), (last, 2.0, 7.0, 9)]
    axes = draw_bounds(history).axes[1]
    assert axes.get_xscale() == ("linear" if last == 0.5 else "log")
    assert axes.get_xlabel() == "seconds"
    assert axes.get_xlim()[1] > last


def test_a_history_needs_an_entry():
    assert "gap 0" in shown(draw_bounds([(0.0, 1.0, 1.0, 1)]))
    with pytest.raises(ModelError, match="no history"):
        draw_bounds([])


def test_planning_loads_no_matplotlib():
    code = "import lcorpp.planning, sys; print('matplotlib' in sys.modules, 'scipy' in sys.modules)"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["False", "False"]


def test_large_models_are_drawn_without_dense_tables():
    """870 states: a figure reads the columns of its own states only."""
    from lcorpp.planning import read_pomdp

    pomdp = read_pomdp(shared_model("tag-avoid.pomdp"))
    solution = solve(pomdp, time_limit=0.3)
    support = [pomdp.states[s] for s in np.flatnonzero(pomdp.start)[:3]]
    triangle = slice_policy(pomdp, solution.policy, support, pomdp.start)
    assert isinstance(triangle, BeliefSlice)
    weights = grid(3)
    expected = [solution.policy.value(triangle.belief(weight)) for weight in weights]
    assert triangle.value(weights) == pytest.approx(np.array(expected))
