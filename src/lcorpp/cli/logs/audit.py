"""`lcorpp audit`: what the people of a log suggest for each stated number."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.console import print_text
from lcorpp.cli.logs import common
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.common import SeedOption
from lcorpp.errors import FileError


@take_consent
def audit(
    log: common.LogArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.plog", help="Write the suggested rules to this file."),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option("--figure", metavar="FILE", help="Draw the numbers; .png, .svg or .pdf."),
    ] = None,
    domain: common.LoggedDomainOption = None,
    strategy: common.LoggedStrategyOption = None,
    given: Annotated[
        bool,
        typer.Option(
            "--given",
            help="The facts are given, e.g. by the robot's schedule: how often each occurs is not used.",
        ),
    ] = False,
    simulate: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="Compare the gains of attributes with those in N logs, 99 or more, that are simulated under"
            " the knowledge, and correct intervals by N logs under the changed one; takes up to 2 N times as"
            " long.",
        ),
    ] = 0,
    seed: SeedOption = 0,
) -> None:
    """Compare what is stated with the people of a log.

    For each number of the knowledge, each rate of a classifier and each answer of the observation model:
    what is stated, what the people suggest with a 95 % interval, and how strongly they disagree. Then the
    fewest numbers that have to change. Nothing is changed: -o writes the rules to apply by hand.

    Without --strategy, the people are those of the strategy with most decisions, or the last of these.
    """
    from lcorpp.audit.audit import audit_people
    from lcorpp.audit.logged_people import read_people
    from lcorpp.audit.report import format_audit, format_patch
    from lcorpp.cli.output_files import check_figure, check_writable
    from lcorpp.files import write_atomically

    if output is not None:
        check_writable(output)
        if output.suffix.lower() != ".plog":
            raise FileError(f"{output}: expected a file name that ends with .plog")
    if figure is not None:
        check_figure(figure)
    people = read_people(log, folder=domain, strategy=strategy)
    with console.show_progress("simulating logs" if simulate else "fitting numbers") as advance:
        callback = {"simulated" if simulate else "progress": advance}
        result = audit_people(people, given=given, simulations=simulate, seed=seed, **callback)
    print_text(format_audit(result))
    if output is not None:
        write_atomically(output, format_patch(result))
    if figure is not None:
        from lcorpp.audit.figure import plot_audit
        from lcorpp.plot_style import save_figure

        save_figure(plot_audit(result), figure)
    written = [str(path) for path in (output, figure) if path is not None]
    if written:
        print_text("wrote " + ", ".join(written))
