"""The probabilities of one random selection, from what its pr-atoms say of the values it may take.

Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3.2, equations 3 to 5, Conditions 2 and 3;
section 5.1 for unitarity.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lcorpp.reasoning.language.syntax import Statement

Spoken = tuple[int, Fraction, int]
"""What one pr-atom says: the value, its number, and the position of the statement."""


class Breach(Exception):
    """A condition of the language is broken; in which world is not known yet, and statements are positions.

    Args:
        statement: the one that breaks it.
        message: how, in parts between which the name of the term stands: terms of which the same is said
            share their breaches.
        other: where another statement has part in it, it stands between `message` and `after`.
    """

    def __init__(
        self, statement: int, message: tuple[str, ...], other: int | None = None, after: str = ""
    ) -> None:
        self.statement, self.message, self.other, self.after = statement, message, other, after
        self.which = 0
        """Which of the terms of its step it is about."""
        super().__init__(statement)

    def told(self, statements: Sequence[Statement], names: Sequence[str]) -> str:
        """The message with the places of the statements and the name of its term, one of those of a step."""
        place = "" if self.other is None else f" {statements[self.other].at}"
        return f"{statements[self.statement].at}: {names[self.which].join(self.message)}{place}{self.after}"


def choice(possible: Sequence[int], spoken: Sequence[Spoken], values: Sequence[str]) -> list[Fraction]:
    """The probability of each possible value, in their order.

    Args:
        possible: the dynamic range.
        spoken: the pr-atoms that are about this selection.
        values: the whole range of the term, for messages.

    Raises:
        Breach: two pr-atoms for one value, one outside of the range, or numbers that are no probabilities.
    """
    numbers: dict[int, Fraction] = {}
    by: dict[int, int] = {}
    for value, number, statement in spoken:
        if not 0 <= number <= 1:
            raise Breach(statement, (f"the probability {number} is not between 0 and 1",))
        if value in numbers:
            same = by[value] == statement
            raise Breach(
                statement,
                ("Condition 2: ", f"={values[value]} also has a pr-atom at"),
                by[value],
                " with other values of its variables" if same else "",
            )
        if value not in possible:
            shown = ", ".join(values[v] for v in possible)
            raise Breach(
                statement,
                (
                    "Condition 3: ",
                    f"={values[value]} has a pr-atom outside of its dynamic range {{{shown}}}",
                ),
            )
        numbers[value], by[value] = number, statement
    if not numbers:
        return [Fraction(1, len(possible))] * len(possible)
    total = sum(numbers.values(), Fraction(0))
    rest = len(possible) - len(numbers)
    if total > 1 or (total != 1 and not rest):
        raise Breach(
            min(by.values()),
            ("not unitary: the probabilities of ", f" sum to {total}, not {'at most ' if rest else ''}1"),
        )
    share = (1 - total) / rest if rest else Fraction(0)
    return [numbers.get(value, share) for value in possible]
