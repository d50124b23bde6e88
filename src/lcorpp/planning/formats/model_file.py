"""Models of any format, by the suffix of their file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lcorpp.errors import ModelError
from lcorpp.planning.formats.memory import report_full_memory
from lcorpp.planning.formats.pomdp.reader import read_pomdp
from lcorpp.planning.pomdp import Pomdp

if TYPE_CHECKING:
    from lcorpp.planning.factored.model import Factored


def read_model(path: Path) -> tuple[Pomdp, Factored | None]:
    """Read a model, and its variables if the file has them (.pomdpx).

    Raises:
        FileError, ParseError: the file cannot be read, or is malformed.
        ModelError: the flat problem would be too large.
    """
    if path.suffix.lower() != ".pomdpx":
        return read_pomdp(path), None
    from lcorpp.planning.factored.flatten import flatten
    from lcorpp.planning.formats.pomdpx.reader import read_factored  # imports the XML parser

    problem = read_factored(path)
    try:
        with report_full_memory(path):
            return flatten(problem), problem
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None
