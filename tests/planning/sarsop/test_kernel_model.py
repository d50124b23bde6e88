"""Conversion of a problem for the kernels."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.planning import Pomdp, SparseTables, _native
from lcorpp.planning.sarsop.kernel_model import build_model


def test_a_model_keeps_its_sparse_tables():
    """100,000 states: a dense table would not fit into memory."""
    n = 100_000
    states = np.arange(n)
    begins = np.arange(n + 1)
    pomdp = Pomdp(
        tuple(map(str, states)),
        ("on",),
        ("o", "p"),
        SparseTables((1, n, n), begins, ((states + 1) % n).astype(np.int32), np.ones(n)),
        SparseTables((1, n, 2), begins, (states % 2).astype(np.int32), np.ones(n)),
        np.where(states == 0, 1.0, 0.0)[None],
        0.9,
        np.eye(1, n)[0],
    )
    model = build_model(pomdp)
    assert model.export_blocks()[:4].tolist() == [0, 1, 0, 1]
    blind = _native.blind_policies(model, 1e-3, 60.0)
    tree = _native.Tree(model, _native.mdp_bound(model, 1e-3, 60.0), blind)
    root = tree.find_or_add_node(pomdp.start)
    tree.backup(root)
    assert tree.lower_bound(root) == pytest.approx(1, abs=2e-3)
    assert tree.upper_bound(root) == pytest.approx(1, abs=2e-3)
