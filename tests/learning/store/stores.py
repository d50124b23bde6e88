"""Small stores with known content, for the tests of the store."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from lcorpp.learning.store import NewTrack, Store, TrackSchema
from lcorpp.values import Distribution

CLASSES = ("interested", "not_interested")
SCHEMA = TrackSchema(("x", "y"), 0.033, CLASSES)


def walk(row: int, points: int = 4) -> np.ndarray:
    """(2, points) a walk, different for each row."""
    return np.arange(2.0 * points).reshape(2, points) / 100 + row


def track(row: int, points: int = 4, **others: object) -> NewTrack:
    """Return track number `row`: every third is labelled by a person, every seventh has no label."""
    label = None if row % 7 == 6 else CLASSES[row % 2]
    facts = {
        "source": "person" if row % 3 == 2 else "robot",
        "belief": Distribution(CLASSES, np.array([0.5 + row % 5 / 10, 0.5 - row % 5 / 10])),
        "context": {"time": "afternoon", "location": f"room {row}"},
        "id": f"t{row}",
        "time": datetime(2026, 1, 1, 12, 0, row % 60, tzinfo=UTC),
        "extra": {"row": row},
    }
    return NewTrack(walk(row, points), **{"label": label, **facts, **others})  # type: ignore[arg-type]


def filled(path: Path, rows: int, schema: TrackSchema = SCHEMA, points: int = 4) -> bytes:
    """Write a store of the first tracks and return its bytes."""
    with Store(path, schema) as store:
        store.extend([track(row, points) for row in range(rows)], durable=False)
    return path.read_bytes()


def crash(act, files: int, monkeypatch) -> None:
    """Interrupt `act` when it has replaced this many files and is about to replace another."""
    written, replace = [], os.replace

    def interrupt(name, target):
        if len(written) == files:
            raise KeyboardInterrupt
        written.append(target)
        replace(name, target)

    with monkeypatch.context() as patch:
        patch.setattr("os.replace", interrupt)
        with pytest.raises(KeyboardInterrupt):
            act()
