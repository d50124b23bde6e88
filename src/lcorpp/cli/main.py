"""Entry point of the `lcorpp` command; it loads the commands inside of its handler of interrupts."""

from __future__ import annotations

import sys

from lcorpp.errors import LcorppError


def main() -> None:
    """Run a command; bad input ends in one message on standard error and exit code 2."""
    try:
        from lcorpp.cli.app import app

        app(prog_name="lcorpp")
    except LcorppError as error:
        print(f"lcorpp: {error}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:  # the output cannot be written: a full disk, a closed pipe
        print(f"lcorpp: {error.strerror or error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:  # while the commands are loaded; typer turns later ones into an exit
        print("lcorpp: interrupted", file=sys.stderr)
        sys.exit(130)
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
