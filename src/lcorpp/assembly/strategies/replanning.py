"""Policies for an estimated observation model, by a bounded amount of search after each person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lcorpp.domains.dialogue import MakeModel
from lcorpp.planning import Planner, Pomdp
from lcorpp.planning.planner import TransferPlanner
from lcorpp.planning.sarsop.paced_search import PacedSearch
from lcorpp.values import Array

MAX_VARIATION = 0.03
"""A policy is computed anew if a row of the observation model differs by more than this, in total variation,
from the row that it was computed for."""

PRECISION_SHARE = 1e-3
"""Precision of the policies, as a share of the range of the rewards."""

WORK_PER_PERSON = 4e4
"""Work of the search after each person, in the unit of `PacedSearch`: 2 to 15 milliseconds."""

MAX_SEARCH_WORK = 500 * WORK_PER_PERSON
"""A search that has not converged after this much work ends."""

LOSS_PER_VARIATION = 1 / 3
"""Loss that is assumed of a policy on another model, in spans of the rewards: this times the largest total
variation between rows of the models."""


MAX_TRANSFER = 0.1
"""A policy acts on the beliefs of another model up to this total variation between rows of both. On those of
a much noisier model it would ask without end."""


class Replanner:
    """The planner of each estimated model; it searches for a policy, by bounded work after each person.

    The former policy acts until the search's improvement is below half the loss that is assumed of it: its
    own, and `LOSS_PER_VARIATION`; on the beliefs of the new model if that is similar (`MAX_TRANSFER`), else
    on those of the model before. The search continues to the precision, and its policy acts again each time
    its improvement is halved. The gap is not a criterion: it is wide long after the policy has become good.
    The result depends on the models and their order, not on a clock.

    Args:
        planner: for the stated model.
        starts: (N, S) beliefs to solve for.
        precision: of the stated policy, in reward units. tables: (K, V, O) of the stated model.
    """

    def __init__(self, planner: Planner, starts: Array, precision: float, tables: Array) -> None:
        self._starts, self._stated, self._stated_tables = starts, planner, tables
        self._span = float(np.ptp(planner.pomdp.reward))
        self._precision = max(precision, PRECISION_SHARE * self._span)
        self._begin()

    def _begin(self) -> None:
        """Use the stated policy for the stated model."""
        self._tables = self._acting = self._stated_tables  # of the last call, and of `planner`
        self._target = self._stated_tables  # of the last search
        self._model = self._stated.pomdp  # of `_tables`
        self._loss = self._precision  # estimated loss of `_policy` on its own model
        self._policy = self._stated.policy
        self._solved: tuple[Array, int] | None = None  # tables of `_policy`, and trials of its search
        self._search: PacedSearch | None = None
        self.planner: Planner | TransferPlanner = self._stated

    def __call__(self, tables: Array, make_model: MakeModel) -> Planner | TransferPlanner:
        """Return the planner of the next person; cheap if the tables are those of the call before."""
        if np.array_equal(tables, self._stated_tables):
            self._begin()
        elif not np.array_equal(tables, self._tables):
            self._tables, self._model = tables, make_model(tables)
            if _compare_tables(tables, self._target) > MAX_VARIATION:
                self._target = tables
                self._search = PacedSearch(self._model, self._starts, self._precision)
            if _compare_tables(self._solved_tables, tables) <= MAX_TRANSFER:
                self._acting, self.planner = tables, TransferPlanner(self._policy, self._model)
        search = self._search
        if search is not None:
            search.advance(work=WORK_PER_PERSON)
            if search.converged or search.improvement < self._assume_loss(self._target) / 2:
                self._policy, self._solved = search.make_policy(), (self._target, search.trials)
                self._loss = min(search.improvement, search.gap)
                self._acting, self.planner = self._tables, TransferPlanner(self._policy, self._model)
            if search.converged or search.work > MAX_SEARCH_WORK:
                self._search = None
        return self.planner

    def state(self) -> dict[str, Any]:
        """Return the state as JSON: the tables of policy and search, with numbers of trials."""
        search = self._search
        return {
            "tables": self._tables.tolist(),
            "target": self._target.tolist(),
            "acting": self._acting.tolist(),
            "policy": None if self._solved is None else [self._solved[0].tolist(), self._solved[1]],
            "trials": None if search is None else search.trials,
            "loss": self._loss,
        }

    def restore(self, state: Mapping[str, Any], make_model: MakeModel) -> Planner | TransferPlanner:
        """Continue from a state of a replanner with the same arguments.

        The searches are repeated, in the same numbers of trials.
        """
        self._tables, self._target = np.array(state["tables"]), np.array(state["target"])
        self._model = make_model(self._tables)
        self._policy, self._solved, self._search = self._stated.policy, None, None
        if state["policy"] is not None:
            tables, trials = np.array(state["policy"][0]), state["policy"][1]
            self._policy = self._repeat(make_model(tables), trials).make_policy()
            self._solved = tables, trials
        self._loss = float(state["loss"])
        if state["trials"] is not None:
            self._search = self._repeat(make_model(self._target), state["trials"])
        self._acting = np.array(state["acting"])
        self.planner = self._stated
        if self._solved is not None or not np.array_equal(self._acting, self._stated_tables):
            self.planner = TransferPlanner(self._policy, make_model(self._acting))
        return self.planner

    def _assume_loss(self, tables: Array) -> float:
        """Return the loss that is assumed of the present policy on the model with these tables."""
        return self._loss + LOSS_PER_VARIATION * self._span * _compare_tables(self._solved_tables, tables)

    @property
    def _solved_tables(self) -> Array:
        """The tables of the model of `_policy`."""
        return self._stated_tables if self._solved is None else self._solved[0]

    def _repeat(self, model: Pomdp, trials: int) -> PacedSearch:
        search = PacedSearch(model, self._starts, self._precision)
        if trials:
            search.advance(trials=trials)
        return search


def _compare_tables(one: Array, other: Array) -> float:
    """Return the largest total variation between rows of two tables."""
    return float(np.abs(one - other).sum(axis=2).max()) / 2
