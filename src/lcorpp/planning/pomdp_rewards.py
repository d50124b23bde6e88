"""Rewards that depend on the next state and the observation, folded into the expected immediate reward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.pomdp import MAX_BYTES
from lcorpp.values import Array

Index = int | slice
"""One state, action or observation, or all of them."""


@dataclass(frozen=True, eq=False)
class Reward:
    """One R statement: where it holds and the values there: (), (O,) or (S, O)."""

    action: Index
    state: Index
    following: Index
    observation: Index
    values: Array


def expected_rewards(transition: Array, observation: Array, statements: Sequence[Reward]) -> Array:
    """(A, S) sum over s', o of P(s' | s, a) P(o | a, s') R(a, s, s', o).

    Later statements override earlier ones. One action is unfolded at a time, and only along the axes that its
    statements mention: the full table of A*S*S*O numbers is never made.

    Args:
        transition: (A, S, S). observation: (A, S, O).

    Raises:
        ModelError: the rewards of one action do not fit into memory.
    """
    A, S, _ = transition.shape
    by_action: list[list[Reward]] = [[] for _ in range(A)]
    for statement in statements:
        for a in range(A) if isinstance(statement.action, slice) else (statement.action,):
            by_action[a].append(statement)
    reward = np.zeros((A, S))
    for a in range(A):
        # an overflowing sum of huge rewards becomes inf here and is refused by name when the model is made
        with np.errstate(over="ignore", invalid="ignore"):
            reward[a] = _folded(transition[a], observation[a], by_action[a])
    return reward


def _folded(T: Array, Z: Array, statements: Sequence[Reward]) -> Array:
    """(S,) the expected reward of one action with T (S, S) and Z (S, O)."""
    S, observations = Z.shape
    by_next = any(isinstance(r.following, int) or r.values.ndim == 2 for r in statements)
    by_observation = any(isinstance(r.observation, int) or r.values.ndim > 0 for r in statements)
    size = 8 * S * (S if by_next else 1) * (observations if by_observation else 1)
    if size > MAX_BYTES:
        raise ModelError(
            f"rewards by next state and observation need {size / 2**30:.1f} GiB for one action;"
            f" at most {MAX_BYTES / 2**30:.0f} GiB are made"
        )
    table = np.zeros((S, S if by_next else 1, observations if by_observation else 1))
    for r in statements:
        table[r.state, r.following, r.observation] = r.values
    if by_next and by_observation:
        folded: Array = np.einsum("st,to,sto->s", T, Z, table, optimize=["einsum_path", (1, 2), (0, 1)])
        return folded
    if by_next:
        return np.asarray((T * table[:, :, 0]).sum(axis=1))
    if by_observation:
        return np.asarray(((T @ Z) * table[:, 0, :]).sum(axis=1))
    return table[:, 0, 0]
