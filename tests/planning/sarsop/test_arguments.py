"""The kernels reject invalid arguments and never read beyond an array."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lcorpp.planning import _native, parse_pomdp
from lcorpp.planning.sarsop.kernel_model import build_model
from tests.planning.models import TIGER
from tests.planning.sarsop.kernels import bounds

i4, i8, nan, inf = np.int32, np.int64, np.nan, np.inf

GOOD: dict[str, Any] = {
    "actions": 2,
    "states": 2,
    "observations": 2,
    "transition_begins": np.array([0, 1, 2, 4, 6], i8),
    "transition_columns": np.array([0, 1, 0, 1, 0, 1], i4),
    "transition_values": np.array([1, 1, 0.5, 0.5, 0.5, 0.5]),
    "observation_begins": np.array([0, 2, 4, 6, 8], i8),
    "observation_columns": np.array([0, 1] * 4, i4),
    "observation_values": np.array([0.85, 0.15, 0.15, 0.85, 0.5, 0.5, 0.5, 0.5]),
    "reward": np.array([[-1.0, -1], [-10, 5]]),
    "discount": 0.9,
}

BAD_MODELS: list[dict[str, Any]] = [
    *({"actions": count} for count in (0, -1, 1, 3, 2**31 - 1)),
    *({"states": count} for count in (0, -1, 3, 2**31 - 1)),
    *({"observations": count} for count in (0, -1, 1)),
    *(
        {"transition_begins": np.array(begins, i8)}
        for begins in ([0, 1, 2, 4], [0, 4, 2, 4, 6], [1, 1, 2, 4, 6])
    ),
    *(
        {"transition_begins": np.array(begins, i8)}
        for begins in ([0, 1, 2**40, 4, 6], [0, -1, 2, 4, 6], [0, 0, 2, 4, 6])
    ),
    {"transition_begins": np.zeros(0, i8)},
    {"transition_begins": np.array([[0, 1, 2, 4, 6]], i8)},
    *({"transition_columns": np.array([0, 1, 0, c, 0, 1], i4)} for c in (2, -1, 0)),
    {"transition_columns": np.array([0, 1, 1, 0, 0, 1], i4)},
    {"transition_columns": np.array([0, 1, 0, 1, 0], i4)},
    *({"transition_values": np.array([1, 1, p, 0.5, 0.5, 0.5])} for p in (nan, inf, -0.5, 0.4, 1.5)),
    {"transition_values": np.array([1, 1, 1.5, -0.5, 0.5, 0.5])},
    *({"observation_columns": np.array([0, c, 0, 1, 0, 1, 0, 1], i4)} for c in (2, -1, 0)),
    {"observation_values": np.array([nan, 0.15, 0.15, 0.85, 0.5, 0.5, 0.5, 0.5])},
    {"observation_values": np.array([0.15, 0.15, 0.15, 0.85, 0.5, 0.5, 0.5, 0.5])},
    {"observation_begins": np.array([0, 2, 4, 6], i8)},
    *({"reward": np.array([[r, -1], [-10, 5]])} for r in (nan, inf, -inf)),
    *({"reward": np.zeros(shape)} for shape in ((2, 3), (4, 1), (1, 4))),
    *({"discount": discount} for discount in (1.0, -0.5, nan, inf)),
    # the smallest arguments with consistent sizes
    {
        "actions": -1,
        "states": 1,
        "observations": 1,
        **{
            name: np.zeros(0, GOOD[name].dtype)
            for name in ("transition_begins", "transition_columns", "transition_values")
        },
        **{
            name: np.zeros(0, GOOD[name].dtype)
            for name in ("observation_begins", "observation_columns", "observation_values")
        },
        "reward": np.zeros((0, 0)),
    },
]


@pytest.mark.parametrize("change", BAD_MODELS, ids=lambda change: " ".join(map(str, change.items()))[:60])
def test_invalid_models(change):
    assert _native.Model(*GOOD.values()).export_blocks().tolist() == [0, 0]
    with pytest.raises((ValueError, TypeError)):  # TypeError for a different number of axes
        _native.Model(*(GOOD | change).values())


def make_small_tree() -> Any:
    """A tree of the tiger problem with one node and one expanded action."""
    model = build_model(parse_pomdp(TIGER))
    blind, _, informed = bounds(model, 1e-3)
    tree = _native.Tree(model, informed, blind)
    assert tree.select_action(tree.find_or_add_node(np.array([0.5, 0.5])), False) == 0
    return tree


def make_predictor() -> Any:
    return _native.ValuePredictor(np.array([0.0, 1.0]))


def vectors(*rows: list[float]) -> Any:
    return np.array(rows)


HALVES = np.array([0.5, 0.5])
TWO = np.array([0, 1], i4)

OUT_OF_RANGE: list[tuple[str, tuple[Any, ...]]] = [
    *(
        (name, (node,))
        for name in (
            "refresh",
            "backup",
            "lower_bound",
            "upper_bound",
            "cached_lower",
            "cached_upper",
            "q_lower",
            "q_upper",
            "belief",
        )
        for node in (1, -1)
    ),
    *((name, (node,)) for name in ("expected_rewards",) for node in (1, -1, 2**31 - 1)),
    *(("select_action", (node, below)) for node in (1, -1) for below in (False, True)),
    *(("children", which) for which in ((1, 0), (-1, 0), (0, 3), (0, -1))),
    *(
        ("find_or_add_child", which)
        for which in ((1, 0, 0), (-1, 0, 0), (0, 3, 0), (0, -1, 0), (0, 0, 2), (0, 0, 2**31))
    ),
    ("find_or_add_child", (0, 1, 0)),  # an action that is not expanded has no children
    ("vectors", (2,)),
    ("add_vectors", (2, vectors([0, 0]), np.zeros(1, i4))),
    *(("add_vectors", (0, vectors([0, 0]), np.array([a], i4))) for a in (3, -1)),
    ("prune", ([0, 1], 1e-3, 3.0, 1.3)),
    ("prune", ([-1], 1e-3, 3.0, 1.3)),
]

INVALID_ARRAYS: list[tuple[str, tuple[Any, ...]]] = [
    *(
        ("find_or_add_node", (np.array(belief),))
        for belief in ([1.0], [0.5, 0.25, 0.25], [nan, 1], [inf, 0], [1.5, -0.5])
    ),
    *(("find_or_add_node", (np.array(belief),)) for belief in ([0.0, 0], [0.5, 0.4], [1.0, 1], [1e-310, 0])),
    *(
        ("add_vectors", (0, np.array(table), np.zeros(1, i4)))
        for table in ([[0.0]], [[0.0, nan]], [[-inf, 0]])
    ),
    ("add_vectors", (0, np.zeros((2, 2)), np.zeros(1, i4))),
    ("add_vectors", (0, np.zeros((0, 3)), np.zeros(0, i4))),
    *(
        ("prune", ([0], *limits))
        for limits in ((nan, 3.0, 1.3), (1e-3, nan, 1.3), (1e-3, 3.0, nan), (-1, 3, 1.3))
    ),
    ("prune", ([0], 1e-3, -1.0, 1.3)),
    *(
        ("add_points", (np.array(begins, i8), TWO, HALVES, np.zeros(1)))
        for begins in ([0, 3], [0, 1], [1, 2], [0])
    ),
    ("add_points", (np.array([0, 2, 1, 2], i8), TWO, HALVES, np.zeros(3))),
    ("add_points", (np.array([0, 0, 2], i8), TWO, HALVES, np.zeros(2))),
    ("add_points", (np.zeros(0, i8), TWO[:0], HALVES[:0], np.zeros(0))),
    *(
        ("add_points", (np.array([0, 2], i8), np.array(states, i4), HALVES, np.zeros(1)))
        for states in ([0, 2], [1, 0])
    ),
    *(
        ("add_points", (np.array([0, 2], i8), np.array(states, i4), HALVES, np.zeros(1)))
        for states in ([1, 1], [-1, 0])
    ),
    *(
        ("add_points", (np.array([0, 2], i8), TWO, np.array([0.5, w]), np.zeros(1)))
        for w in (0, -0.5, nan, inf, 1)
    ),
    *(("add_points", (np.array([0, 2], i8), TWO, HALVES, np.array([value]))) for value in (nan, inf, -inf)),
    ("add_points", (np.array([0, 1], i8), TWO[:1], HALVES[:1], np.zeros(1))),
]


@pytest.mark.parametrize(
    "number", range(len(OUT_OF_RANGE)), ids=lambda n: " ".join(map(str, OUT_OF_RANGE[n]))[:50]
)
def test_numbers_out_of_range(number):
    name, arguments = OUT_OF_RANGE[number]
    with pytest.raises(IndexError):
        getattr(make_small_tree(), name)(*arguments)


@pytest.mark.parametrize(
    "number", range(len(INVALID_ARRAYS)), ids=lambda n: " ".join(map(str, INVALID_ARRAYS[n]))[:50]
)
def test_invalid_arrays(number):
    name, arguments = INVALID_ARRAYS[number]
    tree = make_small_tree()
    before = tree.vector_count, tree.point_count, tree.upper_bound(0)
    with pytest.raises(ValueError):  # noqa: PT011
        getattr(tree, name)(*arguments)
    assert (tree.vector_count, tree.point_count, tree.upper_bound(0)) == before  # nothing was added


def test_invalid_bounds_and_limits():
    model = _native.Model(*GOOD.values())
    good = np.zeros((2, 2))
    for bad in (np.zeros((2, 3)), np.zeros((4, 1)), np.full((2, 2), nan), np.full((2, 2), -inf)):
        for call in (
            lambda bad=bad: _native.Tree(model, bad, good),
            lambda bad=bad: _native.Tree(model, good, bad),
            lambda bad=bad: _native.fast_informed_bound(model, bad, 1e-3, 1.0),
        ):
            with pytest.raises(ValueError):  # noqa: PT011
                call()
    for limits in ((nan, 1.0), (-1.0, 1.0), (1e-3, nan)):
        for call in (
            lambda limits=limits: _native.blind_policies(model, *limits),
            lambda limits=limits: _native.mdp_bound(model, *limits),
            lambda limits=limits: _native.fast_informed_bound(model, good, *limits),
        ):
            with pytest.raises(ValueError):  # noqa: PT011
                call()
    for corners in ([], [nan], [inf, 0]):
        with pytest.raises(ValueError):  # noqa: PT011
            _native.ValuePredictor(np.array(corners))


def test_invalid_samples():
    tree, predictor = make_small_tree(), make_predictor()
    for root in (1, -1):
        with pytest.raises(IndexError):
            tree.sample(predictor, root, 0.1, 10, 1.0, False)
        with pytest.raises(IndexError):
            predictor.learn(tree, root)
        with pytest.raises(IndexError):
            predictor.predict(tree, root)
    for target, seconds in ((nan, 1.0), (-1.0, 1.0), (0.1, nan)):
        with pytest.raises(ValueError):  # noqa: PT011
            tree.sample(predictor, 0, target, 10, seconds, False)
    assert tree.sample(predictor, 0, 0.1, 0, 1.0, False) == 1  # at least the root is backed up
    assert tree.sample(predictor, 0, 0.1, 10, -1.0, False) == 1  # no time is not an error


def test_other_types_are_rejected():
    """Indices are not converted: a number beyond 32 bits would become another one."""
    for change in (
        {"transition_columns": GOOD["transition_columns"].astype(i8)},
        {"transition_columns": GOOD["transition_columns"].astype(float)},
        {"transition_columns": GOOD["transition_columns"].tolist()},
        {"transition_begins": GOOD["transition_begins"].astype(i4)},
        {"transition_values": GOOD["transition_values"] + 0j},
        {"transition_values": None},
        {"reward": np.zeros(4)},
        {"actions": 2**40},
        {"actions": 2.5},
        {"discount": "0.9"},
    ):
        with pytest.raises(TypeError):
            _native.Model(*(GOOD | change).values())
    tree, predictor = make_small_tree(), make_predictor()
    for call in (
        lambda: _native.mdp_bound(None, 1e-3, 1.0),
        lambda: _native.Tree(None, np.zeros((2, 2)), np.zeros((2, 2))),
        lambda: tree.cached_lower(2**31),
        lambda: tree.cached_lower(0.5),
        lambda: tree.find_or_add_child(0, 0, -1),
        lambda: tree.sample(None, 0, 0.1, 10, 1.0, False),
        lambda: tree.sample(predictor, 0, 0.1, -1, 1.0, False),
        lambda: tree.vectors(-1),
        lambda: tree.add_vectors(0, np.zeros((1, 3)), np.zeros(1, i8)),
        lambda: tree.add_points(np.array([0, 2], i8), TWO.astype(i8), HALVES, np.zeros(1)),
        lambda: predictor.predict(None, 0),
    ):
        with pytest.raises(TypeError):
            call()


def test_lossless_conversions():
    """Of single precision, strided arrays and integers."""
    apart = np.repeat(GOOD["observation_values"], 2)[::2]
    model = _native.Model(
        *(
            GOOD
            | {"transition_values": GOOD["transition_values"].astype(np.float32), "observation_values": apart}
        ).values()
    )
    blind, _, informed = bounds(model, 1e-3)
    tree = _native.Tree(model, informed, blind)
    assert tree.belief(tree.find_or_add_node(np.array([1, 0]))).tolist() == [1, 0]


def test_arrays_outlive_their_tree():
    tree = make_small_tree()
    lasting = [tree.belief(0), tree.q_upper(0), tree.vectors(0)[1], tree.points()[0]]
    copies = [array.copy() for array in lasting]
    model_stays = tree.select_action(0, True)
    del tree
    assert model_stays in range(3)
    for array, copy in zip(lasting, copies, strict=True):
        assert array.tolist() == copy.tolist()
