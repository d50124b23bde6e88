"""The problem: a finite POMDP, checked once when it is made."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Belief, freeze

SUM_TOLERANCE = 1e-9
"""How far a row may be from summing to 1: rounding of some thousand added doubles stays far below."""

MOST_VALUE = 1e150
"""The largest value a policy may have: beyond it squares and differences of values overflow."""


@dataclass(frozen=True, eq=False)
class Pomdp:
    """A finite POMDP with S states, A actions and O observations.

    states, actions, observations: the names, each unique within its kind.
    transition:  (A, S, S) P(s' | s, a)
    observation: (A, S, O) P(o | a, s'), s' being the state reached
                 both given as arrays, as A scipy.sparse matrices or as `SparseTables`, and stored as these
    reward:      (A, S) expected immediate reward of doing a in s
    discount:    0 < discount < 1
    start:       (S,) the belief when nothing is known
    file:        where it was read from, for people to read; "" when it was not

    Raises:
        ModelError: a shape, sum, sign, name or the discount breaks the law above; it is named.
    """

    states: tuple[str, ...]
    actions: tuple[str, ...]
    observations: tuple[str, ...]
    transition: SparseTables
    observation: SparseTables
    reward: Array
    discount: float
    start: Belief
    file: str = ""

    def __post_init__(self) -> None:
        for kind in ("states", "actions", "observations"):
            object.__setattr__(self, kind, tuple(getattr(self, kind)))
            _check_names(kind, getattr(self, kind))
        S, A, obs = len(self.states), len(self.actions), len(self.observations)
        for field, shape in (("transition", (A, S, S)), ("observation", (A, S, obs))):
            rows = SparseTables.of(getattr(self, field))
            if rows.shape != shape:
                raise ModelError(f"{field} has shape {rows.shape}, not {shape}")
            object.__setattr__(self, field, rows)
        for field, sizes in (("reward", (A, S)), ("start", (S,))):
            array = _kept(getattr(self, field))
            if array.shape != sizes:
                raise ModelError(f"{field} has shape {array.shape}, not {sizes}")
            object.__setattr__(self, field, array)
        for field in ("transition", "observation", "reward", "start"):
            held = getattr(self, field)
            if not np.isfinite(held.values if isinstance(held, SparseTables) else held).all():
                raise ModelError(f"{field} holds a number that is not finite")
        object.__setattr__(self, "discount", float(self.discount))
        if not 0 < self.discount < 1:
            raise ModelError(discount_message(self.discount))
        most = float(np.abs(self.reward).max())
        if most > MOST_VALUE * (1 - self.discount):
            raise ModelError(
                f"a reward of {most:.3g} at discount {self.discount:g} adds up to more than {MOST_VALUE:g}"
            )
        self._check_rows("transition", self.transition)
        self._check_rows("observation", self.observation)
        if self.start.min() < 0 or abs(self.start.sum() - 1) > SUM_TOLERANCE:
            raise ModelError(f"the start belief is not a distribution; it sums to {self.start.sum():.10g}")

    def _check_rows(self, field: str, table: SparseTables) -> None:
        S = len(self.states)
        if len(table.values) and table.values.min() < 0:
            a, s = divmod(int(table.rows[table.values.argmin()]), S)
            raise ModelError(
                f"{field} row for {self.actions[a]!r}, {self.states[s]!r} has a negative"
                f" probability, {table.values.min():.10g}"
            )
        sums = table.row_sums()
        off = np.abs(sums - 1)
        if off.max() > SUM_TOLERANCE:
            a, s = divmod(int(off.argmax()), S)
            raise ModelError(
                f"{field} row for {self.actions[a]!r}, {self.states[s]!r} sums to {sums[a, s]:.10g}, not 1"
            )

    @cached_property
    def _indices(self) -> Mapping[str, Mapping[str, int]]:
        kinds = {"state": self.states, "action": self.actions, "observation": self.observations}
        return {kind: {name: i for i, name in enumerate(names)} for kind, names in kinds.items()}

    def _index(self, kind: str, name: str) -> int:
        known = self._indices[kind]
        if name not in known:
            raise ModelError(f"unknown {kind} {name!r}; {expected_one_of(tuple(known))}")
        return known[name]

    def state_index(self, name: str) -> int:
        """The number of a state. Raises ModelError with the known names."""
        return self._index("state", name)

    def action_index(self, name: str) -> int:
        """The number of an action. Raises ModelError with the known names."""
        return self._index("action", name)

    def observation_index(self, name: str) -> int:
        """The number of an observation. Raises ModelError with the known names."""
        return self._index("observation", name)

    @cached_property
    def fingerprint(self) -> str:
        """sha256 of what a policy depends on: names, tables and discount.

        The start belief is left out: alpha vectors stay a lower bound when only the start changes.
        """
        digest = hashlib.sha256()
        digest.update(repr((self.states, self.actions, self.observations, self.discount)).encode())
        for table in (self.transition, self.observation):
            for array, kind in ((table.begins, "<i8"), (table.columns, "<i4"), (table.values, "<f8")):
                digest.update(array.astype(kind).tobytes())
        # adding 0 makes -0.0 and 0.0, which are equal, the same bytes
        digest.update(np.ascontiguousarray(self.reward + 0.0).astype("<f8").tobytes())
        return digest.hexdigest()


def discount_message(discount: float) -> str:
    """What is wrong with a discount outside (0, 1)."""
    if discount == 1:
        return (
            "discount 1 is refused: without a proper goal or a finite horizon the value may be"
            " infinite; use a discount below 1, e.g. 0.999"
        )
    return f"discount {discount:.10g} is not between 0 and 1, both excluded"


def _check_names(kind: str, names: tuple[str, ...]) -> None:
    if not names:
        raise ModelError(f"a POMDP needs {kind}; there are none")
    if len(set(names)) != len(names):
        seen: set[str] = set()
        twice = next(name for name in names if name in seen or seen.add(name))  # type: ignore[func-returns-value]
        raise ModelError(f"{kind} have the name {twice!r} twice")


def _kept(array: npt.ArrayLike) -> Array:
    """The array itself where nobody can write to it, otherwise a frozen copy: tables can be large."""
    if (
        isinstance(array, np.ndarray)
        and array.dtype == np.float64
        and array.flags.owndata
        and not array.flags.writeable
    ):
        return array
    return freeze(array)
