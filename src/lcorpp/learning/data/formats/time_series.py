"""Labelled time series in .ts files, the format of the UEA and UCR archives.

Lines of a header begin with @; each line after @data is a case: its channels, separated by colons, of numbers
separated by commas, and its class. A question mark is a missing value.

Source: Bagnall and others, arXiv 1811.00075; the documentation of aeon and sktime.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lcorpp.errors import DataError, ParseError, expected_one_of
from lcorpp.files import read_text
from lcorpp.learning.data.csv_reader import is_number
from lcorpp.learning.data.measures import Measures
from lcorpp.values import Array, Dataset, stack_signals

TAGS = (
    *("problemname", "timestamps", "missing", "univariate", "dimensions", "dimension", "equallength"),
    *("serieslength", "classlabel", "targetlabel", "data"),
)


def starts_time_series(start: str) -> bool:
    """Whether a text begins with a tag of the header of a .ts file, after its comments."""
    first = next((line for line in start.splitlines() if line.strip() and line[0] not in "#%"), "")
    return bool(re.match(r"@[a-z]{4}", first.strip().lower()))


@dataclass(frozen=True)
class Header:
    """The header of a .ts file.

    name: of the problem. channels, points: their number, None if not stated; points only of equal lengths.
    is_equal: whether all series are of one length. classes: empty if they are not listed.
    first: the line of the first case.
    """

    name: str
    channels: int | None
    points: int | None
    is_equal: bool
    classes: tuple[str, ...]
    first: int


def read_time_series(path: Path, measures: Measures) -> Dataset:
    """Read a .ts file as a data set of channels dim_0, dim_1, ...; series may differ in length.

    Missing values at the end of a series end it, others are interpolated linearly; a note counts them.

    Args:
        measures: per_second has the time points per second; by default a point lasts one second.

    Raises:
        FileError: the file cannot be read.
        ParseError: a line is malformed; a series has no value; or the file is a regression set or has time
            stamps.
        DataError: a unit of length is given.
    """
    if measures.length is not None:
        raise DataError(f"{path}: time series have no unit of length; expected no --unit")
    lines = read_text(path).splitlines()
    header = _read_header(str(path), lines)
    signals, labels, missing, ends = list[Array](), list[str](), 0, 0
    for number, text in enumerate(lines[header.first - 1 :], start=header.first):
        if text.strip() and text[0] not in "#%":
            signal, label, holes, points = _read_case(str(path), number, text, header)
            signals.append(signal)
            labels.append(label)
            missing += holes
            ends += len(signal) * (points - signal.shape[1])
            header = replace(header, channels=len(signal))
            if header.is_equal:
                header = replace(header, points=points)
    if not signals:
        raise ParseError(str(path), header.first, 1, "no cases after @data; expected a line for each")
    notes = []
    if missing:
        notes.append(f"{missing} missing values inside of series are interpolated linearly")
    if ends:
        notes.append(f"{ends} missing values at the end of series end them")
    if measures.per_second is None:
        notes.append(
            "no interval between time points is known, so each lasts 1 s; --fps gives points per second"
        )
    notes.append("each series counts as a person of its own, also when people are split for training")
    return Dataset(
        stack_signals(signals),
        tuple(labels),
        source=header.name or path.name,
        notes=tuple(notes),
        interval=1 / (measures.per_second or 1.0),
        channels=tuple(f"dim_{channel}" for channel in range(len(signals[0]))),
    )


def _read_header(file: str, lines: list[str]) -> Header:
    given: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text or text[0] in "#%":
            continue
        tag, value = (*text.split(None, 1), "")[:2]
        tag = tag.lower().removeprefix("@")
        if not text.startswith("@") or tag not in TAGS:
            if tag == "relation":
                message = "an ARFF file; expected the .ts file of the same archive, or CSV"
                raise ParseError(file, number, 1, message, line)
            expected = (
                f"expected a line that begins with @ and {expected_one_of(TAGS).removeprefix('expected ')}"
            )
            raise ParseError(file, number, 1, f"unknown line before @data; {expected}", line)
        given[tag] = value.strip()
        if tag == "data":
            return _make_header(given, number + 1)
        _refuse_header(file, number, line, tag, value.strip().lower())
    raise ParseError(file, len(lines), 1, "no line @data; expected it before the cases", lines[-1])


def _refuse_header(file: str, number: int, line: str, tag: str, value: str) -> None:
    """Raise an error for kinds of .ts files that are not labelled series of a fixed interval."""
    if tag == "targetlabel" and value.startswith("true"):
        message = "a regression set (@targetLabel true); expected classes: @classLabel true and their names"
    elif tag == "classlabel" and not value.startswith("true"):
        message = "no classes (@classLabel false), as in a regression set; expected @classLabel true"
    elif tag == "timestamps" and value.startswith("true"):
        message = "series with time stamps (@timeStamps true); expected a fixed interval, without time stamps"
    elif tag in ("dimensions", "dimension", "serieslength") and not value.isdecimal():
        message = f"{value!r} is not a whole number"
    else:
        return
    raise ParseError(file, number, 1, message, line)


def _make_header(given: Mapping[str, str], first: int) -> Header:
    channels = given.get("dimensions", given.get("dimension"))
    if channels is None and given.get("univariate", "").lower() == "true":
        channels = "1"
    has_length = given.get("equallength", "true").lower() == "true" and "serieslength" in given
    return Header(
        given.get("problemname", ""),
        None if channels is None else int(channels),
        int(given["serieslength"]) if has_length else None,
        given.get("equallength", "").lower() == "true",
        tuple(given.get("classlabel", "").split()[1:]),
        first,
    )


def _read_case(file: str, line: int, text: str, header: Header) -> tuple[Array, str, int, int]:
    """Return the signal (channels, points) of a case, its class, how many values were missing inside, and the
    number of time points with those missing at the end."""
    *channels, label = text.strip().split(":")
    label = label.strip()
    if not channels or (header.channels is not None and len(channels) != header.channels):
        expected = f"{header.channels or 1} channels and the class, separated by colons"
        raise ParseError(file, line, 1, f"{len(channels)} channels and a class; expected {expected}", text)
    column = len(text.rstrip()) - len(label) + 1
    if header.classes and label not in header.classes:
        raise ParseError(file, line, column, f"class {label!r}; {expected_one_of(header.classes)}", text)
    if not label:
        raise ParseError(file, line, column, "no class after the last colon", text)
    rows = [_read_numbers(file, line, text, number, part) for number, part in enumerate(channels)]
    for number, row in enumerate(rows):
        if len(row) != len(rows[0]):
            message = (
                f"dim_{number} has {len(row)} time points and dim_0 has {len(rows[0])}; expected as many"
            )
            raise ParseError(file, line, 1, message, text)
    signal = np.stack(rows)
    known = ~np.isnan(signal)
    if not known.any(axis=1).all():
        channel = int(np.argmin(known.any(axis=1)))
        raise ParseError(file, line, 1, f"channel dim_{channel} has no value", text)
    points = int(np.flatnonzero(known.any(axis=0))[-1]) + 1
    signal, known = signal[:, :points], known[:, :points]
    if header.points is not None and len(rows[0]) != header.points:
        message = f"{len(rows[0])} time points; expected {header.points} (@equalLength true)"
        raise ParseError(file, line, 1, message, text)
    if points < 2:
        raise ParseError(file, line, 1, f"{points} time points; expected at least 2", text)
    at = np.arange(points)
    whole = np.stack(
        [np.interp(at, at[is_known], row[is_known]) for row, is_known in zip(signal, known, strict=True)]
    )
    return whole, label, int((~known).sum()), len(rows[0])


def _read_numbers(file: str, line: int, text: str, channel: int, part: str) -> Array:
    """(points,) the numbers of a channel, NaN for missing ones."""
    words = [word.strip() for word in part.split(",")]
    if "?" in words:
        words = ["nan" if word == "?" else word for word in words]
    try:
        values = np.array(words, dtype=np.float64)
        if not np.isinf(values).any():
            return values
    except ValueError:
        pass
    bad = next(word for word in words if not is_number(word) or np.isinf(float(word)))
    message = (
        f"{bad!r} in channel dim_{channel} is not a finite number; expected numbers, or ? for a missing one"
    )
    raise ParseError(file, line, text.index(part) + 1, message, text)
