"""Engines for programs of any size, where the sizes of programs would choose."""

from __future__ import annotations

import pytest

from lcorpp.reasoning.circuit import choice
from lcorpp.reasoning.factors import division
from lcorpp.reasoning.transitions import elimination_tree


def force_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Choose tables and blocks wherever a program has them."""
    monkeypatch.setattr(elimination_tree, "MAX_DIAGRAM_WIDTH", -1)
    monkeypatch.setattr(elimination_tree, "MAX_PRUNED_WIDTH", -1)
    monkeypatch.setattr(division, "MAX_DIAGRAM_WIDTH", -1)
    monkeypatch.setattr(choice, "is_cheaper", lambda *_: True)
    monkeypatch.setattr(choice, "find_small_diagram", lambda _: None)
