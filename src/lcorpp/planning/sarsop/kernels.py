"""Selection of the kernels: compiled, or numpy if there was no compiler at installation."""

from __future__ import annotations

import warnings
from functools import cache

from lcorpp.planning.arguments import check_discounted
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernel_protocols import Kernels, Model
from lcorpp.planning.sparse import SparseTables


class SlowKernelsWarning(UserWarning):
    """The compiled kernels are missing; the numpy kernels compute the same, many times slower."""


@cache
def load_kernels(*, numpy: bool = False) -> Kernels:
    """Return the compiled kernels if they are installed, otherwise, or if requested, the numpy kernels."""
    if not numpy:
        try:
            from lcorpp.planning import _native
        except ImportError as error:
            warnings.warn(
                f"the C++ kernels of the planner are missing ({error}); the numpy kernels are many times"
                " slower. `pip install .` in a source checkout builds them if there is a C++ compiler",
                SlowKernelsWarning,
                stacklevel=3,
            )
        else:
            return _native
    from lcorpp.planning.sarsop import numpy_kernels

    return numpy_kernels


def build_model(kernels: Kernels, pomdp: Pomdp, observation: SparseTables | None = None) -> Model:
    """Convert a problem for the kernels, with another table of observations (A, S, O') if one is given.

    Raises:
        ModelError: the discount is 1.

    Rows whose sum differs from 1 by rounding are scaled: over an infinite horizon even 1e-9 would make the
    bounds cross.
    """
    check_discounted(pomdp)
    observation = pomdp.observation if observation is None else observation
    tables = []
    for table in (pomdp.transition, observation):
        sums = table.row_sums()
        rows = table if (sums == 1).all() else table.scale_rows(1 / sums)
        tables += [rows.begins, rows.columns, rows.values]
    return kernels.Model(
        len(pomdp.actions),
        len(pomdp.states),
        observation.shape[2],
        *tables,
        pomdp.reward,
        pomdp.discount,
    )
