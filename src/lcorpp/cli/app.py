"""The `lcorpp` command with its subcommands."""

from __future__ import annotations

import logging
from typing import Annotated

import typer

from lcorpp.cli import ask, check, figures, fit, learn, new, run, show, simulate, solve, sweep
from lcorpp.cli.data.commands import app as data_app
from lcorpp.cli.explanation import explain
from lcorpp.cli.logs import audit, replay, watch
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.page import export, play
from lcorpp.cli.robot import robot, track
from lcorpp.cli.speech import listen, observe
from lcorpp.log_output import show_log

app = typer.Typer(
    name="lcorpp",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
app.command()(take_consent(run.run))
app.command()(figures.figures)
app.command()(take_consent(explain.explain))
app.command()(ask.ask)
app.command()(fit.fit)
app.command()(ask.translate)
app.command()(solve.solve)
app.command()(simulate.simulate)
app.command()(take_consent(show.show))
app.command()(take_consent(learn.learn))
app.command()(take_consent(play.play))
app.command()(take_consent(export.export))
app.command()(take_consent(robot.robot))
app.command()(track.track)
app.command()(take_consent(listen.listen))
app.command()(take_consent(observe.observe))
app.command()(new.new)
app.command()(take_consent(sweep.sweep))
app.command()(take_consent(replay.replay))
app.command()(take_consent(audit.audit))
app.command()(take_consent(watch.watch))
app.command()(take_consent(check.check))
app.add_typer(data_app)


def _print_version(requested: bool) -> None:
    if requested:
        from lcorpp import __version__

        typer.echo(f"lcorpp {__version__}")
        raise typer.Exit


@app.callback()
def lcorpp(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
    verbose: Annotated[
        int,
        typer.Option(
            "--verbose",
            "-v",
            count=True,
            show_default=False,
            help="Before the command: show each decision on standard error; twice (-vv): each step.",
        ),
    ] = 0,
) -> None:
    """Learn, reason and plan: decisions of a robot under uncertainty (LCORPP, AAAI 2020)."""
    if verbose:
        show_log(logging.INFO if verbose == 1 else logging.DEBUG)
