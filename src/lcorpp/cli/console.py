"""Console output of all commands: lines, notes, progress displays, headings and probability bars.

Control characters of foreign text appear as ``\\x1b``: `EscapedConsole` and `print_spans` escape what is
printed here, `lcorpp.terminal.escape_output` everything else.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from time import monotonic
from typing import TYPE_CHECKING, Any

from lcorpp.terminal import escape_controls, find_unescaped

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    out: Console
    err: Console

BOLD, CYAN = 1, 36
"""Codes of the terminal, for `print_spans`."""


def __getattr__(name: str) -> Console:
    """Create `out` and `err` at their first use: rich takes longer to load than some commands to run."""
    if name not in ("out", "err"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from lcorpp.cli.escaped_console import EscapedConsole

    # texts of users are printed as they are: "[/x]" is not markup, ":x:" no emoji
    created = EscapedConsole(stderr=name == "err", highlight=False, markup=False, emoji=False)
    if not created.is_terminal:
        created.soft_wrap = True  # files and pipes get whole lines, terminals lines that break between words
    globals()[name] = created
    return created


MIN_STEP_SECONDS = 0.3
"""A delayed progress bar appears only if its step takes longer; short steps then need not load rich."""


def count_processes(jobs: int | None) -> int:
    """Return the number of processes: `jobs`, or one for each core."""
    return jobs or os.cpu_count() or 1


def print_note(text: str, *, err: bool = False) -> None:
    """Print a note, on standard error if `err`."""
    _console("err" if err else "out").print(f"note: {text}", style="yellow")


def warn(text: str) -> None:
    """Print a warning on standard error."""
    _console("err").print(f"warning: {text}", style="yellow")


def print_spans(*spans: str | tuple[str, int]) -> None:
    """Print a line of texts, or pairs of a text and its code on a terminal; rich takes longer to load.

    With the environment variable NO_COLOR there are no colours, as rich has it (no-color.org).
    """
    stream = sys.stdout
    if stream is None:  # it is closed
        return
    is_terminal, has_colours = stream.isatty(), not os.environ.get("NO_COLOR")
    line = ""
    for span in spans:
        text, code = (span, 0) if isinstance(span, str) else span
        visible = escape_controls(text)
        is_styled = code and is_terminal and (code == BOLD or has_colours)
        line += f"\033[{code}m{visible}\033[0m" if is_styled else visible
    print(line, file=find_unescaped(stream), flush=True)


def print_text(text: object, *, end: str = "\n", err: bool = False) -> None:
    """Print a text, on standard error if `err`; rich takes longer to load."""
    print(escape_controls(str(text)), end=end, file=sys.stderr if err else sys.stdout, flush=True)


def print_json(record: object) -> None:
    """Print a line of JSON in ASCII, without control characters."""
    from json import dumps

    print_spans(dumps(record).replace("\x7f", r"\u007f"))


def ask(question: str) -> str:
    """Show a question and return the typed line; `input` writes to the terminal itself."""
    return input(escape_controls(question))


@contextmanager
def show_warnings() -> Iterator[None]:
    """Print each warning of the library once on standard error, when it is issued: e.g. before sampling."""
    shown: set[str] = set()

    def show(message: Warning | str, *_: object) -> None:
        if str(message) not in shown:
            shown.add(str(message))
            print(f"lcorpp: {message}", file=sys.stderr, flush=True)

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = show  # type: ignore[assignment]  # called with the same arguments
        yield


@contextmanager
def show_progress(
    title: str,
    total: int | None = None,
    /,
    *,
    kept: str = "nothing is kept",
    left: Callable[[], str] = lambda: "",
) -> Iterator[Callable[[int, int | None], None]]:
    """Display a step on standard error: a spinner, and a bar with counts if the total is known.

    Yields a function of the completed and the total number of parts.

    Args:
        title: the step, e.g. "solving the POMDP".
        kept: the results that an interrupt leaves, for the message.
        left: returns a text after the counts, e.g. the remaining time.

    Raises:
        KeyboardInterrupt: an interrupt; the message names the step and `kept`.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    err = _console("err")
    columns = (
        SpinnerColumn("line" if err.options.ascii_only else "dots"),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[count]}", markup=False),
        TimeElapsedColumn(),
    )
    display = Progress(*columns, **_DISPLAY, console=err, disable=not err.is_terminal)
    with _print_above(display), display:
        task = display.add_task(escape_controls(title), total=total, count="")

        def advance(done: int, total: int | None = None) -> None:
            count = "" if total is None else f"{done}/{total}{left()}"
            display.update(task, completed=done, total=total, count=count)

        advance(0, total)
        try:
            yield advance
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted while {title}; {kept}") from None


