"""The kernels of the solver: compiled, or their numpy twins where there was no compiler at installation."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Belief

Indices = npt.NDArray[Any]
"""Numbers of states, actions and so on, of 32 bits."""

Points = tuple[npt.NDArray[np.int64], Indices, Array, Array]


class SlowKernelsWarning(UserWarning):
    """The compiled kernels are missing; numpy's do the same, many times slower."""


class Model(Protocol):
    """The problem, as the kernels want it; made by `model_of`."""

    def blocks(self) -> Indices:
        """(S,) the block of each state: after an action and an observation, a belief lies in one block."""


class Prediction(Protocol):
    """A guess at the value of a node, learnt from others."""

    def learn(self, tree: Any, node: int) -> None:
        """Count a visited node with its lower bound."""

    def value(self, tree: Any, node: int) -> float:
        """What a node may be worth."""


class Tree(Protocol):
    """Beliefs, numbered as they were met, and the two bounds they share.

    One thread at a time: the compiled one lets others run meanwhile, and they must not use the same tree.
    A group is a block of the model, or the one of beliefs over several. Numbers that are out of range raise
    IndexError, arrays that do not fit ValueError or TypeError.
    """

    @property
    def discount(self) -> float:
        """gamma."""

    @property
    def node_count(self) -> int:
        """How many beliefs were met."""

    @property
    def vector_count(self) -> int:
        """How many alpha vectors there are, all groups together."""

    @property
    def point_count(self) -> int:
        """How many points lower the upper bound."""

    @property
    def groups(self) -> int:
        """The number of groups."""

    def vectors(self, group: int) -> tuple[Indices, Array, Indices]:
        """The states (n,) of a group, its alpha vectors (K, n) and the actions (K,) they begin with."""

    def origins(self, group: int) -> tuple[Array, Indices]:
        """The vectors (K, n) and actions (K,) of a group that were pruned and that those left go on with."""

    def points(self) -> tuple[Array, *Points]:
        """The upper bound: corners (S,), and where each point begins, its states, weights and value."""

    def low(self, node: int) -> float:
        """The best lower bound at a node."""

    def high(self, node: int) -> float:
        """The best upper bound at a node."""

    def q_lower(self, node: int) -> Array:
        """(A,) a lower bound on the value of each action."""

    def q_upper(self, node: int) -> Array:
        """(A,) an upper bound on the value of each action."""

    def immediate(self, node: int) -> Array:
        """(A,) the expected reward of each action."""

    def belief(self, node: int) -> Belief:
        """(S,) the belief of a node."""

    def children(self, node: int, action: int) -> tuple[Indices, Array, Array, Array, Indices]:
        """(n,) observation, probability, lower and upper bound times probability, node (-1: not visited yet).

        There are none until the action was looked at.
        """

    def node(self, belief: Belief) -> int:
        """The node of a belief (S,), made where there is none."""

    def child(self, node: int, action: int, number: int) -> int:
        """The node of a child, by its place in `children`."""

    def add_vectors(self, group: int, vectors: Array, actions: Indices) -> None:
        """Take over alpha vectors (K, n) over the states of a group, and the actions (K,) they begin with."""

    def add_points(
        self, begins: npt.NDArray[np.int64], states: Indices, weights: Array, values: Array
    ) -> None:
        """Take over points, as `points` gives them."""

    def refresh(self, node: int) -> None:
        """Bring the bounds of a node up to date with the vectors and points since its last visit."""

    def look(self, node: int, below: bool) -> int:
        """The action to follow, best in the upper or the lower bound, with both its bounds up to date."""

    def lower_at(self, node: int) -> float:
        """The value at a node that the alpha vectors give by themselves."""

    def upper_at(self, node: int) -> float:
        """The upper bound at a node: its own or, where it is lower, that of the points."""

    def backup(self, node: int) -> None:
        """Add the alpha vector that is best at a node, and lower the upper bound there."""

    def trial(
        self, prediction: Any, root: int, target: float, depth: int, seconds: float, greedy_below: bool
    ) -> int:
        """Sample a path and back up along it; how many nodes it had. See sampling.py."""

    def prune(self, roots: Sequence[int], delta: float, cap: float, growth: float) -> None:
        """Keep the vectors that are best, or nearly, at a belief that the roots may reach."""


class Engine(Protocol):
    """What both kinds of kernels offer: `lcorpp.planning._native` and `lcorpp.planning.sarsop.numpy_kernels`.

    An object of one kind is for that kind alone, so that the types of arguments are left open here.
    """

    @property
    def Model(self) -> Callable[..., Model]:
        """Made by `model_of`."""

    @property
    def Tree(self) -> Callable[..., Tree]:
        """From a model, informed Q values (A, S) above the truth, and those (A, S) of blind policies."""

    @property
    def Prediction(self) -> Callable[[Array], Prediction]:
        """From the initial upper bound (S,) where a state is certain."""

    @property
    def blind_policies(self) -> Callable[[Any, float, float], Array]:
        """(A, S) the value of doing one action for ever, from a model, a tolerance and seconds."""

    @property
    def mdp_bound(self) -> Callable[[Any, float, float], Array]:
        """(A, S) Q values above those of the fully observed problem; the same arguments."""

    @property
    def fast_informed_bound(self) -> Callable[[Any, Array, float, float], Array]:
        """(A, S) lower ones, from a model, Q values (A, S) above the truth, a tolerance and seconds."""


def engine(*, numpy: bool = False) -> Engine:
    """The compiled kernels where they are, else numpy's, which is warned of once.

    Args:
        numpy: numpy's in any case, and no warning.
    """
    return _twin() if numpy else _best()


def model_of(kernels: Engine, pomdp: Pomdp) -> Model:
    """A model as kernels want it.

    Rows that miss a sum of 1 by rounding are scaled: summed over an infinite time even 1e-9 would push one
    bound past the other.
    """
    T, Z = _scaled(pomdp.transition), _scaled(pomdp.observation)
    return kernels.Model(
        len(pomdp.actions),
        len(pomdp.states),
        len(pomdp.observations),
        *(T.begins, T.columns, T.values),
        *(Z.begins, Z.columns, Z.values),
        pomdp.reward,
        pomdp.discount,
    )


def _scaled(rows: SparseTables) -> SparseTables:
    sums = rows.row_sums()
    return rows if (sums == 1).all() else rows.scale_rows(1 / sums)


@cache
def _best() -> Engine:
    try:
        from lcorpp.planning import _native
    except ImportError as error:
        warnings.warn(
            f"the C++ kernels of the planner are missing ({error}); numpy serves, and is many times slower."
            " `pip install .` in a copy of the sources builds them where there is a C++ compiler",
            SlowKernelsWarning,
            stacklevel=4,
        )
        return _twin()
    return _native


def _twin() -> Engine:
    from lcorpp.planning.sarsop import numpy_kernels as twin

    return twin
