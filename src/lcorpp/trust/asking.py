"""Questions that are asked in order to learn: which people get them, and a planner that asks them."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any

from lcorpp.protocols import Dialogue, DomainInterface, Planner
from lcorpp.trust.options import TrustOptions
from lcorpp.values import Belief

FIRST_PEOPLE = 100
"""Number of people over whom the budget of added questions grows in proportion; then as the square root."""

MAX_ADDED_QUESTIONS = 10
"""Maximum number of questions that are added for one person, e.g. if there is no answer."""

MAX_ACTIONS = 100
"""Maximum number of actions for one person before a report of the most probable value. A policy that was
computed for less noise than is estimated now may ask without end."""


class AskingRule:
    """Decides which people are asked to learn, within a budget (`TrustOptions.ask_budget`).

    n_people: so far. n_repeated: people with at least `ask_answers` answers.
    spent: cost of these questions of the people who are asked to learn, in reward units. It counts those that
        would have been needed in any case, too, so it is not below the cost of the added ones.

    Args:
        cost: of an added question, in reward units.
    """

    def __init__(self, options: TrustOptions, cost: float) -> None:
        self._options, self._cost = options, cost
        self.n_people = self.n_repeated = 0
        self.spent = 0.0

    @property
    def budget(self) -> float:
        """What may be spent on this number of people and the next one, in reward units."""
        n = self.n_people + 1
        total: float = self._options.ask_budget * min(n, (FIRST_PEOPLE * n) ** 0.5)
        return total

    def find_wanted(self, *, has_alternative: bool, is_as_stated: bool) -> int:
        """Return the number of answers wanted of the next person; 0 if they are not asked more than needed.

        Args:
            has_alternative: whether alternative estimates are credible, so that a wrong model costs most.
            is_as_stated: whether the stated observation model is credible, so that more answers gain little.
        """
        options, n = self._options, self.n_people
        if options.ask_every == 0:
            return 0
        factor = options.max_asked if has_alternative else options.min_asked
        is_turn = n % options.ask_every == 0 and not (is_as_stated and n > 0)
        is_due = is_turn or self.n_repeated < factor * n**0.5
        is_affordable = self.spent + options.ask_answers * self._cost <= self.budget
        return options.ask_answers if is_due and is_affordable else 0

    def add(self, n_answers: int, n_questions: int, wanted: int) -> None:
        """Add a person.

        Args:
            n_answers: to all questions. n_questions: how often the question to learn was asked.
            wanted: number of answers that were wanted.
        """
        if wanted:
            self.spent += n_questions * self._cost
        self.n_people += 1
        self.n_repeated += n_answers >= self._options.ask_answers

    def state(self) -> dict[str, Any]:
        """Return the counts as JSON."""
        return {"people": self.n_people, "repeated": self.n_repeated, "spent": self.spent}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        self.n_people, self.n_repeated, self.spent = state["people"], state["repeated"], state["spent"]


class AskingPlanner:
    """A planner for one person, with questions in place of a report until there are enough answers.

    With one answer a person, neither the noise of the answers nor the distribution of the values is
    identifiable. After `MAX_ACTIONS` actions it reports.

    added: number of questions in place of a report.

    Args:
        planner: of which this one uses a copy, as it may have state for one person.
        wanted: number of informative answers; 0 if the person is not asked more than needed.
    """

    def __init__(self, planner: Planner, domain: DomainInterface, dialogue: Dialogue, wanted: int) -> None:
        self._planner, self._domain, self._dialogue, self._wanted = copy(planner), domain, dialogue, wanted
        self._history = list[tuple[str, str]]()
        self.added = 0

    @property
    def start(self) -> Belief:
        """(S,) the model's initial belief."""
        return self._planner.start

    def action(self, belief: Belief) -> str:
        """Return the planner's action, or a question if that is a report before enough answers."""
        if len(self._history) >= MAX_ACTIONS:
            return self._domain.report_action(self._domain.marginal(belief).most_likely())
        action = self._planner.action(belief)
        if self.added == MAX_ADDED_QUESTIONS or self._domain.reported_value(action) is None:
            return action
        if len(self._dialogue.find_answers(self._history)) >= self._wanted:
            return action
        if self._dialogue.question is None:
            return action
        self.added += 1
        return self._dialogue.question

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief after an action and an observation."""
        self._history.append((action, observation))
        return self._planner.update(belief, action, observation)
