"""Flattening: from variables to a single state, action and observation.

The tables of an action are multiplied for all states at once; only positive probabilities are stored.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.factored.joint import Joint, MixedRadix, Numbers
from lcorpp.planning.factored.model import Factored
from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.variables import AFTER
from lcorpp.planning.pomdp import SUM_TOLERANCE, Pomdp
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array

Values = Mapping[str, Numbers]
"""Indices (n,) of the values of each variable, for n states."""

_Entries = tuple[Numbers, Numbers, Array]
"""The entries of an action: the number in each row, their columns and their values."""

MAX_STATES = 2**24
"""The maximal number of flat states: the names of more do not fit into memory."""

MAX_CODES = 2**62
"""The maximal number of combinations that an integer can encode."""


def flatten(problem: Factored, *, reachable: bool = False) -> Pomdp:
    """Return the same problem with one state, action and observation in place of the variables.

    States, actions and observations have names such as ``x=1,y=2``; a single variable's values are the names
    themselves. An observation consists of the observed parts of the next state and the observation variables;
    of several variables, only combinations with positive probability are included. Rewards are expected
    immediate rewards. The start belief is that before the first observation; see `start_beliefs`.

    Args:
        reachable: leave out states that no sequence of actions reaches with positive probability from the
            start. Optimal policies and values at the start are the same; the model excludes other starts.

    Raises:
        ModelError: there are too many states, or the rewards are too large.

    Examples:
        >>> from lcorpp.planning import Factored, flatten
        >>> room = Factored.of(
        ...     states={"cup": "full empty", "lamp": "on off"}, observed="lamp", actions="wait",
        ...     start={"cup": "full", "lamp": "uniform"}, transition={"cup": "same", "lamp": "same"},
        ...     reward=1, discount=0.9,
        ... )
        >>> flatten(room).states[:2]
        ('cup=full,lamp=on', 'cup=full,lamp=off')
    """
    states, actions = MixedRadix(problem.states), MixedRadix(problem.actions)
    observations = MixedRadix(
        (*problem.observed, *problem.observations),
        [*(variable.name + AFTER for variable in problem.observed), *(v.name for v in problem.observations)],
    )
    if not reachable and MAX_STATES < states.count <= MAX_CODES:
        raise ModelError(f"{states.count} states are too many to be written out; see `reachable`")
    for kind, count, limit in (
        ("states", states.count, MAX_CODES),
        ("actions", actions.count, MAX_STATES),
        ("observations", observations.count, MAX_CODES),
    ):
        if count > limit:
            raise ModelError(f"{count} {kind} are too many")
    step = _Step(problem, states, actions)
    start_codes, start_weights = step.start()
    codes = step.reachable(start_codes) if reachable else np.arange(states.count)
    before = states.decode(codes)
    S, A = len(codes), actions.count
    transition: list[_Entries] = []
    observation: list[_Entries] = []
    reward = np.zeros((A, S))
    for a in range(A):
        joint = step.transition(before, S, a)
        following = np.searchsorted(codes, step.states_after.encode(joint.values))
        transition.append(_sort_entries(S, joint.case, following, joint.weight))
        reward[a] = step.reward(joint, before, S, a)
        observed = step.observation(before, S, a)
        columns = np.broadcast_to(observations.encode(observed.values), observed.case.shape)
        observation.append(_sort_entries(S, observed.case, columns, observed.weight))
    # of a single variable all values are included, of several variables only combinations that occur
    single = len(observations.variables) == 1
    possible = [np.arange(observations.count)] if single else [np.unique(part[1]) for part in observation]
    columns = np.unique(np.concatenate(possible))
    start = np.zeros(S)
    start[np.searchsorted(codes, start_codes)] = start_weights
    return Pomdp(
        states.labels(codes),
        actions.labels(np.arange(A)),
        observations.labels(columns),
        _build_table(transition, np.arange(S)),
        _build_table(observation, columns),
        reward,
        problem.discount,
        start / start.sum() if abs(start.sum() - 1) > SUM_TOLERANCE else start,
        problem.file,
    )


def start_beliefs(problem: Factored, pomdp: Pomdp) -> Array:
    """Return (N, S) start beliefs, one for each initial value of the observed parts, the likeliest first.

    To solve for them bounds the value of a robot that observes before its first action; the start belief of
    the flat model is that before any observation.

    Args:
        pomdp: `flatten(problem)`.

    Examples:
        >>> from lcorpp.planning import Factored, flatten, start_beliefs
        >>> room = Factored.of(
        ...     states={"cup": "full empty", "lamp": "on off"}, observed="lamp", actions="wait",
        ...     start={"cup": "full", "lamp": "uniform"}, transition={"cup": "same", "lamp": "same"},
        ...     reward=1, discount=0.9,
        ... )
        >>> start_beliefs(room, flatten(room)).tolist()
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]
    """
    states = MixedRadix(problem.states)
    codes, weights = _Step(problem, states, MixedRadix(problem.actions)).start()
    observed = MixedRadix(problem.observed).encode(states.decode(codes))
    distinct, row = np.unique(np.broadcast_to(observed, codes.shape), return_inverse=True)
    beliefs: Array = np.zeros((len(distinct), len(pomdp.states)))
    beliefs[row.reshape(-1), [pomdp.state_index(name) for name in states.labels(codes)]] = weights
    probability = beliefs.sum(axis=1)
    order = np.argsort(-probability, kind="stable")
    return np.asarray(beliefs[order] / probability[order, None])


class _Step:
    """One step of the dynamic Bayesian network, for many states at once."""

    def __init__(self, problem: Factored, states: MixedRadix, actions: MixedRadix) -> None:
        self.problem, self.states, self.actions = problem, states, actions
        self.states_after = MixedRadix(problem.states, [v.name + AFTER for v in problem.states])

    def start(self) -> tuple[Numbers, Array]:
        """Return the codes of the possible start states, increasing, and their probabilities."""
        joint = Joint.of(1, {}).multiply(self.problem.start)
        codes = np.broadcast_to(self.states.encode(joint.values), joint.case.shape)
        order = np.argsort(codes)
        possible = order[joint.weight[order] > 0]
        return codes[possible], joint.weight[possible]

    def transition(self, before: Values, count: int, action: int) -> Joint:
        """Return the distribution of the next state for an action; the cases are the states `before`."""
        return Joint.of(count, {**self._action(action), **before}).multiply(self.problem.transition)

    def observation(self, after: Values, count: int, action: int) -> Joint:
        """Return the distribution of the observation after an action; the cases are the states `after`."""
        values = {name + AFTER: value for name, value in after.items()}
        return Joint.of(count, {**self._action(action), **values}).multiply(self.problem.observation)

    def reachable(self, start: Numbers) -> Numbers:
        """Return the codes of all states that are reachable from `start`, increasing."""
        codes = frontier = np.unique(start)
        while len(frontier):
            if len(codes) > MAX_STATES:
                raise ModelError(f"over {MAX_STATES} states can be reached: too many to be written out")
            before = self.states.decode(frontier)
            joints = [self.transition(before, len(frontier), a) for a in range(self.actions.count)]
            following = [np.unique(self.states_after.encode(joint.values)) for joint in joints]
            frontier = np.setdiff1d(np.concatenate(following), codes)
            codes = np.union1d(codes, frontier)
        return codes

    def reward(self, joint: Joint, before: Values, count: int, action: int) -> Array:
        """Return (n,) the expected immediate reward; `joint` is the distribution of the next state."""
        cases = Joint.of(count, {**self._action(action), **before})
        total = np.zeros(count)
        for table in self.problem.reward.values():
            if all(name in cases.values for name in table.parents):
                total += cases.mean(table, count)
            else:
                observed = joint.multiply(_find_ancestors(self.problem.observation, table.parents))
                total += observed.mean(table, count)
        return total

    def _action(self, action: int) -> dict[str, Numbers]:
        return self.actions.decode(np.array(action))


def _sort_entries(rows: int, row: Numbers, column: Numbers, value: Array) -> _Entries:
    """Return the row sizes, columns and values of entries in non-decreasing rows, without zeros."""
    positive = value > 0
    if not positive.all():
        row, column, value = row[positive], column[positive], value[positive]
    if not ((np.diff(row) > 0) | (np.diff(column) > 0)).all():
        order = np.lexsort((column, row))
        column, value = column[order], value[order]
    return np.bincount(row, minlength=rows), column, value


def _build_table(actions: Sequence[_Entries], columns: Numbers) -> SparseTables:
    """Return the table of these columns; rows with accumulated rounding errors are normalised."""
    sizes, column, value = (np.concatenate(part) for part in zip(*actions, strict=True))
    shape = (len(actions), len(sizes) // len(actions), len(columns))
    places = np.searchsorted(columns, column).astype(np.int32)
    table = SparseTables(shape, np.concatenate([[0], np.cumsum(sizes)]), places, value)
    sums = table.row_sums()
    off = np.abs(sums - 1) > SUM_TOLERANCE
    return table.scale_rows(np.where(off, 1 / sums, 1.0)) if off.any() else table


def _find_ancestors(tables: Sequence[Table], names: Iterable[str]) -> Iterator[Table]:
    """Yield the tables of some children and of all that they depend on, in order."""
    needed = set(names)
    for table in reversed(tables):
        if needed.intersection(table.children):
            needed.update(table.parents)
    return (table for table in tables if needed.intersection(table.children))
