"""What a strategy has learnt from people, in a file, so that a robot continues after a restart."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from lcorpp.decision import Strategy
from lcorpp.decision.strategies import Session
from lcorpp.domains import Domain
from lcorpp.errors import DataError, DecisionError, FileError
from lcorpp.files import make_folder, read_text, write_atomically
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp session", 1)


class SessionFile:
    """The file with the state of a session; it is read at once, if it exists.

    Args:
        file: of the state. domain: of the session. strategy: whose session it is.

    Raises:
        DecisionError: the strategy does not learn from people, or the state is of another domain or strategy.
        FileError: the file cannot be read or written, or is damaged.
    """

    def __init__(self, file: Path, domain: Domain, strategy: Strategy) -> None:
        if strategy.start is None:
            raise DecisionError(
                f"{strategy.name} does not learn from people, so it has no state; expected e.g. LCORPP+trust"
            )
        self._file = file
        self._owner = {"domain": domain.name, "preset": domain.preset, "strategy": strategy.name}
        self._state: dict[str, Any] | None = None
        try:
            file.stat()
        except FileNotFoundError:
            make_folder(file.parent)
        except OSError as error:
            raise FileError(f"{file}: {error.strerror}") from None
        else:
            self._state = self._read()
        try:  # before the robot moves
            with TemporaryFile(dir=file.parent):
                pass
        except OSError as error:
            raise FileError(f"{file}: it cannot be written: {error.strerror}") from None

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
        write_atomically(self._file, json.dumps(content))

    def _read(self) -> dict[str, Any]:
        try:
            content = FORMAT.read(read_text(self._file))
            json.dumps(content, allow_nan=False)  # Python reads NaN and Infinity, which are no JSON
        except DataError as error:
            raise FileError(f"{self._file}: {error}") from None
        except ValueError:
            raise FileError(f"{self._file}: it is damaged: a number is not finite") from None
        for key, expected in self._owner.items():
            if content.get(key) != expected:
                raise DecisionError(
                    f"{self._file}: the state is of the {key} {content.get(key)!r}; expected {expected!r}"
                )
        state = content.get("state")
        if not isinstance(state, dict):
            raise FileError(f'{self._file}: it is damaged; expected an object "state"')
        return state
