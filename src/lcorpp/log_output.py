"""The log of the standard library on standard error, for commands and their worker processes."""

from __future__ import annotations

import logging
import sys
from typing import TextIO

from lcorpp.terminal import escape_controls


class StandardErrorHandler(logging.StreamHandler[TextIO]):
    """A handler that writes to what `sys.stderr` is when a message arrives."""

    def __init__(self) -> None:
        logging.Handler.__init__(self)
        self.setFormatter(logging.Formatter("%(name)s: %(message)s"))

    def format(self, record: logging.LogRecord) -> str:
        return escape_controls(super().format(record))

    @property
    def stream(self) -> TextIO:  # type: ignore[override]
        return sys.stderr


def show_log(level: int, name: str = "lcorpp") -> None:
    """Show a package's messages from a level on, e.g. `logging.INFO`; a lower level that is set remains.

    Args:
        name: "lcorpp", or a package such as "lcorpp.reasoning".
    """
    root, log = logging.getLogger("lcorpp"), logging.getLogger(name)
    if not root.handlers:
        root.addHandler(StandardErrorHandler())
    log.setLevel(min(level, log.getEffectiveLevel()))


def find_log_level() -> int:
    """Return the level from which on messages of lcorpp are shown, for `show_log` in another process."""
    return logging.getLogger("lcorpp").getEffectiveLevel()
