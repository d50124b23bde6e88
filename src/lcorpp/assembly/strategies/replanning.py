"""Policies for an estimated observation model, by a bounded amount of search after each person."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lcorpp.planning import Planner, Pomdp, SparseTables
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


class Replanner:
    """The planner of each estimated model; it searches for a policy, by bounded work after each person.

    The former policy acts on the beliefs of a new model until the search's improvement is below half the
    loss that is assumed of the former one: its own, and `LOSS_PER_VARIATION`. The search continues to the
    precision, and its policy acts again each time its improvement is halved. The gap is not a criterion: it
    is wide long after the policy has become good. The result depends on the models and their order, not on a
    clock.

    Args:
        planner: for the stated model.
        starts: (N, S) beliefs to solve for.
        precision: of the stated policy, in reward units.
    """

    def __init__(self, planner: Planner, starts: Array, precision: float) -> None:
        self._starts, self._stated = starts, planner
        self._model = planner.pomdp  # of the last call
        self._target = planner.pomdp  # of the last search
        self._span = float(np.ptp(planner.pomdp.reward))
        self._precision = max(precision, PRECISION_SHARE * self._span)
        self._loss = self._precision  # estimated loss of `_policy` on its own model
        self._policy = planner.policy
        self._solved: tuple[Pomdp, int] | None = None  # model of `_policy`, and trials of its search
        self._search: PacedSearch | None = None
        self.planner: Planner | TransferPlanner = planner

    def __call__(self, model: Pomdp) -> Planner | TransferPlanner:
        """Return the planner of the next person; cheap if the model is that of the call before."""
        if model is not self._model:
            self._model = model
            if _compare_observations(model, self._target) > MAX_VARIATION:
                self._target, self._search = model, PacedSearch(model, self._starts, self._precision)
            self.planner = TransferPlanner(self._policy, model)
        search = self._search
        if search is not None:
            search.advance(work=WORK_PER_PERSON)
            if search.converged or search.improvement < self._assume_loss(search.pomdp) / 2:
                self._policy, self._solved = search.make_policy(), (search.pomdp, search.trials)
                self._loss = min(search.improvement, search.gap)
                self.planner = TransferPlanner(self._policy, model)
            if search.converged or search.work > MAX_SEARCH_WORK:
                self._search = None
        return self.planner

    def state(self) -> dict[str, Any]:
        """Return the state as JSON: the models of policy and search, with numbers of trials."""
        search = self._search
        return {
            "model": _export(self._model),
            "target": _export(self._target),
            "policy": None if self._solved is None else [_export(self._solved[0]), self._solved[1]],
            "trials": None if search is None else search.trials,
            "loss": self._loss,
        }

    def restore(self, state: Mapping[str, Any]) -> Planner | TransferPlanner:
        """Continue from a state of a replanner with the same arguments.

        The searches are repeated, in the same numbers of trials.
        """
        self._model, self._target = self._import(state["model"]), self._import(state["target"])
        self._policy, self._solved, self._search = self._stated.policy, None, None
        if state["policy"] is not None:
            model, trials = self._import(state["policy"][0]), state["policy"][1]
            self._policy, self._solved = self._repeat(model, trials).make_policy(), (model, trials)
        self._loss = float(state["loss"])
        if state["trials"] is not None:
            self._search = self._repeat(self._target, state["trials"])
        self.planner = TransferPlanner(self._policy, self._model)
        return self.planner

    def _assume_loss(self, model: Pomdp) -> float:
        """Return the loss that is assumed of the present policy on a model."""
        own = self._stated.pomdp if self._solved is None else self._solved[0]
        return self._loss + LOSS_PER_VARIATION * self._span * _compare_observations(own, model)

    def _repeat(self, model: Pomdp, trials: int) -> PacedSearch:
        search = PacedSearch(model, self._starts, self._precision)
        if trials:
            search.advance(trials=trials)
        return search

    def _import(self, observation: list[Any]) -> Pomdp:
        return replace(self._target, observation=SparseTables.of(np.array(observation)))


def _export(model: Pomdp) -> list[Any]:
    observation: list[Any] = model.observation.dense.tolist()
    return observation


def _compare_observations(one: Pomdp, other: Pomdp) -> float:
    """Return the largest total variation between rows of two models."""
    return float(np.abs(one.observation.dense - other.observation.dense).sum(axis=2).max()) / 2
