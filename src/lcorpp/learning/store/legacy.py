"""Read stores of version 1, which lcorpp wrote before it used SQLite, to convert them.

The file begins with two equal lines: `lcorpp tracks `, CRC-32 in hexadecimal digits, version, JSON. Frames
follow: a marker of 16 bytes that the JSON names, CRC-32, two lengths (three little-endian uint32), JSON in
UTF-8, float64 numbers. Of a damaged file all intact frames are read.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lcorpp.errors import DataError, FileError
from lcorpp.learning.store.database import LEGACY_MAGIC, MAX_HEADER
from lcorpp.learning.store.records import Row, to_json, with_checksum
from lcorpp.learning.store.schema import StoreHeader, TrackSchema

_LENGTHS = struct.Struct("<III")


def read_legacy(path: Path) -> tuple[StoreHeader, list[Row], list[Row]]:
    """Read a store of version 1.

    Returns:
        Its header and the rows for the tables `track` and `later_label`.

    Raises:
        FileError: the file cannot be read, or another process writes to it.
        DataError: both copies of its header are damaged, or its version is not 1.
    """
    content = _read_unlocked(path)
    header = _parse_header(content, path)
    tracks, labels, records = list[Row](), list[Row](), dict[str, int]()
    numbers = set[int]()
    for facts, trajectory in _iterate_frames(content, bytes.fromhex(header.identity)):
        number, id = facts["number"], facts.get("id") or facts["of"]
        belief = None if facts["belief"] is None else to_json(facts["belief"])
        label = facts["label"], facts["source"], belief, facts["time"]
        if number in numbers or ("id" in facts) == (id in records):
            continue  # a copy, or a label of a lost track
        numbers.add(number)
        if "id" in facts:
            records[id] = number
            cells = to_json(facts["context"]), to_json(facts["extra"]), facts["points"], trajectory
            tracks.append(with_checksum(number, id, facts["group"], *label, *cells))
        else:
            labels.append(with_checksum(number, records[id], *label))
    return header, tracks, labels


def _read_unlocked(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            try:
                import fcntl

                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except ImportError:
                pass  # version 1 had no lock on this system
            except BlockingIOError:
                raise FileError(f"{path}: an older lcorpp is writing to it; end that process first") from None
            return file.read()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from None


def _parse_header(content: bytes, path: Path) -> StoreHeader:
    at = content.find(LEGACY_MAGIC, 0, MAX_HEADER)
    while at >= 0:
        line = content[at + len(LEGACY_MAGIC) : content.find(b"\n", at)]
        checksum, _, rest = line.partition(b" ")
        if checksum == b"%08x" % zlib.crc32(rest):
            version, _, text = rest.partition(b" ")
            if version != b"1":
                raise DataError(
                    f"{path}: its version is {version.decode()}; this lcorpp reads versions 1 and 2"
                )
            names = json.loads(text)
            schema = TrackSchema(names["channels"], names["interval"], names["classes"], names["points"])
            return StoreHeader(schema, names["marker"])
        at = content.find(LEGACY_MAGIC, at + 1, MAX_HEADER)
    raise DataError(f"{path}: a store of version 1 whose header is damaged")


def _iterate_frames(content: bytes, marker: bytes) -> Iterator[tuple[dict[str, Any], bytes]]:
    at = content.find(marker)
    while at >= 0:
        body = at + len(marker) + _LENGTHS.size
        if body > len(content):
            return
        checksum, length, size = _LENGTHS.unpack_from(content, at + len(marker))
        end = body + length + size
        if end <= len(content) and checksum == zlib.crc32(memoryview(content)[body - 8 : end]):
            yield json.loads(content[body : body + length]), content[body + length : end]
            at = content.find(marker, end)
        else:
            at = content.find(marker, at + 1)
