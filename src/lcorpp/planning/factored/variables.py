"""The variables of a factored problem, and what they are called before and after an action."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import prod

from lcorpp.errors import ModelError, expected_one_of

AFTER = "'"
"""What follows the name of a state variable where its value after the action is meant."""

ALL, EACH = "*", "-"
"""In the place of a value: every value alike; every value in turn, each with numbers of its own."""


@dataclass(frozen=True)
class Variable:
    """A named part of the state, of the action or of what is observed, with finitely many values.

    observed: whether the value is always seen; for parts of the state only.

    Raises:
        ModelError: a name is empty, has blanks in it or is one of the signs * and -; a value is there twice.
    """

    name: str
    values: tuple[str, ...]
    observed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(self.values))
        check_word(self.name, "the name of a variable")
        if self.name.endswith(AFTER):
            raise ModelError(
                f"the name {self.name!r} ends in {AFTER!r}, the sign for the value after the action"
            )
        if not self.values:
            raise ModelError(f"variable {self.name!r} has no values")
        for value in self.values:
            check_word(value, f"a value of {self.name!r}")
        if len(set(self.values)) != len(self.values):
            twice = next(value for i, value in enumerate(self.values) if value in self.values[:i])
            raise ModelError(f"variable {self.name!r} has the value {twice!r} twice")

    def index(self, value: str) -> int:
        """The number of a value. Raises ModelError with the known ones."""
        if value not in self.values:
            raise ModelError(f"unknown value {value!r} of {self.name!r}; {expected_one_of(self.values)}")
        return self.values.index(value)


Scope = Mapping[str, Variable]
"""What a table can speak of, by name: state variables as ``x`` and ``x'``, actions, observations."""


def check_word(word: object, what: str) -> None:
    """Refuse what cannot be a name: tables list names with blanks between them."""
    if not isinstance(word, str) or not word:
        raise ModelError(f"{what} must be a word, not {word!r}")
    if not word.isprintable() or " " in word:  # no other blank is printable
        raise ModelError(f"{what} must be one word of printable characters, not {word!r}")
    if word in (ALL, EACH):
        raise ModelError(f"{what} cannot be {word!r}, which stands for every value")


def scope_of(
    states: Sequence[Variable], actions: Sequence[Variable], observations: Sequence[Variable]
) -> dict[str, Variable]:
    """The variables by name.

    Raises:
        ModelError: two have the same name, or there is none for states or actions.
    """
    scope: dict[str, Variable] = {}
    for kind, variables in (("states", states), ("actions", actions)):
        if not variables:
            raise ModelError(f"a POMDP needs {kind}; there are none")
    for variable in (*states, *actions, *observations):
        if variable.name in scope:
            raise ModelError(f"two variables have the name {variable.name!r}")
        scope[variable.name] = variable
    return scope | {variable.name + AFTER: variable for variable in states}


def size(scope: Scope, names: Iterable[str]) -> int:
    """How many combinations of values there are."""
    return prod(len(scope[name].values) for name in names)


def described(scope: Scope, names: Sequence[str], number: int) -> str:
    """The combination of values with a number, the last variable counting fastest: ``x=1, y=2``."""
    parts = []
    for name in reversed(names):
        number, value = divmod(number, len(scope[name].values))
        parts.append(f"{name}={scope[name].values[value]}")
    return ", ".join(reversed(parts))
