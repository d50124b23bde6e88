"""Replace the file of a store: convert version 1, or rebuild a damaged file from its intact records.

lcorpp wrote version 1 before it used SQLite. Such a file begins with two equal lines: `lcorpp tracks `,
CRC-32 in hexadecimal digits, version, JSON. Frames follow: a marker of 16 bytes that the JSON names, CRC-32,
two lengths (three little-endian uint32), JSON in UTF-8, float64 numbers.
"""

from __future__ import annotations

import json
import logging
import re
import sqlite3
import struct
import zlib
from collections.abc import Iterator
from contextlib import closing, suppress
from itertools import count
from pathlib import Path
from typing import Any

from lcorpp.errors import DataError, FileError
from lcorpp.files import read_bytes, sync_folder, write_atomically
from lcorpp.learning.store import database
from lcorpp.learning.store.records import Row, TrackSchema, is_intact, to_json, with_checksum

LOG = logging.getLogger("lcorpp.learning")

MERGE_LOG = (
    *database.LENIENT,
    "PRAGMA busy_timeout = 0",
    "PRAGMA locking_mode = EXCLUSIVE",
    "SELECT 1 FROM sqlite_master",
    "PRAGMA wal_checkpoint(TRUNCATE)",
)
"""Statements that move everything from the log to the main file; they fail while another process reads."""

_LENGTHS = struct.Struct("<III")


def convert(path: Path) -> None:
    """Convert a store of version 1 to SQLite and log a warning; the original stays as `PATH.old`.

    Of a damaged file all intact frames are converted; a DataError means that both copies of its header are
    damaged. The caller has the writer's lock.
    """
    content = _read_unlocked(path)
    names = _parse_header(content, path)
    schema = TrackSchema(names["channels"], names["interval"], names["classes"], names["points"])
    tracks, labels = dict[str, Row](), dict[int, Row]()
    for facts, trajectory in _iterate_frames(content, bytes.fromhex(names["marker"])):
        number, belief = facts["number"], facts["belief"]
        label = facts["label"], facts["source"], belief and to_json(belief), facts["time"]
        if "id" in facts:
            about = facts["id"], facts["group"], to_json(facts["context"]), to_json(facts["extra"])
            tracks.setdefault(facts["id"], with_checksum(number, *about, *label, trajectory))
        elif facts["of"] in tracks:
            labels.setdefault(number, with_checksum(number, tracks[facts["of"]][0], *label))
    backup = _back_up(path, "old")
    database.write_store(path, names["marker"], schema, tracks.values(), labels.values())
    records = len(tracks) + len(labels)
    LOG.warning(
        "%s: converted from version 1 to SQLite, %d records; the original is %s", path, records, backup
    )


def rebuild(path: Path) -> str:
    """Write the intact records of a damaged file to a new one; return what was done, as a sentence.

    The original stays as `PATH.damaged`. The caller has the writer's lock; no other process reads the file.
    """
    try:
        database.connect(path, "mode=rw", MERGE_LOG).close()
    except sqlite3.DatabaseError as error:
        raise FileError(
            f"{path}: is damaged and cannot be rebuilt, e.g. because another process reads it: {error}"
        ) from None
    with closing(database.connect_reader(path)) as connection:
        identity, schema = database.read_schema(connection)
        tracks, labels = (
            list(filter(is_intact, database.iterate_rows(connection, table)))
            for table in ("track", "later_label")
        )
    backup = _back_up(path, "damaged")
    database.write_store(path, identity, schema, tracks, labels)
    return f"the readable records are in a new file; the damaged one is {backup}"


def _back_up(path: Path, suffix: str) -> str:
    """Copy a file to `PATH.suffix`, or to a name with a number if there is such a file; return that name."""
    names = (database.sibling(path, f".{suffix}{'' if number == 1 else f'-{number}'}") for number in count(1))
    backup = next(name for name in names if not name.exists())
    write_atomically(backup, read_bytes(path))
    sync_folder(backup)
    return backup.name


def _read_unlocked(path: Path) -> bytes:
    """Return the content of a file to which no process writes that uses version 1."""
    try:
        with path.open("rb") as file:
            with suppress(ImportError):  # version 1 had no lock on a system without fcntl
                import fcntl

                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return file.read()
    except BlockingIOError:
        raise FileError(f"{path}: an older lcorpp is writing to it; end that process first") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from None


def _parse_header(content: bytes, path: Path) -> dict[str, Any]:
    """Return the JSON object of the first intact line of the header."""
    lines = re.findall(
        database.LEGACY_MAGIC + rb"(?=([0-9a-f]{8}) (1 [^\n]*))", content[: database.MAX_HEADER]
    )
    for checksum, line in lines:
        if int(checksum, 16) == zlib.crc32(line):
            names: dict[str, Any] = json.loads(line[2:])
            return names
    raise DataError(f"{path}: a store of version 1 whose header is damaged")


def _iterate_frames(content: bytes, marker: bytes) -> Iterator[tuple[dict[str, Any], bytes]]:
    """Yield the JSON object and the numbers of each intact frame."""
    end = 0
    for match in re.finditer(re.escape(marker), content):
        body = match.end() + _LENGTHS.size
        if match.start() < end or body > len(content):
            continue
        checksum, length, size = _LENGTHS.unpack_from(content, match.end())
        if checksum == zlib.crc32(memoryview(content)[body - 8 : body + length + size]):
            end = body + length + size
            yield json.loads(content[body : body + length]), content[body + length : end]
