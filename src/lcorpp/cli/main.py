"""The `lcorpp` command."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from lcorpp.cli import ask, check, data, explain, learn, run, show, simulate, solve
from lcorpp.errors import LcorppError

app = typer.Typer(
    name="lcorpp",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
app.command()(run.run)
app.command()(explain.explain)
app.command()(ask.ask)
app.command()(solve.solve)
app.command()(simulate.simulate)
app.command()(show.show)
app.command()(learn.learn)
app.command()(check.check)
app.add_typer(data.app)


def _print_version(requested: bool) -> None:
    if requested:
        from lcorpp import __version__

        typer.echo(f"lcorpp {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    """Learn, reason and plan: decisions of a robot under uncertainty (LCORPP, AAAI 2020)."""


def main() -> None:
    """Run a command; bad input ends in one message on standard error and exit code 2."""
    try:
        app(standalone_mode=True)
    except LcorppError as error:
        print(f"lcorpp: {error}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:  # the output cannot be written: a full disk, a closed pipe
        print(f"lcorpp: {error.strerror or error}", file=sys.stderr)
        sys.exit(2)
    except SystemExit as ended:
        interrupt = _find_interrupt(ended)
        if interrupt is not None:
            print(f"lcorpp: {interrupt or 'interrupted'}", file=sys.stderr)
        raise


def _find_interrupt(ended: SystemExit) -> str | None:
    """Return the message of the Ctrl-C that typer turned into an exit; None if there was none."""
    error: BaseException | None = ended
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return str(error)
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return None
