"""A trial that a person has judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lcorpp.values import SharedValue


@dataclass(frozen=True, eq=False)
class JudgedTrial:
    """A trial with its true shared value.

    facts: observed attribute -> value. samples: sense -> its samples (time, value, ...), as they arrived.
    truth: by the person.
    """

    facts: Mapping[str, str]
    samples: Mapping[str, Sequence[tuple[float, ...]]]
    truth: SharedValue
