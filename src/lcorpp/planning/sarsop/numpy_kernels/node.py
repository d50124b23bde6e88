"""A node of the belief tree: a belief, its actions and what may be observed after each."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop.numpy_kernels.model import Beliefs, Indices
from lcorpp.planning.sarsop.numpy_kernels.outcomes import Outcomes
from lcorpp.values import Array


@dataclass(eq=False, slots=True)
class Branch:
    """One action at a belief and its n children, in the order of the observations.

    observation, probability, group: (n,) of each.
    link: (n,) the node of the next belief, -1 until it was visited.
    apart: (n,) how far the values of the next belief and of its node may differ: beliefs alike share a node.
    lower, upper: (n,) bounds of the next beliefs times their probability.
    best: (n,) stamps of the vectors that give `lower`.
    seen_vectors, seen_points: the bounds are up to date with what has an earlier stamp.
    refreshed: whether the upper bounds were asked for.
    outcomes: the next beliefs, kept while there is room: most visits need them.
    """

    observation: Indices
    probability: Array
    group: Indices
    link: Indices
    apart: Array
    lower: Array
    upper: Array
    best: npt.NDArray[np.int64]
    seen_vectors: int = 0
    seen_points: int = 0
    refreshed: bool = False
    outcomes: Outcomes | None = None

    @classmethod
    def of(cls, found: Outcomes) -> Branch:
        """The children as they are at first: nothing is known of them."""
        n = len(found.observation)
        return cls(
            observation=found.observation,
            probability=found.probability,
            group=found.group,
            link=np.full(n, -1, dtype=np.intp),
            apart=np.zeros(n),
            lower=np.full(n, -np.inf),
            upper=np.full(n, np.inf),
            best=np.full(n, -1, dtype=np.int64),
        )


@dataclass(eq=False, slots=True)
class Node:
    """A belief and what is known of it.

    belief: itself, in a table of one. immediate: (A,) expected reward of each action.
    lower, upper: (A,) bounds on the value of each action. low, high: bounds on the value of the belief.
    branches: the actions that were looked at.
    witness, held: stamp of the vector that is best here, and its value; seen_vectors as in a branch.
    surface: the upper bound here when last asked, with the points before stamp seen_surface.
    point: stamp of this belief in the upper bound, -1 for none.
    informed, entropy: the initial upper bound, and a bin: what `Prediction` goes by.
    """

    belief: Beliefs
    immediate: Array
    lower: Array
    upper: Array
    high: float
    surface: float
    seen_surface: int
    informed: float
    entropy: int
    branches: dict[int, Branch] = field(default_factory=dict)
    low: float = -np.inf
    held: float = -np.inf
    witness: int = -1
    seen_vectors: int = 0
    point: int = -1
