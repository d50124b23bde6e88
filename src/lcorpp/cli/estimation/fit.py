"""`lcorpp fit`: estimate the numbers of a P-log program from records."""

from __future__ import annotations

from math import log
from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli.console import print_text
from lcorpp.cli.options import common as options
from lcorpp.errors import FileError


def fit(
    file: Annotated[Path, typer.Argument(metavar="FILE.plog", help="The program.")],
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA.csv",
            help="The records: a column for each observed term; empty cells and ? are not observed.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.plog", help="Write the fitted program to this file."),
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option("--fix", metavar="ATTRIBUTE|LINE", help="Keep these numbers; may be repeated."),
    ] = None,
    prior: Annotated[
        float,
        typer.Option("--prior", metavar="N", help="The program's numbers count as N records in each case."),
    ] = 0.0,
    starts: Annotated[
        int,
        typer.Option(min=1, help="Searches, all but the first from random numbers; the best is kept."),
    ] = 1,
    seed: options.SeedOption = 0,
) -> None:
    """Estimate the numbers of pr-atoms from records.

    Prints the program with the new numbers, comments and layout kept, and on standard error the numbers with
    their 95 % intervals. With -o, prints the numbers only.
    """
    from lcorpp.cli.console import show_delayed_progress
    from lcorpp.cli.output_files import check_writable
    from lcorpp.files import read_text, write_atomically
    from lcorpp.fitting import fit as fit_numbers, read_records
    from lcorpp.fitting.maximisation import TOLERANCE
    from lcorpp.reasoning import parse_plog, program_text, read_plog
    from lcorpp.reasoning.language.parser import MAX_PROGRAM_BYTES, parse_learnable
    from lcorpp.reasoning.language.translation.problog_learnable import has_learnable, replace_learnt

    if output is not None:
        check_writable(output)
        expected = ".pl" if file.suffix.lower() == ".pl" else ".plog"
        if output.suffix.lower() != expected:
            raise FileError(f"{output}: expected a file name that ends with {expected}")
    if file.suffix.lower() == ".mln":
        raise FileError(f"{file}: weights of Markov logic are not learnt; expected P-log or tables")
    is_network = file.suffix.lower() in (".bif", ".csv", ".toml")
    text = program_text(read_plog(file)) if is_network else read_text(file, MAX_PROGRAM_BYTES)
    fixed: list[int | str] = [int(name) if name.isdecimal() else name for name in fix or ()]
    is_learnable = not is_network and has_learnable(text)
    if is_learnable:
        program, others = parse_learnable(text, file=str(file))
        fixed += others
    else:
        program = parse_plog(text, file=str(file))
    try:
        with show_delayed_progress("fitting") as advance:
            result = fit_numbers(
                program,
                read_records(data),
                fixed=fixed,
                prior=prior,
                starts=starts,
                seed=seed,
                # steps shrink by a nearly constant factor
                progress=lambda n, change: advance(log(max(change, TOLERANCE), TOLERANCE), f"{n} steps"),
            )
    except KeyboardInterrupt:
        raise KeyboardInterrupt("interrupted while fitting; nothing is written") from None
    if is_learnable:
        fitted = replace_learnt(text, [x.statement for x in result.numbers])
    else:
        fitted = result.rewrite(text)
    if output is None:
        print_text(fitted, end="")
    else:
        write_atomically(output, fitted)
    print_text(result, err=output is None)
