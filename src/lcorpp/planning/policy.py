"""A policy as alpha vectors: the value of following it, linear in the belief, and what to do first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.errors import PolicyError
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Belief, frozen


@dataclass(frozen=True, eq=False)
class Policy:
    """K alpha vectors over S states; at a belief, the action of the vector that is best there is taken.

    vectors: (K, S) value of each vector's plan, by the state it starts in.
    actions: (K,) index of the action each plan begins with.
    state_names, action_names: the names of the model.
    fingerprint: `Pomdp.fingerprint` of the model it was made for; "" when unknown.
    model: name of the model's file, for people to read.

    Raises:
        PolicyError: shapes or indices do not fit together.
    """

    vectors: Array
    actions: npt.NDArray[np.intp]
    state_names: tuple[str, ...]
    action_names: tuple[str, ...]
    fingerprint: str = ""
    model: str = ""

    def __post_init__(self) -> None:
        vectors = frozen(self.vectors)
        actions = np.array(self.actions, dtype=np.intp)
        actions.setflags(write=False)
        if vectors.ndim != 2 or not len(vectors) or vectors.shape[1] != len(self.state_names):
            raise PolicyError(
                f"vectors of shape {vectors.shape} are no policy for {len(self.state_names)} states"
            )
        if not np.isfinite(vectors).all():
            raise PolicyError("an alpha vector holds a number that is not finite")
        if actions.shape != (len(vectors),):
            raise PolicyError(f"{len(vectors)} vectors need as many actions, not {actions.shape}")
        if actions.min() < 0 or actions.max() >= len(self.action_names):
            raise PolicyError(f"an action index is outside 0 to {len(self.action_names) - 1}")
        object.__setattr__(self, "vectors", vectors)
        object.__setattr__(self, "actions", actions)

    @classmethod
    def of(cls, pomdp: Pomdp, vectors: npt.ArrayLike, actions: npt.ArrayLike) -> Policy:
        """A policy for `pomdp` from vectors (K, S) and action indices (K,)."""
        return cls(
            np.asarray(vectors, dtype=np.float64),
            np.asarray(actions, dtype=np.intp),
            pomdp.states,
            pomdp.actions,
            pomdp.fingerprint,
            pomdp.file,
        )

    def action(self, belief: Belief) -> int:
        """Index of the action to take at a belief (S,): argmax over vectors, the first among equals."""
        return int(self.actions[(self.vectors @ belief).argmax()])

    def value(self, belief: Belief) -> float:
        """The discounted reward the policy earns at least from a belief (S,)."""
        return float((self.vectors @ belief).max())
