"""A policy as alpha vectors: the value of following it, linear in the belief, and what to do first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import MAX_BYTES
from lcorpp.values import Array, Belief, freeze

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class AlphaVectors:
    """Alpha vectors over some of the states: plans for beliefs that lie in them.

    states: (n,) indices, rising.
    vectors: (K, n) value of each vector's plan, by the state it starts in.
    actions: (K,) index of the action each plan begins with.

    Raises:
        PolicyError: shapes do not fit together, or a number is not finite.
    """

    states: Indices
    vectors: Array
    actions: Indices

    def __post_init__(self) -> None:
        object.__setattr__(self, "vectors", freeze(self.vectors))
        for field in ("states", "actions"):
            array = np.array(getattr(self, field), dtype=np.intp)
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        vectors, states, actions = self.vectors, self.states, self.actions
        if states.ndim != 1 or vectors.ndim != 2 or not len(vectors) or vectors.shape[1] != len(states):
            raise PolicyError(f"vectors of shape {vectors.shape} are no policy for {len(states)} states")
        if not len(states) or (np.diff(states) <= 0).any():
            raise PolicyError("the states of a piece must rise, and there must be some")
        if not np.isfinite(vectors).all():
            raise PolicyError("an alpha vector holds a number that is not finite")
        if actions.shape != (len(vectors),):
            raise PolicyError(f"{len(vectors)} vectors need as many actions, not {actions.shape}")


class UpperBound(Protocol):
    """An upper bound on the optimal value."""

    def value(self, belief: Belief) -> float:
        """The bound at a belief (S,)."""


@dataclass(frozen=True, eq=False)
class Policy:
    """Alpha vectors over S states; at a belief, the action of the vector that is best there is taken.

    Most policies have one piece, over all states. Where parts of the state are always observed, each of
    their values has a piece of its own, and there may be one more for beliefs over several.

    state_names, action_names: the names of the model.
    fingerprint: `Pomdp.fingerprint` of the model it was made for; "" when unknown.
    model: name of the model's file, for people to read.
    floor: a reward that any plan earns at least from any state; it stands for the states that a piece does
        not speak of.
    upper_bound: what no policy can earn more than, where the solver left it; see `gap`.

    Raises:
        PolicyError: shapes or indices do not fit together.
    """

    vector_sets: tuple[AlphaVectors, ...]
    state_names: tuple[str, ...]
    action_names: tuple[str, ...]
    fingerprint: str = ""
    model: str = ""
    floor: float = 0.0
    upper_bound: UpperBound | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vector_sets", tuple(self.vector_sets))
        if not self.vector_sets:
            raise PolicyError("a policy needs alpha vectors; there are none")
        for piece in self.vector_sets:
            if piece.states[0] < 0 or piece.states[-1] >= len(self.state_names):
                raise PolicyError(f"a state index is outside 0 to {len(self.state_names) - 1}")
            if piece.actions.min() < 0 or piece.actions.max() >= len(self.action_names):
                raise PolicyError(f"an action index is outside 0 to {len(self.action_names) - 1}")
        if not self.is_flat and not np.isfinite(self.floor):
            raise PolicyError("a policy in pieces needs a floor that is finite")

    @classmethod
    def of(cls, pomdp: Pomdp, vectors: npt.ArrayLike, actions: npt.ArrayLike) -> Policy:
        """A policy for `pomdp` from vectors (K, S) and action indices (K,)."""
        table = np.asarray(vectors, dtype=np.float64)
        if table.ndim != 2 or table.shape[1] != len(pomdp.states):
            raise PolicyError(f"vectors of shape {table.shape} are no policy for {len(pomdp.states)} states")
        return cls.of_sets(pomdp, [AlphaVectors(np.arange(len(pomdp.states)), table, np.asarray(actions))])

    @classmethod
    def of_sets(
        cls, pomdp: Pomdp, pieces: Iterable[AlphaVectors], upper_bound: UpperBound | None = None
    ) -> Policy:
        """A policy for `pomdp` from pieces."""
        floor = float(pomdp.reward.min()) / (1 - pomdp.discount)
        names = pomdp.states, pomdp.actions
        return cls(tuple(pieces), *names, pomdp.fingerprint, pomdp.file, floor, upper_bound)

    @property
    def is_flat(self) -> bool:
        """Whether it has one piece, over all states."""
        return len(self.vector_sets) == 1 and len(self.vector_sets[0].states) == len(self.state_names)

    def __len__(self) -> int:
        """The number of vectors."""
        return sum(len(piece.actions) for piece in self.vector_sets)

    @cached_property
    def vectors(self) -> Array:
        """(K, S) all vectors, with the floor for the states that a piece does not speak of.

        Raises:
            ModelError: they would be too large.
        """
        if self.is_flat:
            return self.vector_sets[0].vectors
        size = 8 * len(self) * len(self.state_names)
        if size > MAX_BYTES:
            raise ModelError(f"all vectors of the policy written out take {size / 2**30:.1f} GiB")
        table = np.full((len(self), len(self.state_names)), self.floor)
        begin = 0
        for piece in self.vector_sets:
            table[begin : begin + len(piece.actions), piece.states] = piece.vectors
            begin += len(piece.actions)
        table.setflags(write=False)
        return table

    @cached_property
    def actions(self) -> Indices:
        """(K,) index of the action each vector's plan begins with."""
        return np.concatenate([piece.actions for piece in self.vector_sets])

    def action(self, belief: Belief) -> int:
        """Index of the action to take at a belief (S,): argmax over vectors, the first among equals."""
        return self.best(belief)[1]

    def value(self, belief: Belief) -> float:
        """The discounted reward the policy earns at least from a belief (S,)."""
        return self.best(belief)[0]

    def gap(self, belief: Belief) -> float:
        """How much more than this policy any other can earn from a belief (S,) at most, in reward units.

        Raises:
            PolicyError: nothing is known from above, as for a policy that was read from a file.
        """
        if self.upper_bound is None:
            raise PolicyError("this policy has no upper bound to measure it by; solve the model")
        return max(0.0, self.upper_bound.value(belief) - self.value(belief))

    def best(self, belief: Belief) -> tuple[float, int]:
        """The value at a belief (S,) and the index of the action."""
        best, action = -np.inf, -1
        for piece in self._speaking(belief):
            inside = belief if len(piece.states) == len(belief) else belief[piece.states]
            values = piece.vectors @ inside
            k = int(values.argmax())
            value = float(values[k])
            if inside is not belief:
                value += self.floor * max(0.0, float(belief.sum() - inside.sum()))
            if value > best:
                best, action = value, int(piece.actions[k])
        return best, action

    def _speaking(self, belief: Belief) -> Iterable[AlphaVectors]:
        """The pieces that hold all states of a belief; every piece where none does."""
        if len(self.vector_sets) == 1:
            return self.vector_sets
        count = np.count_nonzero(belief)
        found = [
            piece
            for piece in self._having.get(int(belief.argmax()), ())
            if len(piece.states) == len(belief) or np.count_nonzero(belief[piece.states]) == count
        ]
        return found or self.vector_sets

    @cached_property
    def _having(self) -> Mapping[int, list[AlphaVectors]]:
        """The pieces that hold a state."""
        found: dict[int, list[AlphaVectors]] = {}
        for piece in self.vector_sets:
            for state in piece.states.tolist():
                found.setdefault(state, []).append(piece)
        return found
