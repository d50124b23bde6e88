"""`lcorpp translate`: print a program of ProbLog or of any dialect of P-log as plain P-log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def translate(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A program of ProbLog, plog 1.0 or plog 2.0.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.plog", help="Write to this file.")
    ] = None,
) -> None:
    """Print a program as plain P-log: declarations, then one statement per line; comments are lost.

    The other commands read the same programs directly.
    """
    from lcorpp.files import write_atomically
    from lcorpp.reasoning import program_text, read_plog

    text = program_text(read_plog(file))
    if output is None:
        typer.echo(text, nl=False)
    else:
        write_atomically(output, text)
