"""Arguments, options and messages of the commands that read a log of decisions."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from lcorpp.errors import DataError

MAX_MESSAGES = 10
"""Maximum number of messages about damaged lines."""

LogArgument = Annotated[Path, typer.Argument(metavar="LOG", help="A log of decisions, written with --log.")]
LoggedDomainOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER", help="The domain folder, if it is no longer where it was; by default the log's."
    ),
]
LoggedStrategyOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Read only the decisions of this strategy.")
]


def summarise_damage(damaged: list[DataError], file: Path) -> str:
    """Return one message about damaged lines: those of equal faults together."""
    first: dict[str, str] = {}
    faults = Counter[str]()
    for error in damaged:
        message = str(error)
        fault = message.removeprefix(f"{file}:").partition(":")[2]
        first.setdefault(fault, message)
        faults[fault] += 1
    lines = [first[fault] + (f" ({number} lines)" if number > 1 else "") for fault, number in faults.items()]
    if len(faults) > MAX_MESSAGES:
        return "\n".join([*lines[:MAX_MESSAGES], f"... ({len(damaged)} lines in all)"])
    return "\n".join(lines)


def describe_empty(file: Path) -> str:
    """Return the message about a log without decisions."""
    return f"{file}: has no decisions; expected a log that was written with --log"
