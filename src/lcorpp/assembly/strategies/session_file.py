"""What a strategy has learnt from people, in a file, so that a robot continues after a restart."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lcorpp.decision import Strategy
from lcorpp.decision.strategies import Session
from lcorpp.errors import DataError, DecisionError, FileError
from lcorpp.files import make_folder, read_text, write_atomically
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp session", 1)


class SessionFile:
    """The file with the state of a session; it is read at once, if it exists.

    Args:
        file: of the state. domain: name of the domain. strategy: whose session it is.

    Raises:
        DecisionError: the strategy does not learn from people, or the state is of another domain or strategy.
        FileError: the file cannot be read, or is damaged.
    """

    def __init__(self, file: Path, domain: str, strategy: Strategy) -> None:
        if strategy.start is None:
            raise DecisionError(
                f"{strategy.name} does not learn from people, so it has no state; expected e.g. LCORPP+trust"
            )
        self._file, self._owner = file, {"domain": domain, "strategy": strategy.name}
        self._state: dict[str, Any] | None = self._read() if file.exists() else None
        make_folder(file.parent)

    def restore(self, session: Session) -> None:
        """Continue from the state; without a file, the session begins anew.

        Raises:
            DecisionError: the state does not fit the session.
        """
        if self._state is not None:
            try:
                session.restore(self._state)
            except DecisionError as error:
                raise DecisionError(f"{self._file}: {error}") from None

    def write(self, session: Session) -> None:
        """Replace the file; an interrupt leaves the former one.

        Raises:
            FileError: it cannot be written.
        """
        content = {**FORMAT.header, **self._owner, "state": session.state()}
        write_atomically(self._file, json.dumps(content, allow_nan=False))

    def _read(self) -> dict[str, Any]:
        try:
            content = FORMAT.read(read_text(self._file))
        except DataError as error:
            raise FileError(f"{self._file}: {error}") from None
        for key, expected in self._owner.items():
            if content.get(key) != expected:
                raise DecisionError(
                    f"{self._file}: the state is of the {key} {content.get(key)!r}; expected {expected!r}"
                )
        state = content.get("state")
        if not isinstance(state, dict):
            raise FileError(f'{self._file}: it is damaged; expected an object "state"')
        return state
