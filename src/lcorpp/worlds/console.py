"""A world of one person at the keyboard, who answers what the robot does."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lcorpp.errors import DecisionError, expected_one_of


class ConsoleWorld:
    """The robot's actions are told, the person's answers are read.

    Args:
        observations: the answers that can be given.
        ask: shows a question and returns the line typed; `input` fits.
        tell: shows a line; `print` fits.
    """

    def __init__(
        self,
        observations: Sequence[str],
        *,
        ask: Callable[[str], str] = input,
        tell: Callable[[str], None] = print,
    ) -> None:
        self._observations, self._ask, self._tell = tuple(observations), ask, tell

    def act(self, action: str) -> str:
        """Tell the action and read the answer; any unambiguous beginning of an observation will do."""
        self._tell(f"The robot does: {action}")
        return choose(self._observations, "What does it observe?", ask=self._ask, tell=self._tell)

    def report(self, action: str) -> None:
        """Tell the report."""
        self._tell(f"The robot decides: {action}")


def choose(
    options: Sequence[str],
    question: str,
    *,
    ask: Callable[[str], str] = input,
    tell: Callable[[str], None] = print,
) -> str:
    """Ask until one of the options is meant.

    Raises:
        DecisionError: the input has ended.
    """
    while True:
        try:
            typed = ask(f"{question} [{'/'.join(options)}] ").strip()
        except EOFError:
            raise DecisionError(f"the input ended at the question {question!r}") from None
        if typed in options:
            return typed
        meant = [option for option in options if typed and option.startswith(typed)]
        if len(meant) == 1:
            return meant[0]
        tell(f"{typed!r} is not clear; {expected_one_of(options)}")
