""".pomdp texts shared by several tests."""

from __future__ import annotations

from lcorpp.planning import Pomdp
from tests.planning.models import SHARED

HEAD = "discount: 0.9\nvalues: reward\nstates: a b\nactions: x y\nobservations: u v\n"
BODY = "T: * identity\nO: * uniform\n"

PUBLISHED = sorted(path.name for path in SHARED.glob("*") if path.suffix.lower() == ".pomdp")


def head(states: str | int, actions: str | int, observations: str | int) -> str:
    """A preamble with names or counts."""
    return (
        f"discount: 0.9\nvalues: reward\nstates: {states}\nactions: {actions}\nobservations: {observations}\n"
    )


def same(left: Pomdp, right: Pomdp) -> bool:
    """Whether two models have the same bits."""
    return left.fingerprint == right.fingerprint and bool((left.start == right.start).all())
