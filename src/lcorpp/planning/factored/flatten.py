"""From variables to one state, one action and one observation.

All states of an action are worked out at once, and only what has a probability above 0 is held.
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
"""For n states, the numbers (n,) of the values of each variable."""

MOST_STATES = 2**24
"""The most states written out: beyond it not even their names fit into memory."""

MOST_CODES = 2**62
"""The most combinations that a number can tell apart."""


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
    """
    states, actions = MixedRadix(problem.states), MixedRadix(problem.actions)
    seen = MixedRadix(
        (*problem.observed, *problem.observations),
        [*(variable.name + AFTER for variable in problem.observed), *(v.name for v in problem.observations)],
    )
    if not reachable and MOST_STATES < states.count <= MOST_CODES:
        raise ModelError(f"{states.count} states are too many to be written out; see `reachable`")
    for kind, count, most in (
        ("states", states.count, MOST_CODES),
        ("actions", actions.count, MOST_STATES),
        ("observations", seen.count, MOST_CODES),
    ):
        if count > most:
            raise ModelError(f"{count} {kind} are too many")
    step = _Step(problem, states, actions)
    begin, chance = step.start()
    known = step.reached(begin) if reachable else np.arange(states.count)
    now = states.values(known)
    S, A = len(known), actions.count
    moves, views = _Entries(A, S), _Entries(A, S)
    reward = np.zeros((A, S))
    for a in range(A):
        joint = step.after(now, S, a)
        moves.add(joint.case, np.searchsorted(known, step.next.of(joint.values)), joint.weight)
        reward[a] = step.reward(joint, now, S, a)
        looks = step.looks(now, S, a)
        views.add(looks.case, np.broadcast_to(seen.of(looks.values), looks.case.shape), looks.weight)
    # of one variable alone all values are there, as in any table; of several what occurs together
    occurring = np.arange(seen.count) if len(seen.variables) == 1 else views.columns()
    start = np.zeros(S)
    start[np.searchsorted(known, begin)] = chance
    return Pomdp(
        states.labels(known),
        actions.labels(np.arange(A)),
        seen.labels(occurring),
        moves.rows(np.arange(S)),
        views.rows(occurring),
        reward,
        problem.discount,
        start / start.sum() if abs(start.sum() - 1) > SUM_TOLERANCE else start,
        problem.file,
    )


def start_beliefs(problem: Factored, pomdp: Pomdp) -> Array:
    """(N, S) start beliefs, one for each initial observation of the observed parts, the likeliest first.

    To solve for them bounds the value of a robot that observes before its first action; the start belief of
    the flat model is that before any observation.

    Args:
        pomdp: `flatten(problem)`.
    """
    code = MixedRadix(problem.states)
    begin, chance = _Step(problem, code, MixedRadix(problem.actions)).start()
    seen = np.broadcast_to(MixedRadix(problem.observed).of(code.values(begin)), begin.shape)
    kinds, kind = np.unique(seen, return_inverse=True)
    beliefs: Array = np.zeros((len(kinds), len(pomdp.states)))
    beliefs[kind.reshape(-1), [pomdp.state_index(name) for name in code.labels(begin)]] = chance
    share = beliefs.sum(axis=1)
    order = np.argsort(-share, kind="stable")
    return np.asarray(beliefs[order] / share[order, None])


class _Step:
    """One step of the network, for many states at once."""

    def __init__(self, problem: Factored, states: MixedRadix, actions: MixedRadix) -> None:
        self.problem, self.states, self.actions = problem, states, actions
        self.next = MixedRadix(problem.states, [variable.name + AFTER for variable in problem.states])

    def start(self) -> tuple[Numbers, Array]:
        """The states that are possible at the start, rising, and their probabilities."""
        joint = Joint.of(1, {}).multiply(self.problem.start)
        code = np.broadcast_to(self.states.of(joint.values), joint.case.shape)
        order = np.argsort(code)
        possible = order[joint.weight[order] > 0]
        return code[possible], joint.weight[possible]

    def after(self, now: Values, count: int, action: int) -> Joint:
        """What an action leads to from states given by the values of their variables; they are the cases."""
        return Joint.of(count, {**self._action(action), **now}).multiply(self.problem.transition)

    def looks(self, after: Values, count: int, action: int) -> Joint:
        """What is observed in states reached by an action."""
        values = {name + AFTER: value for name, value in after.items()}
        return Joint.of(count, {**self._action(action), **values}).multiply(self.problem.observation)

    def reached(self, begin: Numbers) -> Numbers:
        """All states that can be reached from some, with them, rising."""
        known = edge = np.unique(begin)
        while len(edge):
            if len(known) > MOST_STATES:
                raise ModelError(f"over {MOST_STATES} states can be reached: too many to be written out")
            now = self.states.values(edge)
            after = [self.after(now, len(edge), a) for a in range(self.actions.count)]
            found = [np.unique(self.next.of(joint.values)) for joint in after]
            edge = np.setdiff1d(np.concatenate(found), known)
            known = np.union1d(known, edge)
        return known

    def reward(self, joint: Joint, now: Values, count: int, action: int) -> Array:
        """(n,) the expected immediate reward of an action in states; `joint` is what comes after."""
        cases = Joint.of(count, {**self._action(action), **now})
        total = np.zeros(count)
        for table in self.problem.reward.values():
            if all(name in cases.values for name in table.parents):
                total += cases.mean(table, count)
            else:
                total += joint.multiply(_needed(self.problem.observation, table.parents)).mean(table, count)
        return total

    def _action(self, action: int) -> dict[str, Numbers]:
        return self.actions.values(np.array(action))


class _Entries:
    """A table (A, R, N) while its entries are found, one action after the other."""

    def __init__(self, actions: int, rows: int) -> None:
        self.actions, self.height = actions, rows
        self._parts: list[tuple[Numbers, Numbers, Array]] = []  # of each action: per row, columns, values

    def add(self, row: Numbers, column: Numbers, value: Array) -> None:
        """The entries of the next action, by rising row."""
        kept = value > 0
        if not kept.all():
            row, column, value = row[kept], column[kept], value[kept]
        if not ((np.diff(row) > 0) | (np.diff(column) > 0)).all():
            order = np.lexsort((column, row))
            column, value = column[order], value[order]
        self._parts.append((np.bincount(row, minlength=self.height), column, value))

    def columns(self) -> Numbers:
        """The columns with entries, rising."""
        return np.unique(np.concatenate([np.unique(column) for _, column, _ in self._parts]))

    def rows(self, columns: Numbers) -> SparseTables:
        """The table of these columns. Tables that are right up to rounding may be further off multiplied."""
        counts = np.concatenate([np.zeros(1, dtype=np.int64), *(count for count, _, _ in self._parts)])
        table = SparseTables(
            (self.actions, self.height, len(columns)),
            np.cumsum(counts),
            np.concatenate(
                [np.searchsorted(columns, column).astype(np.int32) for _, column, _ in self._parts]
            ),
            np.concatenate([value for _, _, value in self._parts]),
        )
        sums = table.row_sums()
        off = np.abs(sums - 1) > SUM_TOLERANCE
        return table.scale_rows(np.where(off, 1 / sums, 1.0)) if off.any() else table


def _needed(tables: Sequence[Table], names: Iterable[str]) -> Iterator[Table]:
    """The tables of those names that are children, and all that they depend on, in order."""
    wanted = set(names)
    for table in reversed(tables):
        if wanted.intersection(table.children):
            wanted.update(table.parents)
    return (table for table in tables if wanted.intersection(table.children))
