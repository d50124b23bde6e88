"""A possible world of a program and its probability."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True, eq=False)
class World:
    """A possible world.

    values: term -> value, for the terms that have a value.
    measure: its probability among the worlds of the same program, interventions and evidence.
    """

    values: Mapping[str, str]
    measure: Fraction

    def __repr__(self) -> str:
        shown = ", ".join(f"{term}={value}" for term, value in list(self.values.items())[:SHOWN_TERMS])
        more = len(self.values) - SHOWN_TERMS
        return f"World({self.measure}: {shown}{f', ... {more} more' if more > 0 else ''})"


SHOWN_TERMS = 8
"""`repr` of a world shows at most this many terms."""
