"""The order of attributes as text: ``identity < time, location < classifier``."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise

from lcorpp.errors import DataError, expected_one_of
from lcorpp.reasoning.quoting import make_name_text


def find_pairs(
    order: Sequence[str], names: Sequence[str], constants: Collection[str] = ()
) -> frozenset[tuple[int, int]]:
    """Return all pairs of attributes of which the first comes before the second, by their numbers.

    constants: further attributes, which are left out.

    Raises:
        DataError: a name is unknown, or an attribute would come before itself.
    """
    pairs = set[tuple[int, int]]()
    for text in order:
        tiers = [[name.strip() for name in tier.split(",")] for tier in text.split("<")]
        if len(tiers) < 2:
            raise DataError(f"the order is {text!r}; expected attributes as in 'identity < time, location'")
        numbers = [
            [_find(name, text, names) for name in tier if make_name_text(name) not in constants]
            for tier in tiers
        ]
        for first, second in pairwise(filter(None, numbers)):
            pairs.update((i, j) for i in first for j in second)
    for k in range(len(names)):  # the transitive closure
        earlier, later = [i for i, j in pairs if j == k], [j for i, j in pairs if i == k]
        pairs.update((i, j) for i in earlier for j in later)
    for i, j in pairs:
        if i == j:
            raise DataError(f"the order has {names[i]} before itself")
    return frozenset(pairs)


def _find(name: str, text: str, names: Sequence[str]) -> int:
    written = make_name_text(name)
    if written not in names:
        raise DataError(f"the order {text!r} has {name!r}; {expected_one_of(names)}")
    return names.index(written)
