"""A domain's questions under a form of answers, and planners that follow it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np

from lcorpp.domains.dialogue import DomainDialogue, PlannerFactory
from lcorpp.domains.domain import Domain
from lcorpp.domains.form_model import FormModel
from lcorpp.planning import Planner, Pomdp
from lcorpp.protocols import Memory, Planner as PlannerProtocol, Starts
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.forms import AnswerForm
from lcorpp.values import Array, Belief

FIRST_SHARE = 0.8
"""Probability of the first of several classes of people at some beliefs to solve for."""


class FormDialogue:
    """The questions of a domain, each in as many copies as the form has (`lcorpp.protocols.Dialogue`).

    tables: (K', V, O) the stated rows of all copies. answers: the model of answers.
    question, question_cost: as of the base. model: the planner's model with the form's memory.
    planners: makes the planners for that model.

    Raises:
        TooLargeError: as of `FormModel`.
    """

    def __init__(self, domain: Domain, base: DomainDialogue, form: AnswerForm) -> None:
        self._domain, self._base, self.form = domain, base, form
        self.answers: AnswerModel = form.make_answers(base.tables)
        self.tables = self.answers.make_tables(self.answers.stated_rows)
        self.model = FormModel(domain, base, form)
        self.question, self.question_cost = base.question, base.question_cost
        self.planners: PlannerFactory | None = None
        self._shares: Array = np.full(form.n_classes, 1 / form.n_classes)

    def find_answers(self, history: Sequence[tuple[str, str]], memory: Memory | None = None) -> list[int]:
        """Return k' * O + o for each question whose copy is k', and its answer o."""
        answers = self._base.find_answers(history)
        return self.form.find_cells(answers, *self._base.tables.shape[::2], start=memory)

    def find_memory(self, history: Sequence[tuple[str, str]], memory: Memory | None = None) -> Memory | None:
        """Return the memory after a conversation; None if the form remembers nothing of it later."""
        if not self.form.keeps_memory:
            return None
        answers = self._base.find_answers(history)
        memories = self.form.list_memories(answers, *self._base.tables.shape[::2], start=memory)
        return self.model.restart(memories[-1])

    def make_planner(self, tables: Array, shares: Array | None = None) -> PlannerProtocol:
        """Return the planner for the next person, who answers by these tables (K', V, O).

        Args:
            shares: (C,) of the classes of people; those of before by default.
        """
        if shares is not None:
            self._shares = shares
        return self.follow(self._planners(tables, self.model.make_model))

    def state(self) -> dict[str, Any]:
        """Return the state of the planners as JSON."""
        return {"planners": self._planners.state(), "shares": self._shares.tolist()}

    def restore(self, state: Mapping[str, Any]) -> PlannerProtocol:
        """Continue from the state of a dialogue of the same domain and form."""
        self._shares = np.array(state["shares"], np.float64).reshape(self._shares.shape)
        return self.follow(self._planners.restore(state["planners"], self.model.make_model))

    def make_stated_planner(self, planner: Planner) -> Planner:
        """Return the planner of the stated model, whose policy ignores the memory."""
        model: Pomdp = self.model.make_model(self.tables)
        return Planner(self.model.lift(planner.policy, model), model)

    @property
    def _planners(self) -> PlannerFactory:
        assert self.planners is not None, "a dialogue without planners makes none"
        return self.planners

    def place_starts(self, starts: Array) -> Array:
        """Return (N', X) beliefs to solve for, from those (N, S) of the domain's model.

        With several classes of people, they are equally probable, or the first one is probable.
        """
        rest = np.ones(self.form.n_classes) * (1 - FIRST_SHARE) / max(self.form.n_classes - 1, 1)
        rest[0] = FIRST_SHARE
        equal = np.full(self.form.n_classes, 1 / self.form.n_classes)
        shares = [equal, rest] if self.form.n_classes > 1 else [equal]
        return np.array([self.model.place(start, own) for own in shares for start in starts])

    def follow(self, planner: PlannerProtocol) -> PlannerProtocol:
        """Return a planner of the form's model as one of the domain's."""
        return FollowingPlanner(self._domain, self.model, planner, self._shares)

    def start_known(self, planner: PlannerProtocol, find_starts: Callable[[], Starts]) -> PlannerProtocol:
        """Return the planner for a person who is known, see `lcorpp.protocols.Dialogue`."""
        assert isinstance(planner, FollowingPlanner)
        return planner.start_known(find_starts)


class FollowingPlanner:
    """A planner whose model has the memory of a form, for one person: each person gets a copy.

    Its beliefs are those of the domain's model; it follows the belief about the memory, too, from the first
    action on.

    Args:
        planner: for a model of `FormModel.make_model`. shares: (C,) of the classes of people.
    """

    def __init__(self, domain: Domain, model: FormModel, planner: PlannerProtocol, shares: Array) -> None:
        self._domain, self._model, self._planner, self._shares = domain, model, planner, shares
        self._find_starts: Callable[[], Starts] | None = None
        self._own: Belief | None = None  # of the form's model, after the first observation

    def start_known(self, find_starts: Callable[[], Starts]) -> FollowingPlanner:
        """Return the planner for a person whose class or memory is known in part."""
        planner = copy(self)
        planner._find_starts = find_starts
        return planner

    @property
    def start(self) -> Belief:
        """(S,) the start belief of the domain's model."""
        return self._domain.pomdp.start

    def action(self, belief: Belief) -> str:
        """Return the policy's action; the first belief (S,) is the prior."""
        return self._planner.action(self._find_own(belief))

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief (S,) after an action and an observation."""
        self._own = self._planner.update(self._find_own(belief), action, observation)
        return self._model.collapse(self._own)

    def _find_own(self, prior: Belief) -> Belief:
        if self._own is not None:
            return self._own
        if self._find_starts is not None:
            return self._model.place_known(prior, self._find_starts())
        return self._model.place(prior, self._shares)
