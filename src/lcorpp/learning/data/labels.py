"""Convert labels to classes, and read labels from a file of their own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from lcorpp.errors import DataError, ParseError, expected_one_of
from lcorpp.files import read_text
from lcorpp.learning.data.csv_reader import column_of, detect_delimiter, parse_line
from lcorpp.learning.data.repairs import RowSource
from lcorpp.learning.data.tracks import Track

HEADINGS = ("id", "track", "person")
"""Names of the first column in the optional heading of a file of labels."""


_WHOLE_DECIMAL = re.compile(r"[+-]?\d+\.\d*(e[+-]?\d+)?", re.IGNORECASE)


def normalize_id(word: str) -> str:
    """Return an id; a whole number that is written as a decimal, such as 1.0 or 1.0e+00, as digits."""
    if "." not in word or not _WHOLE_DECIMAL.fullmatch(word):
        return word
    number = float(word)
    return str(int(number)) if number.is_integer() else word


def class_of_label(word: str, labels: Mapping[str, str] | None) -> str | None:
    """Return the class of a label; None if it is unknown.

    Args:
        labels: label in the file -> class; a class maps to itself, too. None takes every word unchanged.
    """
    if labels is None:
        return word or None
    return labels.get(word, labels.get(normalize_id(word), word if word in labels.values() else None))


def describe_unknown_label(word: str, labels: Mapping[str, str] | None) -> str:
    """Return the error message for an unknown label."""
    known = dict.fromkeys((*(labels or {}), *(labels or {}).values()))
    wanted = expected_one_of(list(known)) if labels else "expected the name of a class"
    return f"unknown label {word!r}; {wanted}" if word else f"no label; {wanted}"


def read_labels(path: str | Path, labels: Mapping[str, str] | None = None) -> dict[str, str]:
    """Read a small CSV of two columns, id and label, with or without a heading.

    Args:
        labels: label in the file -> class; None takes the labels unchanged.

    Returns:
        The class of each id.

    Raises:
        FileError: the file cannot be read.
        ParseError: it is empty, or a line has other columns, an unknown label, or another label for an id.
    """
    classes: dict[str, str] = {}
    lines = read_text(path).splitlines()
    delimiter = detect_delimiter(next(filter(str.strip, lines), ""))
    for number, text in enumerate(lines, start=1):
        row = parse_line(str(path), number, text, delimiter)
        if not row or (number == 1 and row[0].lower() in HEADINGS):
            continue
        if len(row) != 2 or not row[0]:
            message = f"{len(row)} columns; expected 2: an id and its label"
            raise ParseError(str(path), number, 1, message, text)
        name, word = normalize_id(row[0]), row[1]
        label_class = class_of_label(word, labels)
        if label_class is None:
            raise ParseError(
                str(path), number, column_of(text, 1, delimiter), describe_unknown_label(word, labels), text
            )
        if classes.setdefault(name, label_class) != label_class:
            labels_of_id = f"{label_class} here and {classes[name]} before"
            message = f"id {name!r} is {labels_of_id}; expected one label for an id"
            raise ParseError(str(path), number, 1, message, text)
    if not classes:
        raise ParseError(str(path), 1, 1, "the file is empty; expected rows of an id and its label")
    return classes


def attach_labels(tracks: list[Track], classes: Mapping[str, str], file: RowSource) -> list[Track]:
    """Return the tracks whose ids have a class, with that class.

    Tracks of an id that several people had share one label: they are an error or are left out.
    """
    parts: dict[str, list[Track]] = {}
    for track in tracks:
        if track.label is not None:
            raise DataError(f"{file.file}: has labels of its own; expected a file without labels")
        base = track.id if track.id in classes else re.sub(r"#\d+$", "", track.id)
        if base in classes:
            parts.setdefault(base, []).append(track)
    labelled = []
    for name, own in parts.items():
        if len(own) == 1:
            labelled.append(replace(own[0], label=classes[name]))
            continue
        message = (
            f"its id was given to {len(own)} people; the label {classes[name]!r} may belong to any of them"
        )
        rows = sum(len(track) for track in own)
        file.repair_or_raise("labels", 1, message, track=name, rows=rows)
    return labelled
