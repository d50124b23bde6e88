"""A domain's POMDP as questions about the shared variables (`lcorpp.protocols.Dialogue`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from lcorpp.domains.domain import Domain
from lcorpp.domains.information import compute_information
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.planning import Pomdp, SparseTables
from lcorpp.protocols import Memory, Planner, Starts
from lcorpp.values import Array

Situation = tuple[int, ...]
"""An assignment of the planner's own variables, as the state that it gives with each shared value."""

MIN_INFORMATION = 1e-6
"""In nats: an action with less information is not a question."""

MIN_COST = 1e-6
"""Smallest cost of a question, in reward units, that counts."""


MakeModel = Callable[[Array], Pomdp]
"""Returns the planner's model with tables (K, V, O) of P(observation | value)."""


class PlannerFactory(Protocol):
    """Makes the planner of each estimated model; it may depend on the models before."""

    def __call__(self, tables: Array, make_model: MakeModel, /) -> Planner:
        """Return the planner of the next person; cheap if the tables are those of the call before."""

    def state(self) -> dict[str, Any]:
        """Return the state as JSON."""

    def restore(self, state: Mapping[str, Any], make_model: MakeModel, /) -> Planner:
        """Continue from a state of a factory with the same arguments; return the planner of the last call."""


class DomainDialogue:
    """The questions of a domain.

    A situation is one state for each shared value. From the initial one, an action and its observation must
    determine the next situation, e.g. whether the robot has turned, whatever the shared value is.

    kind_of: action and situation after it -> the kind of question.

    Args:
        planners: makes the planners, e.g. `lcorpp.assembly.strategies.replanning.Replanner`; None for a
            dialogue that only reads answers.

    Raises:
        DomainError: the actions and observations do not determine the situation; the dynamics of the
            planner's own variables depend on the shared value; or no observation depends on it.
    """

    def __init__(self, domain: Domain, planners: PlannerFactory | None = None) -> None:
        self._domain, self.planners = domain, planners
        pomdp = domain.pomdp
        self._index = {
            "action": {name: a for a, name in enumerate(pomdp.actions)},
            "observation": {name: o for o, name in enumerate(pomdp.observations)},
        }
        self._start = self._find_start()
        self._transitions: dict[tuple[Situation, int, int], tuple[Situation, int | None]] = {}
        self._questions = list[tuple[int, Situation]]()  # kind -> action and a situation with its rows
        self._kinds: dict[tuple[int, bytes], int] = {}
        self.kind_of: dict[tuple[int, Situation], int] = {}
        self._explore()
        if not self._questions:
            raise DomainError(
                f"{domain.pomdp.file or domain.folder}: no observation depends on the shared variables, so"
                " trust has nothing to learn from"
            )

    @property
    def _make_planners(self) -> PlannerFactory:
        assert self.planners is not None, "a dialogue that only reads answers makes no planner"
        return self.planners

    @cached_property
    def tables(self) -> Array:
        """(K, V, O) the stated P(observation | value) of each kind of question."""
        return self.find_tables(self._domain.pomdp.observation.dense)

    def find_tables(self, observation: Array) -> Array:
        """Return (K, V, O) P(observation | value) of each kind of question, from the states' (A, S, O)."""
        return np.array([observation[action, list(situation)] for action, situation in self._questions])

    @cached_property
    def questions(self) -> tuple[str, ...]:
        """(K,) the action of each kind; if there are several of one action, also a state after it."""
        pomdp = self._domain.pomdp
        names = [pomdp.actions[action] for action, _ in self._questions]
        return tuple(
            name if names.count(name) == 1 else f"{name} in {pomdp.states[situation[0]]}"
            for name, (_, situation) in zip(names, self._questions, strict=True)
        )

    @cached_property
    def question(self) -> str | None:
        """The action with the most information about the shared value for its cost; None for none.

        The information is that of the stated model, at the first action and a uniform distribution of the
        values.
        """
        pomdp = self._domain.pomdp
        start = self._domain.planning.initial_states.mean(axis=0)
        information = compute_information(self._domain, start)
        values = information / np.maximum(-pomdp.reward @ start, MIN_COST)
        values[information <= MIN_INFORMATION] = 0
        best = int(values.argmax())
        return pomdp.actions[best] if values[best] > 0 else None

    @cached_property
    def question_cost(self) -> float:
        """The cost of `question` at the first action and a uniform distribution of the values."""
        pomdp, start = self._domain.pomdp, self._domain.planning.initial_states.mean(axis=0)
        if self.question is None:
            return 0.0
        return max(0.0, -float(pomdp.reward[pomdp.action_index(self.question)] @ start))

    def find_answers(self, history: Sequence[tuple[str, str]], memory: Memory | None = None) -> list[int]:
        """Return k * O + o for each question of kind k and its answer o; answers do not depend on a memory.

        Raises:
            DomainError: an action or observation is unknown, or impossible at this point.
        """
        situation, answers = self._start, list[int]()
        n_observations = len(self._index["observation"])
        for action, observation in history:
            a, o = self._find("action", action), self._find("observation", observation)
            found = self._transitions.get((situation, a, o))
            if found is None:
                raise DomainError(f"the observation {observation!r} is impossible after {action!r}")
            situation, kind = found
            if kind is not None:
                answers.append(kind * n_observations + o)
        return answers

    def find_memory(self, history: Sequence[tuple[str, str]], memory: Memory | None = None) -> Memory | None:
        """Return None: nothing is remembered."""
        return None

    def start_known(self, planner: Planner, find_starts: Callable[[], Starts]) -> Planner:
        """Return the planner: its belief about a person is the prior, known or not."""
        return planner

    def make_planner(self, tables: Array, shares: Array | None = None) -> Planner:
        """Return the planner for the model with these tables (K, V, O); people have one class."""
        return self._make_planners(tables, self.make_model)

    def state(self) -> dict[str, Any]:
        """Return the state of the planners as JSON."""
        return self._make_planners.state()

    def restore(self, state: Mapping[str, Any]) -> Planner:
        """Continue from the state of a dialogue of the same domain; return the planner of the last person."""
        return self._make_planners.restore(state, self.make_model)

    def make_model(self, tables: Array) -> Pomdp:
        """Return the planner's model with these tables (K, V, O)."""
        pomdp = self._domain.pomdp
        observation = pomdp.observation.dense.copy()
        for (action, situation), kind in self.kind_of.items():
            observation[action, list(situation)] = tables[kind]
        return replace(pomdp, observation=SparseTables.of(observation))

    @cached_property
    def kind_of_state(self) -> Mapping[tuple[int, int], int]:
        """Indices of an action and the state after it -> the kind of question; none if it is no question."""
        return {(action, state): kind for (action, states), kind in self.kind_of.items() for state in states}

    def _find(self, kind: str, name: str) -> int:
        known = self._index[kind]
        if name not in known:
            raise DomainError(f"unknown {kind} {name!r}; {expected_one_of(known)}")
        return known[name]

    def _find_start(self) -> Situation:
        initial = self._domain.planning.initial_states
        if (np.count_nonzero(initial, axis=1) != 1).any():
            raise self._make_error("the planner's own variables have no certain initial value")
        return tuple(initial.argmax(axis=1).tolist())

    def _explore(self) -> None:
        """Find all situations, the transitions between them, and the kinds of questions."""
        domain, pomdp = self._domain, self._domain.pomdp
        questions = [a for a, name in enumerate(pomdp.actions) if domain.reported_value(name) is None]
        waiting, known = [self._start], {self._start}
        while waiting:
            situation = waiting.pop()
            for a in questions:
                for successor in self._list_successors(situation, a):
                    if self._is_terminal(successor):
                        continue
                    table = pomdp.observation.dense[a, list(successor)]  # (V, O)
                    kind = self._add_kind(a, successor, table)
                    for o in np.flatnonzero(table.any(axis=0)).tolist():
                        key = situation, a, o
                        if self._transitions.get(key, (successor,))[0] != successor:
                            raise self._make_error(
                                f"after {pomdp.actions[a]!r} and {pomdp.observations[o]!r} the planner's own"
                                " variables may have several values"
                            )
                        self._transitions[key] = successor, kind
                    if successor not in known:
                        known.add(successor)
                        waiting.append(successor)

    def _list_successors(self, situation: Situation, action: int) -> list[Situation]:
        """Return the situations that may follow; the k-th successors of all values belong together."""
        pomdp, successors, rows = self._domain.pomdp, list[list[int]](), list[list[float]]()
        for state in situation:
            states, probabilities = pomdp.transition.row(action, state)
            order = sorted(zip(map(self._rank, states.tolist()), states.tolist(), probabilities, strict=True))
            successors.append([s for _, s, p in order if p > 0])
            rows.append([float(p) for *_, p in order if p > 0])
        if any(len(c) != len(rows[0]) or not np.allclose(c, rows[0]) for c in rows):
            raise self._make_error(
                f"the effect of {pomdp.actions[action]!r} on the planner's own variables depends on the"
                " shared value"
            )
        return list(zip(*successors, strict=True))

    def _rank(self, state: int) -> int:
        """Return the position of a state among those of its shared value."""
        return int(self._ranks[state])

    @cached_property
    def _ranks(self) -> Array:
        values = self._domain.planning.state_values
        ranks: Array = ((np.cumsum(values, axis=0) - 1) * values).sum(axis=1)
        return ranks

    def _is_terminal(self, situation: Situation) -> bool:
        return set(situation) <= set(self._domain.planning.terminal)

    def _add_kind(self, action: int, situation: Situation, table: Array) -> int | None:
        """Return the kind of a question; None if its observations do not depend on the value."""
        if np.ptp(table, axis=0).max() == 0:
            return None
        key = action, table.tobytes()
        if key not in self._kinds:
            self._kinds[key] = len(self._questions)
            self._questions.append((action, situation))
        self.kind_of[action, situation] = self._kinds[key]
        return self._kinds[key]

    def _make_error(self, reason: str) -> DomainError:
        domain = self._domain
        return DomainError(f"{domain.pomdp.file or domain.folder}: {reason}; the dialogue cannot be followed")
