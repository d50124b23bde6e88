"""Selection of the kernels: compiled, or numpy if there was no compiler at installation."""

from __future__ import annotations

import warnings
from functools import cache

from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernel_protocols import Kernels, Model
from lcorpp.planning.sparse import SparseTables


class SlowKernelsWarning(UserWarning):
    """The compiled kernels are missing; the numpy kernels compute the same, many times slower."""


def load_kernels(*, numpy: bool = False) -> Kernels:
    """Return the compiled kernels if they are installed, otherwise the numpy kernels with a warning.

    Args:
        numpy: return the numpy kernels in any case, without a warning.
    """
    return _load_numpy() if numpy else _load_best()


def build_model(kernels: Kernels, pomdp: Pomdp) -> Model:
    """Convert a problem for the kernels.

    SparseTables whose sum differs from 1 by rounding are scaled: over an infinite horizon even 1e-9 would
        make the bounds cross.
    """
    T, Z = _normalise(pomdp.transition), _normalise(pomdp.observation)
    return kernels.Model(
        len(pomdp.actions),
        len(pomdp.states),
        len(pomdp.observations),
        *(T.begins, T.columns, T.values),
        *(Z.begins, Z.columns, Z.values),
        pomdp.reward,
        pomdp.discount,
    )


def _normalise(table: SparseTables) -> SparseTables:
    sums = table.row_sums()
    return table if (sums == 1).all() else table.scale_rows(1 / sums)


@cache
def _load_best() -> Kernels:
    try:
        from lcorpp.planning import _native
    except ImportError as error:
        warnings.warn(
            f"the C++ kernels of the planner are missing ({error}); the numpy kernels are many times slower."
            " `pip install .` in a source checkout builds them if there is a C++ compiler",
            SlowKernelsWarning,
            stacklevel=4,
        )
        return _load_numpy()
    return _native


def _load_numpy() -> Kernels:
    from lcorpp.planning.sarsop import numpy_kernels

    return numpy_kernels
