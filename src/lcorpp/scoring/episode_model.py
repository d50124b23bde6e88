"""The true dynamics of simulated people, for sums over all episodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from lcorpp.domains import Domain
from lcorpp.planning import SparseTables
from lcorpp.values import Array

DENSE_PAIRS = 64
"""Transitions between at most this many pairs are dense matrices, which are faster."""


class EpisodeModel:
    """The true dynamics of a domain on pairs (true value, hidden state), as far as they can be reached.

    starts: (V, J) probability of each pair before the first action, given the true value.
    transition[a]: (J, J). feedback[a]: the k observations that may follow, and (k, J) their probabilities,
    after the action. reward: (A + 1, J); the last row, of no action, is 0. values: (J,) index of the true
    value. reports: (A + 1,) as of `Domain.report_indices`, V for no action.

    Args:
        feedback: (A, S, O) how people answer; by default as the domain's simulated people do.
    """

    def __init__(self, domain: Domain, feedback: Array | SparseTables | None = None) -> None:
        feedback = domain.simulation.feedback_model if feedback is None else feedback
        pomdp, planning, transition = domain.pomdp, domain.planning, domain.people_transition
        self.n_values = len(domain.values)
        reports = domain.report_indices
        self.reports = np.append(reports, self.n_values)
        asking = np.flatnonzero(reports == self.n_values).tolist()
        pairs = {(v, s): j for j, (v, s) in enumerate(zip(*np.nonzero(planning.initial_states), strict=True))}
        entries: dict[int, list[tuple[int, int, float]]] = {a: [] for a in asking}
        waiting = list(pairs)
        for v, s in waiting:  # grows
            for a in asking:
                states, probabilities = transition.row(a, s)
                for after, p in zip(states.tolist(), probabilities.tolist(), strict=True):
                    if (v, after) not in pairs:
                        pairs[v, after] = len(pairs)
                        waiting.append((v, after))
                    entries[a].append((pairs[v, s], pairs[v, after], p))
        size = len(pairs)
        self.values, states = np.array(list(pairs), np.intp).T
        self.starts = np.zeros((self.n_values, size))
        self.starts[self.values, np.arange(size)] = planning.initial_states[self.values, states]
        self.reward = np.vstack([pomdp.reward[:, states], np.zeros(size)])
        self.transition = {a: _make_matrix(triples, size) for a, triples in entries.items()}
        self.feedback = {}
        for a in asking:
            rows = feedback[a][states]
            possible = np.flatnonzero(rows.any(axis=0))
            self.feedback[a] = possible, rows[:, possible].T.copy()
        ask_rewards = self.reward[asking] if asking else np.zeros((1, size))
        end_rewards = self.reward[:-1][reports < self.n_values]
        self.step_range = min(0.0, float(ask_rewards.min())), max(0.0, float(ask_rewards.max()))
        self.end_range = min(0.0, float(end_rewards.min())), max(0.0, float(end_rewards.max()))


def _make_matrix(entries: Sequence[tuple[int, int, float]], size: int) -> Any:
    """Return a square matrix of (row, column, weight); dense if it is small, which is faster."""
    rows, columns, weights = zip(*entries, strict=True)
    if size > DENSE_PAIRS:
        return csr_array((weights, (rows, columns)), shape=(size, size))
    matrix = np.zeros((size, size))
    matrix[rows, columns] = weights
    return matrix
