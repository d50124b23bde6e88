"""A world for one person whose answers are prepared."""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.errors import DecisionError


class ScriptedWorld:
    """A world whose person gives prepared answers, whatever the action.

    Args:
        answers: the observations, in order.
        source: where they come from, for messages.
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
