"""The POMDP: a frozen value, validated at construction."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.notebook import html_table, join_some
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Belief, share_frozen

SUM_TOLERANCE = 1e-9
"""Tolerance of a row's sum: far above the rounding error of a sum of thousands of doubles."""

MAX_VALUE = 1e150
"""The maximal value of a policy: squares and differences of larger values overflow."""

MAX_DISCOUNT = 1 - 1e-9
"""Rewards of problems with discount 1 are limited as with this discount."""


@dataclass(frozen=True, eq=False)
class Pomdp:
    """A finite POMDP with S states, A actions and O observations.

    states, actions, observations: unique names.
    transition:  (A, S, S) P(s' | s, a)
    observation: (A, S, O) P(o | a, s') for the next state s'
                 both are given as arrays, A scipy.sparse matrices or `SparseTables`, and stored as these
    reward:      (A, S) expected immediate reward of action a in state s
    discount:    0 <= discount <= 1; with 1, every policy must end, see `lcorpp.planning.undiscounted`, or the
                 horizon be finite
    start:       (S,) the initial belief
    file:        name of the source file, for messages; "" if there is none

    Raises:
        ModelError: a shape, sum, sign, name or the discount is invalid; the message names it.

    Examples:
        >>> from lcorpp import Pomdp
        >>> lamp = Pomdp(
        ...     ("on", "off"), ("look", "switch"), ("bright", "dark"),
        ...     transition=[[[1, 0], [0, 1]], [[0, 1], [1, 0]]], observation=[[[1, 0], [0, 1]]] * 2,
        ...     reward=[[1, 0], [0, 0]], discount=0.9, start=[0.5, 0.5],
        ... )
        >>> lamp
        <Pomdp 2 states, 2 actions, 2 observations, discount 0.9>
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
            array = share_frozen(getattr(self, field))
            if array.shape != sizes:
                raise ModelError(f"{field} has shape {array.shape}, not {sizes}")
            object.__setattr__(self, field, array)
        for field in ("transition", "observation", "reward", "start"):
            table = getattr(self, field)
            if not np.isfinite(table.values if isinstance(table, SparseTables) else table).all():
                raise ModelError(f"{field} contains a number that is not finite")
        object.__setattr__(self, "discount", float(self.discount))
        if not 0 <= self.discount <= 1:
            raise ModelError(discount_message(self.discount))
        largest = float(np.abs(self.reward).max())
        if largest > MAX_VALUE * (1 - min(self.discount, MAX_DISCOUNT)):
            raise ModelError(
                f"a reward of {largest:.3g} at discount {self.discount:g} adds up to more than {MAX_VALUE:g}"
            )
        self._check_rows("transition", self.transition)
        self._check_rows("observation", self.observation)
        if self.start.min() < 0 or abs(self.start.sum() - 1) > SUM_TOLERANCE:
            raise ModelError(f"the start belief is not a distribution; it sums to {self.start.sum():.10g}")

    def __repr__(self) -> str:
        name = f"{self.file}: " if self.file else ""
        S, A, obs = len(self.states), len(self.actions), len(self.observations)
        sizes = f"{S} states, {A} actions, {obs} observations"
        return f"<Pomdp {name}{sizes}, discount {self.discount:g}>"

    def _repr_html_(self) -> str:
        rows = [
            (f"{len(names)} {kind}", join_some(names))
            for kind, names in (
                ("states", self.states),
                ("actions", self.actions),
                ("observations", self.observations),
            )
        ]
        rows.append(("reward", f"{self.reward.min():g} to {self.reward.max():g}"))
        rows.append(("discount", f"{self.discount:g}"))
        return html_table(("part", "contents"), rows, caption=f"POMDP {Path(self.file).name}")

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

    @property
    def memory_size(self) -> int:
        """Memory of the tables in bytes."""
        return self.transition.memory_size + self.observation.memory_size + self.reward.nbytes

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
        """Return the index of a state. Raises ModelError with the known names."""
        return self._index("state", name)

    def action_index(self, name: str) -> int:
        """Return the index of an action. Raises ModelError with the known names."""
        return self._index("action", name)

    def observation_index(self, name: str) -> int:
        """Return the index of an observation. Raises ModelError with the known names."""
        return self._index("observation", name)

    @cached_property
    def fingerprint(self) -> str:
        """sha256 of names, tables and discount.

        The start belief is excluded: alpha vectors are lower bounds for every start.
        """
        digest = hashlib.sha256()
        digest.update(repr((self.states, self.actions, self.observations, self.discount)).encode())
        for table in (self.transition, self.observation):
            for array, kind in ((table.begins, "<i8"), (table.columns, "<i4"), (table.values, "<f8")):
                digest.update(array.astype(kind).tobytes())
        # adding 0 gives -0.0 and 0.0 the same bytes
        digest.update(np.ascontiguousarray(self.reward + 0.0).astype("<f8").tobytes())
        return digest.hexdigest()


def discount_message(discount: float) -> str:
    """Return the error message for a discount outside [0, 1]."""
    return f"discount {discount:.10g} is not between 0 and 1"


def _check_names(kind: str, names: tuple[str, ...]) -> None:
    if not names:
        raise ModelError(f"a POMDP needs {kind}; there are none")
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise ModelError(f"{kind} have the name {name!r} twice")
