"""A domain's questions under a form of answers, and planners that follow it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lcorpp.domains.dialogue import DomainDialogue, PlannerFactory
from lcorpp.domains.domain import Domain
from lcorpp.domains.form_model import FormModel
from lcorpp.planning import Planner, Pomdp
from lcorpp.protocols import Planner as PlannerProtocol
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.forms import AnswerForm
from lcorpp.values import Array, Belief


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
        self.tables = form.expand(base.tables)
        self.answers: AnswerModel = form.make_answers(base.tables)
        self.model = FormModel(domain, base, form)
        self.question, self.question_cost = base.question, base.question_cost
        self.planners: PlannerFactory | None = None

    def find_answers(self, history: Sequence[tuple[str, str]]) -> list[int]:
        """Return k' * O + o for each question whose copy is k', and its answer o."""
        answers = self._base.find_answers(history)
        return self.form.find_cells(answers, *self._base.tables.shape[::2])

    def make_planner(self, tables: Array) -> PlannerProtocol:
        """Return the planner for the next person, who answers by these tables (K', V, O)."""
        return self.follow(self._planners(tables, self.model.make_model))

    def state(self) -> dict[str, Any]:
        """Return the state of the planners as JSON."""
        return self._planners.state()

    def restore(self, state: Mapping[str, Any]) -> PlannerProtocol:
        """Continue from the state of a dialogue of the same domain and form."""
        return self.follow(self._planners.restore(state, self.model.make_model))

    def make_stated_planner(self, planner: Planner) -> Planner:
        """Return the planner of the stated model, whose policy ignores the memory."""
        model: Pomdp = self.model.make_model(self.tables)
        return Planner(self.model.lift(planner.policy, model), model)

    @property
    def _planners(self) -> PlannerFactory:
        assert self.planners is not None, "a dialogue without planners makes none"
        return self.planners

    def follow(self, planner: PlannerProtocol) -> PlannerProtocol:
        """Return a planner of the form's model as one of the domain's."""
        return FollowingPlanner(self._domain, self._base, self.model, planner)


class FollowingPlanner:
    """A planner whose model has the memory of a form: it follows the memory of one person.

    Its beliefs are those of the domain's model. Each person gets a copy.

    Args:
        planner: for a model of `FormModel.make_model`.
    """

    def __init__(
        self, domain: Domain, base: DomainDialogue, model: FormModel, planner: PlannerProtocol
    ) -> None:
        self._domain, self._base, self._model, self._planner = domain, base, model, planner
        self._history: tuple[tuple[str, str], ...] = ()
        self._memory = 0

    @property
    def start(self) -> Belief:
        """(S,) the start belief of the domain's model."""
        return self._domain.pomdp.start

    def action(self, belief: Belief) -> str:
        """Return the policy's action at a belief (S,)."""
        return self._planner.action(self._model.place(belief, self._memory))

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief (S,) after an action and an observation."""
        updated = self._planner.update(self._model.place(belief, self._memory), action, observation)
        self._history = (*self._history, (action, observation))
        answers = self._base.find_answers(self._history)
        *_, memory = self._model.form.list_memories(answers, *self._base.tables.shape[::2])
        self._memory = self._model.find_memory(memory)
        return self._model.collapse(updated)
