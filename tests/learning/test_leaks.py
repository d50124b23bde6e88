from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import end_position_leak, leak_note
from lcorpp.values import Dataset

from .data import walkers


def ending_at(ends: np.ndarray) -> Dataset:
    """Tracks from the origin to the given ends (cases, 2), labels in turn."""
    return Dataset(ends[:, :, None] * np.linspace(0, 1, 4), ("in", "out") * (len(ends) // 2))


def test_a_ring_around_the_others_is_a_perfect_leak():
    angle = np.random.default_rng(0).uniform(0, 2 * np.pi, 80)
    radius = np.where(np.arange(80) % 2 == 0, 1.0, 5.0)
    data = ending_at(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    assert end_position_leak(data) == 1
    assert "AUC 1.00" in (leak_note(data) or "")


def test_ends_drawn_alike_do_not_leak():
    data = ending_at(np.random.default_rng(1).normal(size=(400, 2)))
    assert abs(end_position_leak(data) - 0.5) < 0.1  # 3 standard errors
    assert leak_note(data) is None


def test_two_classes_are_needed():
    with pytest.raises(DataError, match="two classes, not 3"):
        end_position_leak(walkers(90, classes=3))
