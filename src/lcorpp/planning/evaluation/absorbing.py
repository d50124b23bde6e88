"""Where nothing more is paid: states and beliefs at which a trial may stop."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.planning.evaluation.sparse_beliefs import ragged_indices
from lcorpp.planning.pomdp import Pomdp


def zero_reward_states(pomdp: Pomdp) -> npt.NDArray[np.bool_]:
    """(S,) whether nothing is paid from a state on, whatever is done: none that pays can be reached."""
    table, S = pomdp.transition, len(pomdp.states)
    pays: npt.NDArray[np.bool_] = (pomdp.reward != 0).any(axis=0)
    some = np.flatnonzero(table.values > 0)
    some = some[np.argsort(table.columns[some], kind="stable")]
    sources = table.rows[some] % S
    begins = np.searchsorted(table.columns[some], np.arange(S + 1))
    frontier = np.flatnonzero(pays)
    while len(frontier):
        before = sources[ragged_indices(begins[frontier], begins[frontier + 1] - begins[frontier])]
        frontier = np.unique(before[~pays[before]])
        pays[frontier] = True
    return ~pays


def self_loop_observation_class(pomdp: Pomdp) -> npt.NDArray[np.intp]:
    """(A, S) for a state that stays where it is, unpaid, a number for its row of observations; otherwise -1.

    A belief all of whose states have the same number under the action that is taken there never changes
    again, whatever is observed, and earns nothing more.
    """
    T, Z, S = pomdp.transition, pomdp.observation, len(pomdp.states)
    some = T.values > 0
    leaves = np.bincount(T.rows[some], T.columns[some] != T.rows[some] % S, minlength=len(T.begins) - 1) > 0
    shown = np.full((len(pomdp.actions), S), -1, dtype=np.intp)
    rows: dict[bytes, int] = {}
    for row in np.flatnonzero(~leaves & (pomdp.reward.reshape(-1) == 0)).tolist():
        columns, values = Z.row(row // S, row % S)
        shown[row // S, row % S] = rows.setdefault(columns.tobytes() + values.tobytes(), len(rows))
    return shown
