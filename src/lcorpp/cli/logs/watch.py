"""`lcorpp watch`: alarms about knowledge, classifiers and hearing, from a log of decisions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.logs import common
from lcorpp.cli.options.code import take_consent
from lcorpp.errors import DataError

POLL_SECONDS = 1.0
"""With --follow, the end of the log is read again after this time."""


@take_consent
def watch(
    log: common.LogArgument,
    domain: common.LoggedDomainOption = None,
    strategy: common.LoggedStrategyOption = None,
    given: Annotated[
        bool,
        typer.Option(
            "--given",
            help="The facts are given, e.g. by the robot's schedule: do not test how often each occurs.",
        ),
    ] = False,
    rate: Annotated[
        float, typer.Option(metavar="P", help="Maximum probability of a false alarm over all time.")
    ] = 0.05,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the evidence against what is stated.")
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Wait for further decisions at the end of the log, until Ctrl-C.")
    ] = False,
) -> None:
    """Raise an alarm if a log is not as knowledge and rates state.

    Tests after each person whether answers, labels and facts of the log agree with the program, the rates of
    the classifiers and the observation model. An alarm names what is probably wrong. A log of several
    strategies needs --strategy, as their decisions may be about the same people. Exit code 0: no alarm; 1: an
    alarm; 2: lines that cannot be read.
    """
    from functools import partial
    from time import sleep

    from lcorpp.cli.output_files import check_figure
    from lcorpp.logs.watching import LogWatch, describe_finding

    if plot is not None:
        check_figure(plot)
    watching = LogWatch(
        log, folder=domain, strategy=strategy, given=given, rate=rate, keep_log_e=plot is not None
    )
    damaged, alarms = list[DataError](), 0
    try:
        for result in watching.read(partial(sleep, POLL_SECONDS) if follow else None):
            if isinstance(result, tuple):
                line, finding = result
                assert watching.domain is not None
                alarms += 1
                words = describe_finding(finding, watching.domain)
                console.out.print(f"line {line}, person {finding.person}: {words}")
            elif not isinstance(result, DataError):
                console.out.print(f"changed since the log: {result.what}", style="yellow")
            elif follow:
                console.err.print(str(result))
            else:
                damaged.append(result)
    except KeyboardInterrupt:
        if not follow:
            raise
    if not (watching.n_decisions or damaged or follow):
        raise DataError(common.describe_empty(log))
    if watching.n_decisions or not damaged:
        of = f" of {watching.strategy}" if watching.strategy else ""
        console.out.print(f"{watching.n_decisions} decisions{of}, {alarms or 'no'} alarm{'s' * (alarms > 1)}")
    if plot is not None and watching.log_e:
        from lcorpp.logs.watching_figure import plot_alarm
        from lcorpp.plot_style import save_figure

        save_figure(plot_alarm(watching.log_e, rate), plot)
    if damaged:
        raise DataError(common.summarise_damage(damaged, log))
    if alarms:
        raise typer.Exit(1)
