"""The `lcorpp` command."""

from __future__ import annotations

import sys

import typer

from lcorpp.cli import ask, check, data, explain, learn, run, show as show_model, simulate, solve
from lcorpp.errors import LcorppError

app = typer.Typer(
    name="lcorpp",
    help="Learn what can be learnt, reason with what people know, plan what to ask, then decide (LCORPP).",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command()(run.run)
app.command()(explain.explain)
app.command()(ask.ask)
app.command()(solve.solve)
app.command()(simulate.simulate)
app.command("show")(show_model.show_model)
app.command()(learn.learn)
app.command()(check.check)
app.add_typer(data.app)


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
    except KeyboardInterrupt:
        print("lcorpp: interrupted", file=sys.stderr)
        sys.exit(130)
