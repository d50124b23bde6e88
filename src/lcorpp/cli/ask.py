"""`lcorpp ask` and `lcorpp translate`: answer a query with a P-log program, and print it."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli.console import print_text
from lcorpp.cli.options import common as options


class Form(StrEnum):
    """A form of programs."""

    plog = "plog"
    csv = "csv"
    toml = "toml"


def ask(
    file: Annotated[Path, typer.Argument(metavar="FILE.plog", help="The program.")],
    query: Annotated[
        str | None,
        typer.Argument(
            metavar="QUERY",
            help="E.g. 'intention', 'intention=interested | obs(time=morning), do(location=library)', several"
            " attributes 'identity, intention', '{a=1 or b=2}', an expectation 'E[a+b]'; the program's own"
            " queries by default.",
        ),
    ] = None,
    exact: Annotated[bool, typer.Option("--exact", help="Print fractions.")] = False,
    lenient: Annotated[
        bool,
        typer.Option(
            "--lenient",
            help="Leave out statements with constants outside of their sorts, as other systems do.",
        ),
    ] = False,
    why: Annotated[
        bool,
        typer.Option(
            "--why", help="Also: the answer without each condition, the most probable worlds, their rules."
        ),
    ] = False,
    best: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Only the N most probable values, best first."),
    ] = None,
    worlds: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="Also the N most probable worlds that satisfy the conditions; 3 with --why.",
        ),
    ] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON for each query.")] = False,
    samples: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Worlds drawn if the program is too large for an exact answer, 20000 by default; more if few"
            " of them have the evidence.",
        ),
    ] = None,
    seed: options.SeedOption = 0,
    evidence: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Evidence for a Markov logic network (.db, a literal a line) or for answer sets (rules).",
        ),
    ] = None,
) -> None:
    """Answer a query to a program."""
    from lcorpp.cli.answers import print_answers

    print_answers(
        file, query, exact=exact, lenient=lenient, why=why, best=best, worlds=worlds, as_json=as_json,
        samples=samples, seed=seed, evidence=evidence,
    )  # fmt: skip


def translate(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A program of ProbLog, plingo, plog 1.0 or plog 2.0, a Bayesian network, or tables.",
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write to this file.")
    ] = None,
    to: Annotated[
        Form | None,
        typer.Option(help="Plain P-log, or tables in CSV or TOML; by default the end of the file's name."),
    ] = None,
) -> None:
    """Print a program as plain P-log, or as tables.

    In P-log, declarations come first, then one statement per line; comments are lost. Tables are for programs
    that are Bayesian networks, and edited in a spreadsheet. The other commands read all forms directly.
    """
    from lcorpp.cli.console import show_warnings
    from lcorpp.files import write_atomically
    from lcorpp.reasoning import program_text, read_plog, table_text

    if to is None:
        suffix = output.suffix[1:].lower() if output is not None else ""
        to = Form(suffix) if suffix in Form.__members__ else Form.plog
    with show_warnings():
        program = read_plog(file)
        text = program_text(program) if to is Form.plog else table_text(program, to.value)
    if output is None:
        print_text(text, end="")
    else:
        write_atomically(output, text)
