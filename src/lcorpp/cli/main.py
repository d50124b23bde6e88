"""Entry point of the `lcorpp` command; it loads the commands inside of its handler of interrupts."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence

from lcorpp.errors import LcorppError
from lcorpp.files import keep_pipes
from lcorpp.interrupts import Terminated, end_on_signals
from lcorpp.terminal import escape_output


def main() -> None:
    """Run a command; bad input ends in one message on standard error and exit code 2."""
    with escape_output():
        _run_and_exit()


def _run_and_exit() -> None:
    try:
        with end_on_signals(), keep_pipes():
            _run_command(sys.argv[1:])
    except LcorppError as error:
        print(f"lcorpp: {error}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:  # the reader has ended, e.g. `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python writes the rest at its end
        sys.exit(1)
    except MemoryError:
        print("lcorpp: not enough memory", file=sys.stderr)
        sys.exit(2)
    except RecursionError:
        print("lcorpp: an input is nested too deeply", file=sys.stderr)
        sys.exit(2)
    except OSError as error:  # the output cannot be written, e.g. to a full disk
        print(f"lcorpp: {error.strerror or error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt as interrupt:  # typer turns those of its commands into an exit
        print(f"lcorpp: {str(interrupt) or 'interrupted'}", file=sys.stderr)
        sys.exit(130)
    except Terminated as ended:
        print(f"lcorpp: {ended}", file=sys.stderr)
        gc.freeze()  # the end of Python need not look for garbage
        sys.exit(ended.code)
    except SystemExit as ended:
        words = _find_interrupt(ended)
        if words is not None:
            print(f"lcorpp: {words or 'interrupted'}", file=sys.stderr)
        raise


def _run_command(arguments: Sequence[str]) -> None:
    """Run a command; `ask FILE QUERY` without options does not load typer, which takes longer."""
    if arguments[:1] == ["ask"] and len(arguments) in (2, 3) and not any(a[:1] == "-" for a in arguments):
        gc.set_threshold(50_000)  # little of what a short process allocates is garbage
        atexit.register(gc.freeze)  # modules are not garbage
        from lcorpp.cli.answers import print_answers

        print_answers(*arguments[1:])
    else:
        from lcorpp.cli.app import app

        app(prog_name="lcorpp")


def _find_interrupt(ended: SystemExit) -> str | None:
    """Return the message of the Ctrl-C that typer turned into an exit; None if there was none."""
    error: BaseException | None = ended
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return str(error)
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return None
