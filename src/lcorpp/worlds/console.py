"""A world for one person at the keyboard, who types the observation of each action."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lcorpp.errors import DecisionError, LcorppError, expected_one_of
from lcorpp.notebook import join_some


class ConsoleWorld:
    """Show the robot's actions and read the person's answers.

    Args:
        observations: the possible answers; none for answers that are no names, e.g. numbers.
        check: raises a typed error for a wrong answer, after which the question is asked again.
        ask: shows a question and returns the typed line, as `input` does.
        show: shows a line, as `print` does.

    Examples:
        >>> from lcorpp import ConsoleWorld
        >>> world = ConsoleWorld(["pos", "neg", "none"], ask=lambda question: "po", show=print)
        >>> world.act("greet")
        The robot does: greet
        'pos'
    """

    def __init__(
        self,
        observations: Sequence[str],
        *,
        ask: Callable[[str], str] = input,
        show: Callable[[str], None] = print,
        check: Callable[[str], object] = lambda _answer: None,
    ) -> None:
        self._observations, self._ask, self._show = tuple(observations), ask, show
        self._check = check

    def __repr__(self) -> str:
        return f"ConsoleWorld(observations: {join_some(self._observations)})"

    def act(self, action: str) -> str:
        """Show the action and read the observation; any unambiguous prefix is accepted."""
        self._show(f"The robot does: {action}")
        question = "What does it observe?"
        if self._observations:
            return choose(self._observations, question, ask=self._ask, show=self._show)
        while True:
            try:
                typed = self._ask(f"{question} ").strip()
                self._check(typed)
            except EOFError:
                raise DecisionError(f"the input ended at the question {question!r}") from None
            except LcorppError as error:
                self._show(str(error))
            else:
                return typed

    def report(self, action: str) -> None:
        """Show the report."""
        self._show(f"The robot decides: {action}")


def choose(
    options: Sequence[str],
    question: str,
    *,
    ask: Callable[[str], str] = input,
    show: Callable[[str], None] = print,
) -> str:
    """Ask until the answer is one of the options or an unambiguous prefix of one.

    Args:
        question: the prompt, to which the options are added.
        ask, show: as in `ConsoleWorld`.

    Raises:
        DecisionError: the input ended.

    Examples:
        >>> from lcorpp.worlds import choose
        >>> choose(["pos", "neg", "none"], "What does it observe?", ask=lambda question: "neg")
        'neg'
    """
    while True:
        try:
            typed = ask(f"{question} [{'/'.join(options)}] ").strip()
        except EOFError:
            raise DecisionError(f"the input ended at the question {question!r}") from None
        if typed in options:
            return typed
        matches = [option for option in options if typed and option.startswith(typed)]
        if len(matches) == 1:
            return matches[0]
        show(f"{typed!r} is ambiguous or unknown; {expected_one_of(options)}")
