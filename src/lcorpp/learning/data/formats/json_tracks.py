"""Tracks in JSON: TrajNet++ (a JSON object in each line) and the 3D labels of JRDB.

Sources: Kothari, Kreiss and Alahi, IEEE Transactions on Intelligent Transportation Systems 23, 2022
(TrajNet++); Martin-Martin and others, IEEE TPAMI 45, 2023 (JRDB).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.errors import DataError, LcorppError, ParseError
from lcorpp.files import open_text, read_text
from lcorpp.learning.data.csv_reader import RowBatch
from lcorpp.learning.data.ingest import ReadOptions, assemble_tracks
from lcorpp.learning.data.measures import Measures
from lcorpp.learning.data.repairs import RowSource
from lcorpp.learning.data.tracks import Track
from lcorpp.notebook import join_some

JRDB_FPS = 15.0
"""Frames per second of JRDB's point clouds."""

Row = tuple[int, float, str, float, float]
"""Line, frame, id, x and y."""


def starts_json(start: str) -> bool:
    """Whether a text begins like an object or a list of JSON."""
    return bool(re.match(r'\s*(\{\s*("|\}|$)|\[\s*([\[{"\]]|$))', start))


class JsonFile(RowSource):
    """A file of JSON that locates its errors by line."""

    def error_at(self, line: int, field: str, message: str) -> LcorppError:
        """Return a ParseError with the text of the line."""
        with open_text(self.file) as file:
            text = next(islice(file, line - 1, None), "")
        return ParseError(self.file, line, 1, message, text)


def read_json(path: Path, options: ReadOptions) -> tuple[list[Track], tuple[str, ...]]:
    """Read tracks in JSON; return them, in metres, and notes about the file.

    Raises:
        ParseError: the file is not JSON, or has another content; a row or track has a fault whose repair was
            not requested; or the frame rate is neither given nor in the file.
        FileError: the file cannot be read.
    """
    if options.columns:
        raise DataError(f"{path}: a JSON file has no columns; expected no --column")
    text = read_text(path)
    source = JsonFile(path, options.repair_log)
    try:
        whole = json.loads(text)
    except json.JSONDecodeError as error:
        if error.msg != "Extra data":
            raise ParseError(
                str(path), error.lineno, error.colno, f"not JSON: {error.msg}", _line(text, error.lineno)
            ) from None
        whole = None
    if isinstance(whole, dict) and not {"track", "scene"} & set(whole):
        return _read_jrdb(path, whole, source, options)
    if whole is None or isinstance(whole, dict):
        return _read_trajnet(path, text, source, options)
    raise _refuse(path, whole)


def _refuse(path: Path, whole: object) -> ParseError:
    if isinstance(whole, dict):
        content = f"an object of {join_some(list(whole))}"
    else:
        first = whole[0] if isinstance(whole, list) and whole else None
        keys = f" with {join_some(list(first))}" if isinstance(first, dict) else ""
        content = f"a list{keys}"
    target = path.with_suffix(".csv")
    convert = f"pandas.read_json({str(path)!r}).to_csv({str(target)!r}, index=False)"
    message = (
        f"a JSON file, {content}; expected TrajNet++ (in each line an object 'track' or 'scene') or JRDB"
        f" ('labels' of each .pcd file), or CSV; a list of records becomes CSV in Python by {convert}"
    )
    return ParseError(str(path), 1, 1, message)


def _line(text: str, number: int) -> str:
    return next(islice(text.splitlines(), number - 1, None), "")


