"""The finest partition of the states that start beliefs reach, such that beliefs stay within its blocks."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from lcorpp.planning.sarsop.numpy_kernels.model import Model
from lcorpp.values import Indices


def find_reachable_blocks(
    model: Model, begins: npt.NDArray[np.int64], states: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """`kernel_protocols.Kernels.find_reachable_blocks`: blocks are merged until nothing changes."""
    if len(begins) < 2 or begins[0] != 0 or begins[-1] != len(states):
        raise ValueError("the arrays of the starts do not fit together")
    if (np.diff(begins) <= 0).any():
        raise ValueError("a start has no states")
    if states.min() < 0 or states.max() >= model.states:
        raise ValueError("a state of a start is out of range")
    starts = np.split(states.astype(np.intp), begins[1:-1])
    outcomes = _Outcomes(model)
    reached = outcomes.find_reached(states)
    label = np.arange(model.states)
    # each start is a source beside the states: what it leads to must lie within one block
    sources = [*starts]
    while True:
        merged = outcomes.merge(label, reached, sources)
        if (merged == label).all():
            spread = [start for start in starts if len(np.unique(label[start])) > 1]
            if not spread or len(sources) > len(starts):
                break
            sources.append(np.concatenate(spread))  # they share their alpha vectors
        label = merged
    numbers = np.full(model.states, -1, dtype=np.int32)
    numbers[reached] = _number(label[reached])
    return numbers


class _Outcomes:
    """All states with an action, a next state and an observation that are possible."""

    def __init__(self, model: Model) -> None:
        T, Z, S = model.transition, model.observation, model.states
        action, self.state = np.divmod(T.rows, S)
        entries, position = Z.row_entries(action * S + T.columns)
        self.n_states, self.n_outcomes = S, model.actions * model.observations
        self.state = self.state[position]
        self.next = T.columns[position].astype(np.intp)
        self.outcome = action[position] * model.observations + Z.columns[entries]

    def find_reached(self, states: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
        """Return (S,) whether a path from some states leads to a state."""
        S = self.n_states
        rows = np.concatenate([self.state, np.full(len(states), S)])
        columns = np.concatenate([self.next, states])
        graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(S + 1, S + 1)).tocsr()
        reached = np.zeros(S + 1, dtype=bool)
        reached[breadth_first_order(graph, S, return_predecessors=False)] = True
        return reached[:S]

    def merge(self, label: Indices, reached: npt.NDArray[np.bool_], sources: list[Indices]) -> Indices:
        """Return the labels (S,) after merging all that one block or source, action and observation reach."""
        S, inside = self.n_states, reached[self.state]
        keys = [label[self.state[inside]] * self.n_outcomes + self.outcome[inside]]
        nexts = [self.next[inside]]
        for number, source in enumerate(sources):
            chosen = np.isin(self.state, source)
            keys.append((S + number) * self.n_outcomes + self.outcome[chosen])
            nexts.append(self.next[chosen])
        _, group = np.unique(np.concatenate(keys), return_inverse=True)
        rows = np.concatenate([*nexts, np.arange(S)])
        columns = np.concatenate([S + S + group, S + label])
        size = 2 * S + int(group.max()) + 1
        graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(size, size))
        return _number(connected_components(graph, directed=False)[1][:S])


def _number(label: npt.NDArray[np.integer]) -> Indices:
    """Return the labels numbered by their first occurrence."""
    first, inverse = np.unique(label, return_index=True, return_inverse=True)[1:]
    return np.argsort(np.argsort(first))[inverse]
