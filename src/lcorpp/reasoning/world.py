"""A possible world of a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

MAX_SHOWN_TERMS = 8
"""The `repr` of a world shows at most this many terms."""


@dataclass(frozen=True, eq=False)
class World:
    """A possible world.

    values: term -> value, for the terms that have a value.
    measure: its probability, given the evidence and interventions for which it was computed.
    """

    values: Mapping[str, str]
    measure: Fraction

    def __repr__(self) -> str:
        shown = dict(list(self.values.items())[:MAX_SHOWN_TERMS])
        n_hidden = len(self.values) - len(shown)
        return f"World({self.measure}: {format_world(shown)}{f' and {n_hidden} more' if n_hidden else ''})"


def format_world(values: Mapping[str, str]) -> str:
    """Format the terms and values of a world: ``{prize=1, selected=2}``."""
    return f"{{{', '.join(f'{term}={value}' for term, value in values.items())}}}"
