"""COMPRESS: replace the alpha vectors by those of a finite-state controller with fewer plans.

Sources: Hansen, "Solving POMDPs by searching in policy space", UAI 1998 (controllers and their values);
Grzes, Poupart, Yang and Hoey, "Energy efficient execution of POMDP policies", IEEE Transactions on
Cybernetics 2015 (controllers made of alpha vectors).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from time import monotonic

import numpy as np

from lcorpp.interrupts import delay_sigint
from lcorpp.planning.sarsop.numpy_kernels.alpha_vectors import VectorSet
from lcorpp.planning.sarsop.numpy_kernels.backup import combine
from lcorpp.planning.sarsop.numpy_kernels.dependencies import Edge, PrunedVector
from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch
from lcorpp.planning.sarsop.numpy_kernels.node import BeliefNode, compute_outcomes
from lcorpp.planning.sarsop.numpy_kernels.pruning import find_reachable
from lcorpp.planning.sarsop.numpy_kernels.refresh import update_best_vector
from lcorpp.planning.sarsop.numpy_kernels.search_state import MIN_GAIN, SearchState
from lcorpp.values import Array, Indices

REACHED_WEIGHT = 0.1
"""Initial weight of all beliefs that the roots reach, relative to that of a root."""

MAX_MISSING = 1e-2
"""The occupancy is accurate enough if at most this share of it is missing, or after `MAX_PASSES`."""

MAX_PASSES = 10

MIN_RISE = 1e-7
"""Smallest rise of a value that is passed on, relative to `max_abs_value`."""

ROUNDING = 1e-14
"""Largest rounding error of a value, relative to `max_abs_value`."""


@dataclass(eq=False)
class Plan:
    """A plan of the controller: an action, then the plan of the observation.

    values: (n,) over the states of the group. next: by observation the number of a plan; none if blind.
    arriving, occupancy: (n,) discounted visits of each state: not passed on yet, and all.
    evaluated, changed: number of the last evaluation, and of the last change.
    """

    stamp: int
    group: int
    action: int
    values: Array
    pruned: bool = False
    next: dict[int, int] = field(default_factory=dict)
    arriving: Array = field(init=False)
    occupancy: Array = field(init=False)
    evaluated: int = 0
    changed: int = 0

    def __post_init__(self) -> None:
        self.arriving, self.occupancy = np.zeros(len(self.values)), np.zeros(len(self.values))


class Controller:
    """The vectors of the sets and those that they depend on, as plans by falling stamps.

    Blind policies are plans only if others lead to them.
    """

    def __init__(self, state: SearchState, seconds: float) -> None:
        self._state, self._deadline = state, monotonic() + seconds
        self._plans: list[Plan] = []
        for group, vectors in enumerate(state.sets):
            for column in range(int((vectors.stamps < state.model.actions).sum()), vectors.count):
                self._add(group, vectors, column)
        for pruned in state.dependencies.pruned():
            self._plans.append(Plan(pruned.stamp, pruned.group, pruned.action, pruned.values, pruned=True))
        self._plans.sort(key=lambda plan: plan.stamp, reverse=True)
        self._number_of = {(plan.stamp, plan.group): i for i, plan in enumerate(self._plans)}
        for plan in self._plans.copy():
            edges = state.dependencies.edges(plan.stamp)
            plan.next = {edge.observation: self._find_plan(edge.vector, edge.group) for edge in edges}

    def replace_pruned(self, roots: Sequence[int]) -> None:
        """Replace pruned vectors by vectors of the sets that are no worse for the plans of the roots."""
        self._find_occupancy(roots)
        replacement = [self._find_replacement(i) for i in range(len(self._plans))]
        replacement += range(len(replacement), len(self._plans))  # blind policies that were added
        retained = [
            i for i, plan in enumerate(self._plans) if not plan.pruned and not self._is_blind(plan.stamp)
        ]
        visited = set(retained)
        for number in retained:  # the loop body appends
            plan = self._plans[number]
            plan.changed = int(any(replacement[n] != n for n in plan.next.values()))
            plan.next = {observation: replacement[n] for observation, n in plan.next.items()}
            retained.extend(n for n in dict.fromkeys(plan.next.values()) if n not in visited)
            visited.update(plan.next.values())
        new_number = {number: i for i, number in enumerate(sorted(retained))}
        self._plans = [self._plans[number] for number in new_number]
        for plan in self._plans:
            plan.next = {observation: new_number[n] for observation, n in plan.next.items()}

    def evaluate(self, max_evaluations: float) -> float:
        """Compute the values of the plans, with at most about `max_evaluations` vectors.

        If no value falls when all plans are backed up, the values are lower bounds. If one falls by d, they
        are after all have been lowered by d / (1 - gamma).

        Returns:
            By how much the values may exceed those of the controller; infinity if time is up.
        """
        state = self._state
        scale, gamma = state.max_abs_value, state.model.discount
        min_fall, min_rise = max(MIN_GAIN * (1 - gamma), ROUNDING) * scale, MIN_RISE * scale
        evaluations, any_changed = 1, True
        while any_changed and evaluations < max_evaluations:
            any_changed = False
            for plan in self._plans_to_back_up():
                changed = 0 if plan.evaluated else plan.changed
                changed = max([changed, *(self._plans[n].changed for n in plan.next.values())])
                if changed <= plan.evaluated:
                    continue
                values = self._back_up(plan)
                evaluations += 1
                plan.evaluated = evaluations
                change = values - plan.values
                if change.min() < -min_fall or change.max() > min_rise:
                    plan.changed, any_changed = evaluations + 1, True
                plan.values = values
        falls = [float((plan.values - self._back_up(plan)).max()) for plan in self._plans_to_back_up()]
        excess = max([0.0, *falls]) / (1 - gamma)
        return np.inf if self._is_late() else excess

    def value(self, node: BeliefNode, excess: float) -> float:
        """Return the value at a node if all values are lowered by `excess`."""
        belief, vectors = node.belief, self._state.sets[node.belief.group]
        blind = vectors.values(belief)[0, vectors.stamps < self._state.model.actions]
        plans = [
            plan
            for plan in self._plans
            if plan.group == belief.group and not plan.pruned and not self._is_blind(plan.stamp)
        ]
        values = [belief.weights[0] @ plan.values[belief.positions] - excess for plan in plans]
        return float(max([*blind, *values]))

    def install(self, excess: float) -> None:
        """Replace the vectors of the search, lowered by `excess`."""
        state, stamps = self._state, [plan.stamp for plan in self._plans]
        for vectors in state.sets:
            vectors.keep(vectors.stamps < state.model.actions)
        state.dependencies.clear()
        for number in reversed(range(len(self._plans))):
            if not self._is_blind(self._plans[number].stamp):
                stamps[number] = state.next_vector
                state.next_vector += 1
        for number, plan in reversed(list(enumerate(self._plans))):
            if self._is_blind(plan.stamp):
                continue
            edges = [Edge(o, self._plans[n].group, stamps[n]) for o, n in plan.next.items()]
            state.dependencies.record(stamps[number], edges)
            values = plan.values - excess
            if plan.pruned:
                pruned = PrunedVector(stamps[number], plan.group, plan.action, values)
                state.dependencies.record_pruned_vector(pruned)
            else:
                state.sets[plan.group].add(values, plan.action, stamps[number])

    def _add(self, group: int, vectors: VectorSet, column: int) -> None:
        stamp, action = int(vectors.stamps[column]), int(vectors.actions[column])
        self._plans.append(Plan(stamp, group, action, vectors.table[:, column].copy()))

    def _find_plan(self, stamp: int, group: int) -> int:
        """Return the number of the plan of a vector; a blind policy is added."""
        if (stamp, group) not in self._number_of:
            self._number_of[stamp, group] = len(self._plans)
            self._add(group, self._state.sets[group], self._state.sets[group].find(stamp))
        return self._number_of[stamp, group]

    def _is_blind(self, stamp: int) -> bool:
        return stamp < self._state.model.actions

    def _is_late(self) -> bool:
        return monotonic() >= self._deadline

    def _plans_to_back_up(self) -> Iterator[Plan]:
        """Yield all plans but the blind ones, the older, on which others depend, first."""
        for plan in reversed(self._plans):
            if not self._is_blind(plan.stamp) and not self._is_late():
                yield plan

    def _find_occupancy(self, roots: Sequence[int]) -> None:
        """Compute the discounted visits of each state under each plan.

        The roots and the beliefs that they reach start with their best plans. Edges mostly lead to older
        plans, so that few passes by falling stamps suffice.
        """
        state, reachable = self._state, find_reachable(self._state, roots)
        starts = [(number, REACHED_WEIGHT / len(reachable)) for number in reachable]
        for number, weight in [*starts, *((root, 1.0) for root in roots)]:
            node = state.nodes[number]
            update_best_vector(state, node)
            if self._is_blind(node.best_vector):
                continue
            plan = self._plans[self._find_plan(node.best_vector, node.belief.group)]
            plan.arriving[node.belief.positions] += weight * node.belief.weights[0]
        total = REACHED_WEIGHT + len(roots)
        for _ in range(MAX_PASSES):
            for plan in self._plans:
                if not self._is_blind(plan.stamp) and plan.arriving.any() and not self._is_late():
                    self._pass_on(plan)
            missing = sum(plan.arriving.sum() for plan in self._plans if not self._is_blind(plan.stamp))
            if missing <= MAX_MISSING * total:
                break

    def _pass_on(self, plan: Plan) -> None:
        """Add what arrives at a plan to its occupancy, and its next states to what arrives at other plans."""
        model, arriving = self._state.model, plan.arriving
        plan.occupancy, plan.arriving = plan.occupancy + arriving, np.zeros(len(arriving))
        positions = np.flatnonzero(arriving)
        states = model.group_states(plan.group)[positions]
        visits = BeliefBatch(plan.group, states, positions, arriving[None, positions])
        outcomes = compute_outcomes(model, visits, plan.action)
        for children, beliefs in outcomes.batches:
            for observation, weights in zip(outcomes.observation[children], beliefs.weights, strict=True):
                self._plans[plan.next[observation]].arriving[beliefs.positions] += model.discount * weights

    def _find_replacement(self, number: int) -> int:
        """Return the plan of the same set that replaces a pruned one, its own number if all are worse."""
        plan, state = self._plans[number], self._state
        if not plan.pruned:
            return number
        vectors, positions = state.sets[plan.group], np.flatnonzero(plan.occupancy)
        if not len(positions):  # no plan reaches it
            return self._find_plan(int(vectors.stamps[vectors.central()]), plan.group)
        weights, states = plan.occupancy[positions], state.model.group_states(plan.group)[positions]
        column, value = vectors.best(BeliefBatch(plan.group, states, positions, weights[None]))
        slack = MIN_GAIN * state.max_abs_value * weights.sum()
        if value[0] < weights @ plan.values[positions] - slack:
            return number
        return self._find_plan(int(vectors.stamps[column[0]]), plan.group)

    def _back_up(self, plan: Plan) -> Array:
        """Return (n,) the value of a plan by those of its next plans."""
        local = self._state.model.local

        def value_of(observation: Indices, next_state: Indices) -> Array:
            next_plan, values = (
                np.array([plan.next[o] for o in observation.tolist()]),
                np.empty(len(observation)),
            )
            for number in np.unique(next_plan):
                own = next_plan == number
                values[own] = self._plans[number].values[local[next_state[own]]]
            return values

        return combine(self._state.model, plan.group, plan.action, value_of)


def compress(state: SearchState, roots: Sequence[int], max_evaluations: float, seconds: float) -> bool:
    """Replace the vectors by those of a smaller controller if that makes no bound at the roots worse.

    See `kernel_protocols.Tree.compress`.
    """
    if state.dependencies.has_imported:
        return False
    controller = Controller(state, seconds)
    controller.replace_pruned(roots)
    excess = controller.evaluate(max_evaluations)
    slack = MIN_GAIN * state.max_abs_value
    is_better = all(
        controller.value(state.nodes[root], excess) >= update_best_vector(state, state.nodes[root]) - slack
        for root in roots
    )
    if is_better:
        with delay_sigint():  # the old vectors are gone before the new ones are there
            controller.install(excess)
    return is_better
