"""Options of commands that read recorded data."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from lcorpp.errors import DataError

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
