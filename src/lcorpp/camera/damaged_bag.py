"""What is readable of a ROS 2 bag (SQLite) whose recorder was killed, or whose file was cut or damaged."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

LOG = logging.getLogger("lcorpp.robot")

SUFFIX = ".db3"
MAGIC, PAGE_SIZE, PAGES = b"SQLite format 3\0", slice(16, 18), slice(28, 32)
"""Of the file format of SQLite: the beginning of a file, and where it states its size."""

ZSTD = b"\x28\xb5\x2f\xfd"
"""The beginning of a message that is compressed by itself."""

MAX_BYTES = 2**29
"""Largest file of which a part is read: it is copied to memory."""


@dataclass(frozen=True)
class Topic:
    """A topic of a damaged bag, with the fields of `rosbags.interfaces.Connection` that lcorpp reads."""

    topic: str
    msgtype: str
    msgcount: int


class DamagedBag:
    """The messages of a bag before the first fault, in the order of their recording.

    It is a `BagReader`.

    Args:
        files: of the bag (.db3). store: the `Typestore` of rosbags; types of messages in the bag are added.
        parse: `get_types_from_msg` of rosbags.

    Attributes:
        connections: the topics. fault: why the messages end; empty if all could be read.

    Raises:
        sqlite3.Error: not even its topics can be read.
    """

    def __init__(
        self, files: Sequence[Path], store: Any, parse: Callable[[str, str], dict[str, Any]]
    ) -> None:
        self._store, self._parse = store, parse
        self._messages, self._kinds, faults = list[tuple[str, int, bytes]](), dict[str, str](), list[str]()
        for file in files:
            try:
                faults += self._read(file)
            except (sqlite3.Error, OSError) as error:
                if len(files) == 1:
                    raise
                faults.append(f"{file.name}: {error}")
        self.fault = "; ".join(faults)
        self._messages.sort(key=lambda message: message[1])
        counts = dict.fromkeys(self._kinds, 0)
        for name, _, _ in self._messages:
            counts[name] += 1
        self.connections = [Topic(name, kind, counts[name]) for name, kind in self._kinds.items()]
        self._topics = {topic.topic: topic for topic in self.connections}

    def _read(self, file: Path) -> list[str]:
        """Read a file; return why its messages end, if not at its end."""
        with closing(_open(file)) as database:
            self._kinds |= dict(database.execute("SELECT name, type FROM topics"))
            names = dict(database.execute("SELECT id, name FROM topics"))
            self._register(database)
            try:
                rows = database.execute("SELECT topic_id, timestamp, data FROM messages NOT INDEXED")
                for topic, time, data in rows:
                    if topic not in names or not isinstance(data, bytes):
                        raise sqlite3.DatabaseError(f"message {len(self._messages) + 1} is no message")
                    self._messages.append((names[topic], int(time), data))
            except (sqlite3.Error, ValueError, TypeError) as error:
                return [str(error)]
        return []

    def messages(self, connections: Collection[Topic] = ()) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield topic, nanoseconds and content of each message of some topics; of all, if none is given."""
        names = {topic.topic for topic in connections or self.connections}
        for name, time, data in self._messages:
            if name in names:
                yield self._topics[name], time, data

    def deserialize(self, data: bytes, kind: str) -> Any:
        """Return a message."""
        if data.startswith(ZSTD):
            from zstandard import ZstdDecompressor  # which rosbags needs

            data = ZstdDecompressor().decompress(data, max_output_size=MAX_BYTES)
        return self._store.deserialize_cdr(data, kind)

    def _register(self, database: sqlite3.Connection) -> None:
        """Add the definitions of messages in the bag, which those of ROS 2 Iron and later have."""
        try:
            found = database.execute("SELECT topic_type, encoded_message_definition FROM message_definitions")
            for kind, text in found.fetchall():
                if kind not in self._store.types:
                    own = self._parse(text, kind)
                    new = {name: fields for name, fields in own.items() if name not in self._store.types}
                    self._store.register(new)
        except Exception as error:  # no table, a damaged page, or a text that is no definition
            LOG.debug("definitions of messages: %s", error)


@lru_cache(maxsize=64)
def warn_once(text: str) -> None:
    """Log a warning; a bag is opened several times, and warned of once."""
    LOG.warning("%s", text)


def _open(file: Path) -> sqlite3.Connection:
    """Return the database; a file that was cut is read as if the rest were empty pages."""
    database = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True)
    try:
        database.execute("SELECT name FROM topics").fetchall()
    except sqlite3.Error:
        database.close()
    else:
        return database
    if file.stat().st_size > MAX_BYTES:
        raise sqlite3.DatabaseError(f"more than {MAX_BYTES} bytes")
    content = file.read_bytes()
    if not content.startswith(MAGIC):
        raise sqlite3.DatabaseError("file is not a database")
    stated = int.from_bytes(content[PAGE_SIZE], "big")
    size = (65536 if stated == 1 else stated) * int.from_bytes(content[PAGES], "big")
    if size > MAX_BYTES:
        raise sqlite3.DatabaseError(f"{size} bytes are stated")
    database = sqlite3.connect(":memory:")
    database.deserialize(content.ljust(size, b"\0"))
    return database