@contextmanager
def show_delayed_progress(title: str) -> Iterator[Callable[[float, str], None]]:
    """Display the completed share of a step and a text, once the step has taken `MIN_STEP_SECONDS`.

    Yields a function of the share, from 0 to 1, and the text. Nothing is displayed if standard error is not a
    terminal.
    """
    start = monotonic()
    visible = sys.stderr is not None and sys.stderr.isatty()
    with ExitStack() as stack:
        display: Progress | None = None

        def advance(share: float, text: str) -> None:
            nonlocal display
            if display is None and visible and monotonic() - start > MIN_STEP_SECONDS:
                from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

                title_column, text_column = (
                    TextColumn(f"{{task.{field}}}", markup=False) for field in ("description", "fields[text]")
                )
                columns = (title_column, BarColumn(), text_column, TimeElapsedColumn())
                display = Progress(*columns, **_DISPLAY, console=_console("err"))
                stack.enter_context(_print_above(display))
                stack.enter_context(display).add_task(escape_controls(title), total=1.0, text="")
            if display is not None:
                display.update(display.task_ids[0], completed=share, text=escape_controls(text))

        yield advance


def print_heading(number: int, title: str, subtitle: str) -> None:
    """Print a numbered heading."""
    from rich.text import Text

    out = _console("out")
    out.print()
    out.print(Text.assemble((f"{number}  {title}", "bold"), (f"   {subtitle}", "dim")))


def print_probability(name: str, probability: float, width: int) -> None:
    """Print a name, padded to `width` characters, its probability and a bar."""
    from rich.text import Text

    bar = (format_bar(probability), "cyan")
    _console("out").print(Text.assemble(f"     {name:<{width}}  {probability:8.6f}  ", bar))


def format_time(seconds: float) -> str:
    """Return minutes and seconds, 2:05."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02}"


def format_bar(share: float, width: int = 30) -> str:
    """Return a bar of at most `width` characters, in steps of an eighth of a character.

    It is of ASCII if standard output is.
    """
    if not (getattr(sys.stdout, "encoding", None) or "utf-8").lower().startswith("utf"):
        return "#" * round(share * width)
    eighths = round(share * width * 8)
    return "█" * (eighths // 8) + (" ▏▎▍▌▋▊▉"[eighths % 8] if eighths % 8 else "")


_DISPLAY: dict[str, Any] = {"transient": True, "redirect_stdout": False, "redirect_stderr": False}
"""Options of displays; `_print_above` redirects."""


@contextmanager
def _print_above(display: Progress) -> Iterator[None]:
    """Print above a display what is written to a terminal meanwhile, e.g. the log."""
    from lcorpp.cli.escaped_console import EscapedProxy

    before = sys.stdout, sys.stderr
    if display.disable:
        yield
        return
    sys.stdout, sys.stderr = (
        EscapedProxy(display.console, stream) if stream is not None and stream.isatty() else stream
        for stream in before
    )
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()  # the rest of a line
        sys.stdout, sys.stderr = before


def _console(name: str) -> Console:
    """Return `out` or `err`; within this module, `__getattr__` is not called for its own globals."""
    created: Console = globals().get(name) or __getattr__(name)
    return created
