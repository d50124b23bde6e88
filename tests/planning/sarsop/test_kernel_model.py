"""Selection of the kernels, with and without compiled ones."""

from __future__ import annotations

import sys
import warnings

import numpy as np
import pytest

import lcorpp.planning
from lcorpp.planning import Pomdp, parse_pomdp, solve
from lcorpp.planning.sarsop import numpy_kernels
from lcorpp.planning.sarsop.kernels import SlowKernelsWarning, build_model, load_kernels
from tests.planning.models import TIGER
from tests.planning.sarsop.kernels import BOTH, NATIVE, needs_native


@pytest.fixture
def no_compiler(monkeypatch):
    """Hide the compiled kernels."""
    monkeypatch.delattr(lcorpp.planning, "_native", raising=False)
    monkeypatch.setitem(sys.modules, "lcorpp.planning._native", None)
    load_kernels.cache_clear()
    yield
    load_kernels.cache_clear()


@needs_native
def test_the_compiled_kernels_are_the_default():
    assert load_kernels() is NATIVE


def test_load_kernels_returns_numpy_kernels_on_request_without_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_kernels(numpy=True) is numpy_kernels


def test_numpy_without_a_compiler_with_one_warning(no_compiler):
    message = r"C\+\+ kernels of the planner are missing.*pip install"
    with pytest.warns(SlowKernelsWarning, match=message) as warnings_:
        loaded = [load_kernels(), load_kernels(), load_kernels(numpy=True)]
    assert loaded == [numpy_kernels] * 3
    assert len(warnings_) == 1


def test_solving_without_a_compiler(no_compiler):
    with pytest.warns(SlowKernelsWarning):
        solution = solve(parse_pomdp(TIGER), precision=1.0)
    assert solution.lower <= 19.372
    assert solution.upper >= 19.371
    assert solution.reason == "precision reached"


@pytest.mark.parametrize("kernels", BOTH)
def test_solving_with_either(kernels):
    solution = solve(parse_pomdp(TIGER), precision=0.5, kernels=kernels)
    assert solution.lower <= 19.372
    assert solution.upper >= 19.371
    assert solution.upper - solution.lower <= 0.5


@pytest.mark.parametrize("kernels", BOTH)
def test_a_model_keeps_its_sparse_tables(kernels):
    """100,000 states: a dense table would not fit into memory."""
    n = 100_000
    states = np.arange(n)
    begins = np.arange(n + 1)
    rows = lcorpp.planning.SparseTables
    pomdp = Pomdp(
        tuple(map(str, states)),
        ("on",),
        ("o", "p"),
        rows((1, n, n), begins, ((states + 1) % n).astype(np.int32), np.ones(n)),
        rows((1, n, 2), begins, (states % 2).astype(np.int32), np.ones(n)),
        np.where(states == 0, 1.0, 0.0)[None],
        0.9,
        np.eye(1, n)[0],
    )
    model = build_model(kernels, pomdp)
    assert model.export_blocks()[:4].tolist() == [0, 1, 0, 1]
    blind = kernels.blind_policies(model, 1e-3, 60.0)
    tree = kernels.Tree(model, kernels.mdp_bound(model, 1e-3, 60.0), blind)
    root = tree.find_or_add_node(pomdp.start)
    tree.backup(root)
    assert tree.lower_bound(root) == pytest.approx(1, abs=2e-3)
    assert tree.upper_bound(root) == pytest.approx(1, abs=2e-3)