def _read_trajnet(
    path: Path, text: str, source: JsonFile, options: ReadOptions
) -> tuple[list[Track], tuple[str, ...]]:
    """Read TrajNet++: rows {"track": {"f": frame, "p": id, "x": m, "y": m}}, and scenes with a rate."""
    rows, rates, predicted = list[Row](), set[float](), 0
    for line, part in enumerate(text.splitlines(), start=1):
        if not part.strip():
            continue
        try:
            entry = json.loads(part)
        except json.JSONDecodeError as error:
            message = f"not JSON ({error.msg}); expected an object 'track' or 'scene' in each line"
            source.repair_or_raise("rows", line, message)
            continue
        if isinstance(entry, dict) and isinstance(entry.get("scene"), dict):
            fps = entry["scene"].get("fps")
            rates |= {float(fps)} if isinstance(fps, int | float) and fps > 0 else set()
        elif isinstance(entry, dict) and isinstance(entry.get("track"), dict):
            track = entry["track"]
            if track.get("prediction_number") is not None:
                predicted += 1
                continue
            try:
                rows.append((line, float(track["f"]), str(track["p"]), float(track["x"]), float(track["y"])))
            except (KeyError, TypeError, ValueError):
                message = "expected a track with numbers f, x and y, and p, its id"
                source.repair_or_raise("rows", line, message)
        else:
            message = "a JSON file of TrajNet++ has an object 'track' or 'scene' in each line"
            source.repair_or_raise("rows", line, message)
    step = _measure_step(rows)
    per_second = max(rates) * step if len(rates) == 1 and step else None
    notes = [f"left out {predicted} rows: predictions"] if predicted else []
    if per_second is None and options.measures.per_second is None:
        example = f"--fps {step / 0.4:g} if {step:g} frames are 0.4 s" if step else "--fps 25"
        found = f"scenes state {len(rates)} rates" if rates else "no scene states a rate"
        raise source.error_at(1, "", f"TrajNet++: times are frame numbers, and {found}; expected {example}")
    if per_second is not None and options.measures.per_second is None:
        notes.append(
            f"TrajNet++: times are frame numbers, read as {per_second:g} frames per second: the scenes state"
            f" {max(rates):g} rows per second, which are {step:g} frames apart"
        )
    return _assemble(path, rows, source, options, Measures(1.0, per_second)), tuple(notes)


def _measure_step(rows: list[Row]) -> float | None:
    """Return the usual number of frames between two rows of an id."""
    frames: dict[str, list[float]] = {}
    for _, frame, name, _, _ in rows[:20_000]:
        frames.setdefault(name, []).append(frame)
    steps = np.concatenate([np.zeros(0), *(np.diff(sorted(set(own))) for own in frames.values())])
    return float(np.median(steps)) if len(steps) else None


def _read_jrdb(
    path: Path, whole: Mapping[str, Any], source: JsonFile, options: ReadOptions
) -> tuple[list[Track], tuple[str, ...]]:
    """Read the 3D labels of JRDB: frame file -> boxes, with centre in metres in the frame of the robot."""
    labels = whole.get("labels")
    if (
        not isinstance(labels, dict)
        or not labels
        or not all(isinstance(boxes, list) for boxes in labels.values())
    ):
        raise _refuse(path, whole)
    rows, others = list[Row](), 0
    for name, boxes in sorted(labels.items()):
        number = re.fullmatch(r"(\d+)\.\w+", name)
        for box in boxes:
            place = box.get("box") if isinstance(box, dict) else None
            label = str(box.get("label_id", "")) if isinstance(box, dict) else ""
            if isinstance(place, list):
                raise source.error_at(
                    1,
                    "",
                    "JRDB's 2D labels, boxes in pixels of a panorama; expected its 3D labels (labels_3d)",
                )
            if number is None or not isinstance(place, dict) or not {"cx", "cy"} <= set(place):
                raise _refuse(path, whole)
            if not label.startswith("pedestrian:"):
                others += 1
                continue
            try:
                rows.append((1, float(number[1]), label, float(place["cx"]), float(place["cy"])))
            except (TypeError, ValueError):
                message = f"{name}, {label}: the centre is {place['cx']!r}, {place['cy']!r}; expected numbers"
                source.repair_or_raise("rows", 1, message)
    notes = ["JRDB: positions are relative to the robot, which may move"]
    if others:
        notes.append(f"left out {others} rows: not of pedestrians")
    if options.measures.per_second is None:
        notes.append(
            f"JRDB: times are frame numbers, read as {JRDB_FPS:g} frames per second; --fps gives another rate"
        )
    return _assemble(path, rows, source, options, Measures(1.0, JRDB_FPS)), tuple(notes)


def _assemble(
    path: Path, rows: list[Row], source: JsonFile, options: ReadOptions, measures: Measures
) -> list[Track]:
    def batches() -> Iterator[RowBatch]:
        if not rows:
            return
        lines, frames, names, x, y = zip(*rows, strict=True)
        numbers = {name: np.array(values) for name, values in (("time", frames), ("x", x), ("y", y))}
        yield RowBatch(np.array(lines, dtype=np.int64), numbers, {"track": list(names)})

    empty = ParseError(str(path), 1, 1, "a JSON file without tracks")
    return assemble_tracks(source, batches(), options, empty, ("x", "y"), measures=measures)
