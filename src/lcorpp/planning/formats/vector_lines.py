"""Alpha vectors as lines of text, for formats that list every state."""

from __future__ import annotations

from collections.abc import Iterator

from lcorpp.errors import PolicyError
from lcorpp.planning.policy import Policy

MAX_BYTES = 200_000_000
"""Maximum estimated size of a policy with several vector sets when it is written over all states."""

NUMBER_LENGTH = 19
"""Approximate length of a number with all its digits and a space."""


def format_vectors(policy: Policy) -> Iterator[tuple[int, str]]:
    """Yield the action and the numbers of each vector, with all digits.

    States outside a vector's set get the floor of the policy. The size is limited only in that case.

    Raises:
        PolicyError: the policy has several vector sets and would become too large over all states.
    """
    size = estimate_bytes(policy)
    if not policy.covers_all_states and size > MAX_BYTES:
        raise PolicyError(
            f"this policy has {len(policy.vector_sets)} vector sets; its {len(policy)} vectors over"
            f" all {len(policy.state_names)} states take about {size / 1e6:.0f} MB;"
            f" at most {MAX_BYTES / 1e6:.0f} MB are written"
        )
    floor = repr(policy.floor)
    for part in policy.vector_sets:
        states = part.states.tolist()
        for action, vector in zip(part.actions.tolist(), part.vectors.tolist(), strict=True):
            if len(states) == len(policy.state_names):
                yield action, " ".join(map(repr, vector))
                continue
            words = [floor] * len(policy.state_names)
            for state, value in zip(states, vector, strict=True):
                words[state] = repr(value)
            yield action, " ".join(words)


def estimate_bytes(policy: Policy) -> int:
    """Return the approximate size in bytes of the policy's vectors over all states."""
    S, filler = len(policy.state_names), len(repr(policy.floor)) + 1
    return sum(
        len(part.actions) * (len(part.states) * NUMBER_LENGTH + (S - len(part.states)) * filler)
        for part in policy.vector_sets
    )
