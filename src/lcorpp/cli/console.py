"""What commands share: the console, progress bars, bars for probabilities, common options."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Protocol

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

    console: Console
    messages: Console


def __getattr__(name: str) -> Console:
    """`console` and `messages`, made when first used: loading rich takes longer than some commands."""
    from rich.console import Console

    if name == "console":
        made = Console(highlight=False, soft_wrap=True)
    elif name == "messages":
        made = Console(stderr=True, highlight=False)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = made
    return made


class Evidence(StrEnum):
    """What a classifier tells the reasoner: a label, as in the paper, or a likelihood of each class."""

    hard = "hard"
    soft = "soft"


class Smoothing(StrEnum):
    """What is added to the counts of a confusion matrix before they become rules."""

    jeffreys = "jeffreys"
    laplace = "laplace"


DomainArgument = Annotated[
    str, typer.Argument(metavar="DOMAIN", help="A domain folder, or the name of a shipped domain.")
]
PresetOption = Annotated[
    str | None, typer.Option("--preset", help="A preset of the domain; its first one by default.")
]
SeedOption = Annotated[
    int, typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of everything that is drawn.")
]
JobsOption = Annotated[
    int | None,
    typer.Option("--jobs", min=1, help="Processes; all cores by default. Results do not depend on it."),
]
EpochsOption = Annotated[
    int | None,
    typer.Option("--epochs", min=1, help="Passes over the data; what suits them by default."),
]
LearnerOption = Annotated[
    str | None,
    typer.Option(
        "--learner",
        help="What learns to classify: lstm, lstm-fast, summaries, forest, minirocket, or one of your own as"
        " MODULE:FUNCTION or FILE.py:FUNCTION.",
    ),
]
DeviceOption = Annotated[
    str, typer.Option("--device", help="Where the LSTM computes: cpu or cuda; all others use the cpu.")
]
ChannelsOption = Annotated[
    str,
    typer.Option(
        "--channels",
        help="What the classifier sees of the motion, with commas: x, y, velocity, heading, facing and"
        " more, see docs/learning.md.",
    ),
]
EvidenceOption = Annotated[
    Evidence,
    typer.Option(
        "--evidence",
        help="What the reasoner is told of the classifier: its label (hard) or a likelihood (soft).",
    ),
]
SmoothingOption = Annotated[
    Smoothing,
    typer.Option(
        "--smoothing",
        help="Added to each count of the confusion matrix, so that no rule says never: 1/2 (jeffreys) or 1.",
    ),
]
TracksOption = Annotated[
    int | None,
    typer.Option("--tracks", min=20, help="Simulated tracks to train on; what the domain says by default."),
]
DataOption = Annotated[
    Path | None,
    typer.Option("--data", help="Recorded tracks to learn from: a folder or a file, see docs/learning.md."),
]
OutOption = Annotated[Path | None, typer.Option("--out", help="Folder for the results.")]


PATIENCE = 0.3
"""Seconds before a late progress bar is drawn: what is over sooner need not load what draws it."""


def cores(jobs: int | None) -> int:
    """How many processes to use."""
    return jobs or os.cpu_count() or 1


class Advance(Protocol):
    """Says how much of a task is done; what is left out stays as it was."""

    def __call__(self, done: int, total: int | None = None, title: str | None = None) -> None: ...


def _made(name: str) -> Console:
    found: Console = globals().get(name) or __getattr__(name)
    return found


@contextmanager
def progress(title: str, total: int | None = None) -> Iterator[Advance]:
    """A progress bar on standard error while something longer than a second goes on."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=_made("messages"), transient=True) as bars:
        task = bars.add_task(title, total=total)

        def advance(done: int, total: int | None = None, title: str | None = None) -> None:
            bars.update(task, completed=done, total=total, description=title)

        yield advance


@contextmanager
def late_progress(title: str) -> Iterator[Callable[[float, str], None]]:
    """A bar for the share of the work that is done, with words beside it, once it has taken a while.

    Nothing is drawn where nobody looks: when standard error is not a terminal.
    """
    began = monotonic()
    watched = sys.stderr is not None and sys.stderr.isatty()
    with ExitStack() as opened:
        update: Callable[[float, str], None] | None = None

        def advance(share: float, words: str) -> None:
            nonlocal update
            if update is None and watched and monotonic() - began > PATIENCE:
                update = opened.enter_context(_bar_with_words(title))
            if update is not None:
                update(share, words)

        yield advance


@contextmanager
def _bar_with_words(title: str) -> Iterator[Callable[[float, str], None]]:
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[words]}"))
    with Progress(*columns, TimeElapsedColumn(), console=_made("messages"), transient=True) as bars:
        task = bars.add_task(title, total=1.0, words="")
        yield lambda share, words: bars.update(task, completed=share, words=words)


def bar(share: float, width: int = 30) -> Text:
    """A probability as a bar."""
    eighths = round(share * width * 8)
    blocks = "█" * (eighths // 8) + (" ▏▎▍▌▋▊▉"[eighths % 8] if eighths % 8 else "")
    from rich.text import Text

    return Text(blocks, style="cyan")


def heading(number: int, title: str, aside: str = "") -> None:
    """A numbered heading."""
    from rich.text import Text

    console = _made("console")
    console.print()
    console.print(Text.assemble((f"{number}  {title}", "bold"), (f"   {aside}" if aside else "", "dim")))


def line(name: str, share: float, width: int) -> None:
    """One named probability with its bar."""
    from rich.text import Text

    _made("console").print(Text.assemble(f"     {name:<{width}}  {share:8.6f}  ", bar(share)))
