"""The alpha vectors of a policy as lines of text, for the formats that write out every state."""

from __future__ import annotations

from collections.abc import Iterator

from lcorpp.errors import PolicyError
from lcorpp.planning.policy import Policy

MAX_TEXT = 200_000_000
"""The most bytes that a policy in pieces may grow to when the states it does not speak of are filled in."""

NUMBER_LENGTH = 19
"""About how many letters a number with all its digits takes, with the space after it."""


def vector_lines(policy: Policy) -> Iterator[tuple[int, str]]:
    """The action and the numbers of each vector, with all their digits.

    A flat policy is written as it is, however large; of one in pieces, the floor of the policy stands for the
    states that a piece does not speak of.

    Raises:
        PolicyError: a policy in pieces would grow too large.
    """
    if not policy.covers_all_states and written_out(policy) > MAX_TEXT:
        raise PolicyError(
            f"this policy is in {len(policy.vector_sets)} pieces; its {len(policy)} vectors written out over"
            f" all {len(policy.state_names)} states take about {written_out(policy) / 1e6:.0f} MB;"
            f" at most {MAX_TEXT / 1e6:.0f} MB are written"
        )
    floor = repr(policy.floor)
    for piece in policy.vector_sets:
        states = piece.states.tolist()
        for action, vector in zip(piece.actions.tolist(), piece.vectors.tolist(), strict=True):
            if len(states) == len(policy.state_names):
                yield action, " ".join(map(repr, vector))
                continue
            words = [floor] * len(policy.state_names)
            for state, value in zip(states, vector, strict=True):
                words[state] = repr(value)
            yield action, " ".join(words)


def written_out(policy: Policy) -> int:
    """About how many bytes the vectors of a policy take over all states."""
    S, filler = len(policy.state_names), len(repr(policy.floor)) + 1
    return sum(
        len(piece.actions) * (len(piece.states) * NUMBER_LENGTH + (S - len(piece.states)) * filler)
        for piece in policy.vector_sets
    )
