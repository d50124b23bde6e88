"""Variables of a factored POMDP, and their names before and after an action."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lcorpp.errors import ModelError, expected_one_of

AFTER = "'"
"""Suffix of a state variable's name that refers to its value after the action."""

ALL, EACH = "*", "-"
"""Wildcards for a value: all values with the same numbers; each value with its own numbers."""


@dataclass(frozen=True)
class Variable:
    """A named part of the state, the action or the observation, with finitely many values.

    observed: whether the value is always observed; for state variables only.

    Raises:
        ModelError: a name is empty, contains blanks or is one of * and -; or a value appears twice.

    Examples:
        >>> from lcorpp.planning import Variable
        >>> Variable("door", ("open", "closed"), observed=True).index("closed")
        1
    """

    name: str
    values: tuple[str, ...]
    observed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(self.values))
        check_word(self.name, "the name of a variable")
        if self.name.endswith(AFTER):
            raise ModelError(
                f"the name {self.name!r} ends in {AFTER!r}, the suffix of the value after the action"
            )
        if not self.values:
            raise ModelError(f"variable {self.name!r} has no values")
        for value in self.values:
            check_word(value, f"a value of {self.name!r}")
        if len(set(self.values)) != len(self.values):
            twice = next(value for i, value in enumerate(self.values) if value in self.values[:i])
            raise ModelError(f"variable {self.name!r} has the value {twice!r} twice")

    def index(self, value: str) -> int:
        """Return the index of a value. Raises ModelError with the known values."""
        if value not in self.values:
            raise ModelError(f"unknown value {value!r} of {self.name!r}; {expected_one_of(self.values)}")
        return self.values.index(value)


Scope = Mapping[str, Variable]
"""The variables of a problem by name; state variables both as ``x`` and as ``x'``."""


def check_word(word: object, what: str) -> None:
    """Reject a word that cannot be a name; tables separate names by blanks."""
    if not isinstance(word, str) or not word:
        raise ModelError(f"{what} must be a word, not {word!r}")
    if not word.isprintable() or " " in word:  # the only printable blank
        raise ModelError(f"{what} must be one word of printable characters, not {word!r}")
    if word in (ALL, EACH):
        raise ModelError(f"{what} cannot be {word!r}, which is a wildcard for values")


def build_scope(
    states: Sequence[Variable], actions: Sequence[Variable], observations: Sequence[Variable]
) -> dict[str, Variable]:
    """Return the variables by name; raise a ModelError if one is missing or two have the same name."""
    scope: dict[str, Variable] = {}
    for kind, variables in (("states", states), ("actions", actions)):
        if not variables:
            raise ModelError(f"a POMDP needs {kind}; there are none")
    for variable in (*states, *actions, *observations):
        if variable.name in scope:
            raise ModelError(f"two variables have the name {variable.name!r}")
        scope[variable.name] = variable
    return scope | {variable.name + AFTER: variable for variable in states}
