"""The results of work units in an SQLite file, each on the disk before the next is awaited."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from lcorpp.errors import DataError, FileError

APPLICATION_ID, VERSION = 0x6C637764, 1
"""SQLite's `application_id` ("lcwd") and `user_version` of a store."""

TABLES = f"""
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {VERSION};
CREATE TABLE identity (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE unit (key TEXT PRIMARY KEY, result TEXT NOT NULL);
"""


class UnitStore:
    """Results of work units by the key of each; for one process at a time, as a context.

    A crash at any moment loses no result that was added: each is a transaction of its own.
    """

    def __init__(self, path: Path, identity: Mapping[str, str]) -> None:
        """Open a store; create it if there is no file, or an empty one.

        Args:
            path: the file; its folder exists.
            identity: what the results of all units depend on, name -> text.

        Raises:
            FileError: the file cannot be read or written, or another process writes to it.
            DataError: the file is no such store, has another version of the format, or another identity.
        """
        self.path, self._results = path, dict[str, Any]()
        with self._name_errors():
            self._connection = sqlite3.connect(path, timeout=0, isolation_level=None)
        try:
            self._open(identity)
        except BaseException:
            self._connection.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def __len__(self) -> int:
        return len(self._results)

    def __contains__(self, key: str) -> bool:
        return key in self._results

    def __getitem__(self, key: str) -> Any:
        return self._results[key]

    def add(self, key: str, result: Any) -> None:
        """Add the result of a unit; it is on the disk when this returns.

        Args:
            result: what JSON can represent; floats keep all their digits.

        Raises:
            FileError: the disk is full or fails. The file keeps the earlier results.
        """
        text = json.dumps(result)
        with self._name_errors():
            self._connection.execute("INSERT OR REPLACE INTO unit VALUES (?, ?)", (key, text))
        self._results[key] = json.loads(text)

    def _open(self, identity: Mapping[str, str]) -> None:
        execute = self._connection.execute
        with self._name_errors():
            execute("PRAGMA locking_mode = EXCLUSIVE")  # until the connection is closed
            execute("PRAGMA fullfsync = ON")  # macOS; without effect elsewhere
            execute("BEGIN EXCLUSIVE")
            application, version, tables = execute(
                "SELECT *, (SELECT count(*) FROM sqlite_master)"
                " FROM pragma_application_id, pragma_user_version"
            ).fetchone()
            if application == version == tables == 0:
                for statement in TABLES.split(";"):
                    execute(statement)
                application, version = APPLICATION_ID, VERSION
            execute("COMMIT")
            if application != APPLICATION_ID:
                raise DataError(f"{self.path}: an SQLite file, but not of results of work units")
            if version != VERSION:
                raise DataError(f"{self.path}: its version is {version}; this lcorpp has version {VERSION}")
            stored = dict(execute("SELECT name, value FROM identity"))
            self._results = {key: self._parse(text) for key, text in execute("SELECT key, result FROM unit")}
            if not self._results and stored != identity:  # nothing depends on the earlier identity
                execute("DELETE FROM identity")
                self._connection.executemany("INSERT INTO identity VALUES (?, ?)", identity.items())
                stored = dict(identity)
        for name in (*identity, *stored):
            was, now = stored.get(name, "missing"), identity.get(name, "missing")
            if was != now:
                raise DataError(
                    f"{self.path}: its {len(self)} results are of another run: {name} was {was}, now {now};"
                    " expected another folder, or the file deleted"
                )

    def _parse(self, text: str) -> Any:
        """Return a stored result."""
        try:
            return json.loads(text)
        except (ValueError, RecursionError) as error:
            raise DataError(f"{self.path}: a damaged result: {error}") from None

    @contextmanager
    def _name_errors(self) -> Iterator[None]:
        """Raise errors of SQLite as typed ones that name the file."""
        try:
            yield
        except sqlite3.Error as error:
            code = getattr(error, "sqlite_errorcode", None)
            if code == sqlite3.SQLITE_BUSY:
                reason = "another process writes to it"
            elif code in (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT):
                raise DataError(f"{self.path}: not a file of results, or a damaged one: {error}") from None
            elif code == sqlite3.SQLITE_FULL:
                reason = f"the disk is full; the {len(self)} finished results are kept"
            else:
                reason = str(error)
            raise FileError(f"{self.path}: cannot be written: {reason}") from None


def hash_unit(unit: Any) -> str:
    """Return the key of a unit: 128 bits of the SHA-256 of its JSON."""
    return hashlib.sha256(json.dumps(unit, sort_keys=True).encode()).hexdigest()[:32]


def make_seed(seed: int, key: str) -> int:
    """Return the seed of a unit, from that of the run and the key of the unit: 64 bits."""
    return int(hashlib.sha256(f"{seed} {key}".encode()).hexdigest()[:16], 16)
