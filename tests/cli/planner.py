"""What the tests of the planner's commands share."""

from __future__ import annotations

from pathlib import Path

from tests.conftest import Ended

AUTHORS = Path(__file__).parents[2] / "src/lcorpp/domains/intention/authors.pomdp"


def refused(ended: Ended, *words: str) -> None:
    """Bad input ended in one message with these words, exit code 2, no traceback and no output."""
    assert ended.code == 2
    assert ended.out == ""
    assert ended.err.count("\n") <= 4
    assert "Traceback" not in ended.err
    for word in words:
        assert word in ended.err
