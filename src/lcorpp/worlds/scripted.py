"""Worlds of one person whose answers are given: prepared ones, or those of an earlier decision."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lcorpp.errors import DecisionError


class ScriptedWorld:
    """A world whose person gives prepared answers, whatever the action.

    Args:
        answers: the observations, in order.
        source: where they come from, for messages.

    Examples:
        >>> from lcorpp.worlds import ScriptedWorld
        >>> world = ScriptedWorld(["pos", "neg"])
        >>> world.act("greet"), world.act("turn")
        ('pos', 'neg')
    """

    def __init__(self, answers: Sequence[str], source: str = "the world") -> None:
        self._count, self._rest, self._name = len(answers), iter(answers), source

    def act(self, action: str) -> str:
        """Return the next answer.

        Raises:
            DecisionError: there is no other one.
        """
        answer = next(self._rest, None)
        if answer is None:
            raise DecisionError(
                f"{self._name} has {self._count} answers, and the robot needs another one, to {action}"
            )
        return answer

    def report(self, action: str) -> None:
        """Do nothing."""


class EndOfStepsError(BaseException):
    """Ends a decision that continues, or differs from, earlier steps; no part of a robot catches it."""


class RepeatedWorld:
    """A world whose person answers as in earlier steps, as long as the robot acts as it did then.

    action: the robot's first action after the steps, or its first other action or report; None before.
    expected: the action of the steps in its place; None after the last step.

    Args:
        steps: action and observation, in order; None for an action without one, which ends the decision.
    """

    def __init__(self, steps: Iterable[tuple[str, str | None]]) -> None:
        self._rest = iter(steps)
        self.action: str | None = None
        self.expected: str | None = None

    def act(self, action: str) -> str:
        """Return the observation of the next step.

        Raises:
            EndOfStepsError: there is none, or that step has another action.
        """
        expected, observation = next(self._rest, (None, None))
        if action == expected and observation is not None:
            return observation
        self.action, self.expected = action, expected
        raise EndOfStepsError(action)

    def report(self, action: str) -> None:
        """Record the report."""
        self.action, self.expected = action, next(self._rest, (None, None))[0]
