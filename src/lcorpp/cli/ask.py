"""`lcorpp ask`: a query to a P-log program."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import show
from lcorpp.errors import ProgramError


def ask(
    file: Annotated[Path, typer.Argument(metavar="FILE.plog", help="The program.")],
    query: Annotated[
        str | None,
        typer.Argument(
            metavar="QUERY",
            help="E.g. 'intention', 'intention=interested | obs(time=morning), do(location=library)';"
            " the program's own queries by default.",
        ),
    ] = None,
    exact: Annotated[bool, typer.Option("--exact", help="Print fractions.")] = False,
) -> None:
    """Ask a P-log program for a probability, or for the distribution of an attribute."""
    from lcorpp import reasoning

    program = reasoning.read_plog(file)
    queries = [reasoning.parse_query(query, program)] if query is not None else list(program.queries)
    if not queries:
        raise ProgramError(
            f"{file}: the program has no query of its own; give one, such as 'attribute=value'"
        )
    for each in queries:
        answer = reasoning.ask(program, each)
        show.console.print(str(each), style="bold")
        if isinstance(answer, Fraction):
            show.console.print(f"  {_number(answer, exact)}")
            continue
        width = max(map(len, answer))
        for value, probability in answer.items():
            show.console.print(
                f"  {value:<{width}}  {_number(probability, exact)}  ", show.bar(float(probability))
            )


def _number(probability: Fraction, exact: bool) -> str:
    return str(probability) if exact else f"{float(probability):.6f}"
