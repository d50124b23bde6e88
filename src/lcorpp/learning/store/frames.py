"""The bytes of a store: frames one after the other, each known whole by its checksum.

A frame is

    marker          16 bytes, drawn at random when the store was made, so that no other content has them
    checksum        CRC-32 of all that follows, uint32
    facts, numbers  the lengths of the two parts in bytes, two uint32
    facts           JSON in UTF-8
    numbers         float64

every integer and number little-endian. Where bytes are damaged, the next marker with a whole frame behind it
is where reading goes on, as in Avro's object container files.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

MARKER = 16
"""Bytes of a marker."""

MOST_FACTS, MOST_NUMBERS = 2**20, 2**26
"""Bytes that the parts of a frame have at most: what claims more is damaged."""

_SUM, _LENGTHS = struct.Struct("<I"), struct.Struct("<II")
_HEAD = MARKER + _SUM.size + _LENGTHS.size
_BLOCK = 2**20


@dataclass(frozen=True, slots=True)
class Frame:
    """A whole frame, from byte `start` up to byte `stop` of the file."""

    start: int
    stop: int
    facts: bytes
    numbers: bytes


@dataclass(frozen=True, slots=True)
class Gap:
    """Bytes of the file, from `start` up to `stop`, that hold no whole frame."""

    start: int
    stop: int


def framed(marker: bytes, facts: bytes, numbers: bytes) -> bytes:
    """The bytes of a frame; its parts must not be longer than `MOST_FACTS` and `MOST_NUMBERS`."""
    lengths = _LENGTHS.pack(len(facts), len(numbers))
    return b"".join([marker, _SUM.pack(_sum(lengths, facts, numbers)), lengths, facts, numbers])


def frame_at(file: BinaryIO, marker: bytes, start: int, stop: int) -> Frame | None:
    """The frame that begins at byte `start` and ends at byte `stop` or before; None where there is none."""
    file.seek(start)
    head = file.read(_HEAD)
    if len(head) < _HEAD or not head.startswith(marker):
        return None
    (checksum,) = _SUM.unpack_from(head, MARKER)
    facts, numbers = _LENGTHS.unpack_from(head, MARKER + _SUM.size)
    end = start + _HEAD + facts + numbers
    if facts > MOST_FACTS or numbers > MOST_NUMBERS or end > stop:
        return None
    body = file.read(facts + numbers)
    if len(body) < facts + numbers or _sum(head[MARKER + _SUM.size :], body) != checksum:
        return None
    return Frame(start, end, body[:facts], body[facts:])


def frames(file: BinaryIO, marker: bytes, start: int, stop: int) -> Iterator[Frame | Gap]:
    """What lies between two bytes of a file, in its order; gaps and frames join without a rest."""
    while start < stop:
        frame, at = frame_at(file, marker, start, stop), start
        while frame is None and at < stop:
            at = _next_marker(file, marker, at + 1, stop)
            frame = frame_at(file, marker, at, stop) if at < stop else None
        if at > start:
            yield Gap(start, at)
        if frame is not None:
            yield frame
        start = frame.stop if frame is not None else stop


def _next_marker(file: BinaryIO, marker: bytes, start: int, stop: int) -> int:
    """The first byte from `start` on where a marker begins; `stop` where none is left."""
    while start < stop:
        file.seek(start)
        block = file.read(min(_BLOCK, stop - start))
        found = block.find(marker)
        if found >= 0:
            return start + found
        if len(block) < MARKER or start + len(block) >= stop:
            return stop
        start += len(block) - MARKER + 1
    return stop


def _sum(*parts: bytes) -> int:
    checksum = 0
    for part in parts:
        checksum = zlib.crc32(part, checksum)
    return checksum
