"""Conversion of a problem to the model of the C++ kernels (`lcorpp.planning._native`, native/sarsop)."""

from __future__ import annotations

from lcorpp.planning._native import Model
from lcorpp.planning.arguments import check_discounted
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import SparseTables


def build_model(pomdp: Pomdp, observation: SparseTables | None = None) -> Model:
    """Convert a problem for the kernels, with another table of observations (A, S, O') if one is given.

    Raises:
        ModelError: the discount is 1.

    Rows whose sum differs from 1 by rounding are scaled: over an infinite horizon even 1e-9 would make the
    bounds cross.
    """
    check_discounted(pomdp)
    T = _scale_rows(pomdp.transition)
    Z = _scale_rows(pomdp.observation if observation is None else observation)
    return Model(
        len(pomdp.actions),
        len(pomdp.states),
        Z.shape[2],
        T.begins,
        T.columns,
        T.values,
        Z.begins,
        Z.columns,
        Z.values,
        pomdp.reward,
        pomdp.discount,
    )


def _scale_rows(table: SparseTables) -> SparseTables:
    """Return a table whose rows sum to 1."""
    sums = table.row_sums()
    return table if (sums == 1).all() else table.scale_rows(1 / sums)
