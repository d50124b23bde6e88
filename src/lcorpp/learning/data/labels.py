"""What written labels mean, and labels that lie in a file of their own."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from lcorpp.errors import DataError, ParseError, expected_one_of
from lcorpp.files import read_text
from lcorpp.learning.data.assembly import RawTrack
from lcorpp.learning.data.cleaning import ClassOf
from lcorpp.learning.data.csv_reader import column_of
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.tracks import Track

HEADINGS = ("id", "track", "person")
"""How the first column of a file of labels may be called, if it has a line that says so."""


def class_of_label(word: str, labels: Mapping[str, str] | None) -> str | None:
    """The class of a written label; None if it is unknown.

    Args:
        labels: written label -> class; a class stands for itself, too. None takes every word as it is.
    """
    if labels is None:
        return word or None
    return labels.get(word, word if word in labels.values() else None)


def make_label_reader(labels: Mapping[str, str] | None, source: RowSource, repair_log: RepairLog) -> ClassOf:
    """What tells the class of a label in a line of `source`; one that has none is refused or left out."""

    def class_of(word: str, line: int, raw: RawTrack) -> str | None:
        found = class_of_label(word, labels)
        if found is None:
            message = unknown(word, labels)
            where = {"field": "label", "track": raw.id}
            repair_log.repair_or_raise("labels", source, line, message, "left out", **where, rows=len(raw))
        return found

    return class_of


def unknown(word: str, labels: Mapping[str, str] | None) -> str:
    """What is wrong with a label that has no meaning."""
    known = dict.fromkeys((*(labels or {}), *(labels or {}).values()))
    wanted = expected_one_of(list(known)) if labels else "expected the name of a class"
    return f"unknown label {word!r}; {wanted}" if word else f"no label; {wanted}"


def read_labels(path: str | Path, labels: Mapping[str, str] | None = None) -> dict[str, str]:
    """Read a small CSV of two columns, id and label, with or without a line that names them.

    Args:
        labels: what the written labels mean; None takes them as they are.

    Returns:
        The class of each id.

    Raises:
        FileError: the file cannot be read.
        ParseError: it is empty, or a line has other columns, an unknown label, or an id again.
    """
    classes: dict[str, str] = {}
    lines = read_text(path).splitlines()
    for number, text in enumerate(lines, start=1):
        try:
            row = [cell.strip() for cell in next(csv.reader([text], strict=True), [])]
        except csv.Error as error:
            raise ParseError(str(path), number, 1, f"not a row of CSV ({error})", text) from None
        if not row or (number == 1 and row[0].lower() in HEADINGS):
            continue
        if len(row) != 2 or not row[0]:
            message = f"{len(row)} columns; expected 2: an id and its label"
            raise ParseError(str(path), number, 1, message, text)
        name, word = row
        found = class_of_label(word, labels)
        if found is None:
            raise ParseError(str(path), number, column_of(text, 1), unknown(word, labels), text)
        if classes.setdefault(name, found) != found:
            message = f"id {name!r} is {found} here and {classes[name]} before; expected one label for an id"
            raise ParseError(str(path), number, 1, message, text)
    if not classes:
        raise ParseError(str(path), 1, 1, "the file is empty; expected rows of an id and its label")
    return classes


def attach_labels(
    tracks: list[Track], classes: Mapping[str, str], file: Path, repair_log: RepairLog
) -> list[Track]:
    """The tracks whose ids have a class, with it.

    An id that was given away twice has one label for two people: those tracks are refused or left out.

    Raises:
        DataError: a track has a label of its own, or an id was split and repair `labels` was not requested.
    """
    parts: dict[str, list[Track]] = {}
    for track in tracks:
        if track.label is not None:
            raise DataError(f"{file}: has labels of its own; expected a file without, to go with another one")
        base = track.id if track.id in classes else re.sub(r"#\d+$", "", track.id)
        if base in classes:
            parts.setdefault(base, []).append(track)
    found = []
    for name, own in parts.items():
        if len(own) == 1:
            found.append(replace(own[0], label=classes[name]))
            continue
        message = f"its id was given to {len(own)} people; the label {classes[name]!r} may be any one's"
        rows = sum(len(track) for track in own)
        repair_log.repair_or_raise(
            "labels", WholeFile(str(file)), 1, message, "left out", track=name, rows=rows
        )
    return found


class WholeFile:
    """A file as a whole, where no line can be named."""

    def __init__(self, file: str) -> None:
        self.file, self.ended = file, True

    def error_at(self, line: int, field: str, message: str) -> DataError:
        return DataError(f"{self.file}: {message}")
