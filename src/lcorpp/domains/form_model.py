"""The planner's model with the memory of a form of answers in its states."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.domains.domain import Domain
from lcorpp.errors import TooLargeError
from lcorpp.planning import AlphaVectors, Policy, Pomdp, SparseTables
from lcorpp.protocols import Memory, Starts
from lcorpp.trust.forms import AnswerForm
from lcorpp.values import Array, Belief, Indices

MAX_STATES = 200
"""Maximum number of states of the model: the policy is searched anew while the robot works."""


class _Branch(NamedTuple):
    """A step of the model: what is observed, where it leads, and the cell of tables that has its probability.

    probability: P(s' | s, a). cell, value: of tables; -1 if the observations are as stated.
    """

    action: int
    state: int
    successor: int
    probability: float
    cell: int
    value: int
    observation: int


class FormModel:
    """The planner's model in which a state has the memory of the questions, too.

    states: (X, 2) the planner's state and the index of the memory of each state that can be reached.
    memories: all pairs of a person's class and the form's memory, first those before the first question;
    terminal states have the first one.

    Args:
        max_states: maximum number of states.

    Raises:
        TooLargeError: there are more.
    """

    def __init__(
        self, domain: Domain, dialogue: DomainDialogue, form: AnswerForm, *, max_states: int = MAX_STATES
    ) -> None:
        self._domain, self._dialogue, self.form, self._max_states = domain, dialogue, form, max_states
        self._terminal = set(domain.planning.terminal)
        self._value_of = domain.planning.state_values.argmax(axis=1)
        begin = form.begin(len(dialogue.tables))
        self.memories = [(c, begin) for c in range(form.n_classes)]
        self._memory_index = {memory: m for m, memory in enumerate(self.memories)}
        self._index = dict[tuple[int, int], int]()
        self._branches = list[_Branch]()
        self._explore()
        self.states = self._sort_states()

    def place(self, belief: Belief, shares: Array) -> Belief:
        """Return (X,) the belief (S,) about a person who was not asked yet.

        Args:
            shares: (C,) P(class of the person).
        """
        placed: Belief = (shares @ self._begins) * belief[self.states[:, 0]]
        return placed

    def place_known(self, belief: Belief, starts: Starts) -> Belief:
        """Return (X,) the belief (S,) about a person whose class and memory are known in part.

        Each state's probability is divided by P(class, memory | its value).
        """
        joint = dict[int, Array]()
        for memory, own in starts:
            own_memory = self.memories[0][1] if memory is None else memory
            for c, row in enumerate(own.reshape(self.form.n_classes, -1)):
                key = self._memory_index[c, own_memory]
                joint[key] = joint[key] + row if key in joint else row
        total = np.maximum(np.sum(list(joint.values()), axis=0), np.finfo(np.float64).tiny)
        weights = np.zeros((len(self.memories), len(total)))
        for m, row in joint.items():
            weights[m] = row / total
        base, memories = self.states.T
        own_weights = np.where(self._is_terminal, 1.0, weights[memories, self._value_of[base]])
        placed: Belief = own_weights * belief[base]
        return placed

    def restart(self, memory: Memory) -> Memory:
        """Return the part of a memory at the end of a conversation with which another one may start.

        A question that cannot be asked from the initial state, with what was answered before, is forgotten.
        """
        initial = np.flatnonzero(self._domain.planning.initial_states.any(axis=0)).tolist()
        kept = self.memories[0][1]
        for k, part in enumerate(memory):
            longer = (*kept[:k], part, *kept[k + 1 :])
            found = [self._memory_index.get((c, longer)) for c in range(self.form.n_classes)]
            if all(m is not None and (s, m) in self._reached for s in initial for m in found):
                kept = longer
        return kept

    @cached_property
    def _reached(self) -> set[tuple[int, int]]:
        """The planner's state and the index of the memory of each state."""
        return {(s, m) for s, m in self.states.tolist()}

    def collapse(self, belief: Belief) -> Belief:
        """Return (S,) the belief (X,) without the memory."""
        n_states = len(self._domain.pomdp.states)
        collapsed: Belief = np.bincount(self.states[:, 0], belief, minlength=n_states).astype(np.float64)
        return collapsed

    def lift(self, policy: Policy, model: Pomdp) -> Policy:
        """Return a policy of the stated model that ignores the memory, as one of this model."""
        places = self.states[:, 0]
        sets = []
        for part in policy.vector_sets:
            own = np.flatnonzero(np.isin(places, part.states))
            columns = np.searchsorted(part.states, places[own])
            sets.append(AlphaVectors(own, part.vectors[:, columns], part.actions))
        return Policy.of_sets(model, sets)

    def make_model(self, tables: Array) -> Pomdp:
        """Return the model with tables (K', V, O) of P(observation | value) for each copy of a kind."""
        base, (a, x, y, p, cells, values, seen) = self._domain.pomdp, self._columns
        n, shape = len(self.states), (len(base.actions), len(self.states), len(base.observations))
        has_cell = cells >= 0
        chances = p.copy()
        chances[has_cell] *= tables[cells[has_cell], values[has_cell], seen[has_cell]]
        transition = np.zeros((shape[0], n, n))
        np.add.at(transition, (a, x, y), chances)
        transition /= transition.sum(axis=2, keepdims=True)
        observation = self.make_observation(tables, base.observation.dense)
        names = [f"{base.states[s]}_{m}" for s, m in self.states.tolist()]
        return replace(
            base,
            states=tuple(names),
            transition=SparseTables.of(transition),
            observation=SparseTables.of(observation),
            reward=base.reward[:, self.states[:, 0]],
            start=self.place(base.start, np.full(self.form.n_classes, 1 / self.form.n_classes)),
        )

    def make_observation(self, tables: Array, others: Array) -> Array:
        """Return (A, X, O) P(observation | action, state after it).

        Args:
            tables: as of `make_model`. others: (A, S, O) of observations that are no answers.
        """
        a, _, y, _, cells, values, seen = self._columns
        has_cell = cells >= 0
        observation = others[:, self.states[:, 0]].copy()
        own = has_cell & ~self._is_certain
        observation[a[has_cell], y[has_cell]] = 0
        observation[a[own], y[own], seen[own]] = tables[cells[own], values[own], seen[own]]
        observation[a[self._is_certain], y[self._is_certain], seen[self._is_certain]] = 1
        observation /= observation.sum(axis=2, keepdims=True)
        return observation

    @cached_property
    def _begins(self) -> Array:
        """(C, X) 1 for the states of a person of each class who was not asked yet, and for terminal ones."""
        own: Array = (self.states[:, 1] == np.arange(self.form.n_classes)[:, None]) | self._is_terminal
        return own.astype(np.float64)

    @cached_property
    def _is_terminal(self) -> npt.NDArray[np.bool_]:
        """(X,) whether a state is terminal."""
        found: npt.NDArray[np.bool_] = np.isin(self.states[:, 0], list(self._terminal))
        return found

    @cached_property
    def _columns(self) -> tuple[Indices, Indices, Indices, Array, Indices, Indices, Indices]:
        columns = list(zip(*self._branches, strict=True))
        a, x, y, p, cells, values, seen = (np.array(own) for own in columns)
        return a, x, y, p, cells, values, seen

    @cached_property
    def _is_certain(self) -> npt.NDArray[np.bool_]:
        """(branches,) whether the next memory contains the answer, so that the state determines it."""
        steps = [own[:3] for own in self._branches]
        counts = Counter(steps)
        alone: npt.NDArray[np.bool_] = np.array([counts[step] == 1 for step in steps])
        return alone & (self._columns[4] >= 0)

    def _explore(self) -> None:
        """Find all states that can be reached, and the branches between them."""
        base = self._domain.pomdp
        initial = self._domain.planning.initial_states.any(axis=0) | (base.start > 0)
        is_terminal = np.isin(np.arange(len(initial)), list(self._terminal))
        waiting = [
            (s, 0 if is_terminal[s] else c)
            for c in range(self.form.n_classes)
            for s in np.flatnonzero(initial).tolist()
            if c == 0 or not is_terminal[s]
        ]
        for start in waiting:
            self._index[start] = len(self._index)
        while waiting:
            state, memory = waiting.pop()
            for action in range(len(base.actions)):
                for successor, after, branch in self._list_branches(action, state, memory):
                    key = successor, after
                    if key not in self._index:
                        self._index[key] = len(self._index)
                        waiting.append(key)
                        if len(self._index) > self._max_states:
                            raise TooLargeError(
                                f"the model with the form of answers {self.form.name!r} has more than"
                                f" {self._max_states} states"
                            )
                    own = self._index[state, memory]
                    self._branches.append(branch._replace(state=own, successor=self._index[key]))

    def _sort_states(self) -> Indices:
        """Number the states by memory, then as the planner does; return them.

        So the states of each value have the same order (`DomainDialogue`).
        """
        found: Indices = np.array(list(self._index), np.intp).reshape(-1, 2)
        order = np.lexsort((found[:, 0], found[:, 1]))
        number = np.empty(len(order), np.intp)
        number[order] = np.arange(len(order))
        self._branches = [
            own._replace(state=int(number[own.state]), successor=int(number[own.successor]))
            for own in self._branches
        ]
        return found[order]

    def _list_branches(self, action: int, state: int, memory: int) -> Iterator[tuple[int, int, _Branch]]:
        """Yield for each step the next state, the index of its memory, and the branch."""
        states, probabilities = self._domain.pomdp.transition.row(action, state)
        for successor, p in zip(states.tolist(), probabilities.tolist(), strict=True):
            if p <= 0:
                continue
            branch = _Branch(action, 0, 0, p, -1, -1, -1)
            kind = self._dialogue.kind_of_state.get((action, successor))
            if successor in self._terminal:
                yield successor, 0, branch
            elif kind is None:
                yield successor, memory, branch
            else:
                c, own = self.memories[memory]
                copy = self.form.find_copy(own, kind)
                cell = (kind * self.form.n_copies + copy) * self.form.n_classes + c
                value = int(self._value_of[successor])
                table = self._dialogue.tables[kind]
                for observation in np.flatnonzero(table.any(axis=0)).tolist():
                    after = self._find_or_add((c, self.form.advance(own, kind, observation)))
                    yield (
                        successor,
                        after,
                        branch._replace(cell=cell, value=value, observation=observation),
                    )

    def _find_or_add(self, memory: tuple[int, Memory]) -> int:
        index = self._memory_index.setdefault(memory, len(self._memory_index))
        if index == len(self.memories):
            self.memories.append(memory)
        return index
