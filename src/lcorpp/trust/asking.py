"""A planner that asks some people added questions, in order to learn, and limits the actions for each."""

from __future__ import annotations

from copy import copy

from lcorpp.protocols import Dialogue, DomainInterface, Planner
from lcorpp.values import Belief

MAX_ADDED_QUESTIONS = 10
"""Maximum number of questions that are added for one person, e.g. if there is no answer."""

MAX_ACTIONS = 100
"""Maximum number of actions for one person before a report of the most probable value. A policy that was
computed for less noise than is estimated now may ask without end."""


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
