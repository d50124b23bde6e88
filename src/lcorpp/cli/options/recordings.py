"""Options of commands that read recorded data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.errors import DataError

if TYPE_CHECKING:
    from lcorpp.assembly.options import ReadingOptions

LabelOption = Annotated[
    list[str] | None, typer.Option(metavar="WORD=CLASS", help="The class of a written label; repeatable.")
]
LabelFileOption = Annotated[
    Path | None, typer.Option(help="CSV of track ids and labels; other tracks are skipped.")
]
RepairOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="A kind of fault to repair instead of rejecting it: rows, cut, nonfinite, order, duplicates,"
        " gaps, short, constant, units, labels or all; repeatable.",
    ),
]
RobotOption = Annotated[
    tuple[float, float, float] | None,
    typer.Option(metavar="X Y ANGLE", help="The robot's pose, in metres and radians."),
]
GapOption = Annotated[
    float | None,
    typer.Option(help="Seconds without samples after which a track id is a new person; 5 by default."),
]
ColumnOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="COLUMN=NAME",
        help="The name in the file, or without a heading the number, of a column: track, time, x, y, z,"
        " velocity, heading, facing, tilt, gaze_angle, robot_angle, face_distance, label or group;"
        " repeatable, e.g. --column time=stamp.",
    ),
]
UnitOption = Annotated[
    str | None,
    typer.Option(
        metavar="UNIT", help="The unit of length: m, cm, mm, km, ft, in, or metres per unit (pixel)."
    ),
]
TimeUnitOption = Annotated[
    str | None, typer.Option(metavar="UNIT", help="The unit of time: s, ms, us, ns, or seconds per unit.")
]
FpsOption = Annotated[
    float | None, typer.Option(help="Frames per second, if times are frame numbers; instead of --time-unit.")
]

RECORDING_OPTIONS = "--label-file, --repair, --robot, --gap, --column, --unit, --time-unit, --fps"


@dataclass(frozen=True)
class RecordingGroup:
    """How to read recordings; each field is an option of its name."""

    label_file: LabelFileOption = None
    repair: RepairOption = None
    robot: RobotOption = None
    gap: GapOption = None
    column: ColumnOption = None
    unit: UnitOption = None
    time_unit: TimeUnitOption = None
    fps: FpsOption = None

    @property
    def layout(self) -> dict[str, Any]:
        """The arguments of readers about columns and units."""
        return {
            "columns": parse_columns(self.column),
            "unit": self.unit,
            "time_unit": self.time_unit,
            "fps": self.fps,
        }

    def choose_reading(self, labels: Mapping[str, str]) -> ReadingOptions:
        """Return the options of an experiment for reading recordings with these labels."""
        from lcorpp.assembly.options import ReadingOptions

        repair = tuple(self.repair or ())
        return ReadingOptions(labels, self.label_file, repair, self.robot, self.gap, **self.layout)


def parse_columns(texts: Sequence[str] | None) -> dict[str, str]:
    """Return column -> name in the file of texts such as "time=stamp"."""
    columns: dict[str, str] = {}
    for text in texts or ():
        column, sign, name = text.partition("=")
        if not (sign and column and name):
            raise DataError(f"--column {text!r}: expected COLUMN=NAME, for example time=stamp")
        if columns.setdefault(column.strip().lower(), name.strip()) != name.strip():
            raise DataError(f"--column {column}: is {columns[column]!r} and {name!r}; expected one")
    return columns


def parse_written_labels(texts: Sequence[str] | None) -> dict[str, str]:
    """Return label in the file -> class of texts such as "1=interested"."""
    labels: dict[str, str] = {}
    for text in texts or ():
        word, sign, name = text.partition("=")
        if not (sign and word and name):
            raise DataError(f"--label {text!r}: expected WORD=CLASS, for example 1=interested")
        if labels.setdefault(word, name) != name:
            raise DataError(f"--label {word}: has the classes {labels[word]!r} and {name!r}; expected one")
    return labels
