"""Arguments and options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

MAX_TRIALS = 10_000_000
"""Maximum of --trials: the results of all trials are kept in memory."""

MAX_STEPS = 1_000_000
"""Maximum length of a simulated episode."""

MAX_TRACKS = 1_000_000
"""Maximum of --tracks, --batch-size and other numbers of people."""


class Evidence(StrEnum):
    """The classifier's evidence for the reasoner: a label, as in the paper, or a likelihood of each class."""

    hard = "hard"
    soft = "soft"


class Smoothing(StrEnum):
    """The pseudo-count of a confusion matrix that becomes rules."""

    jeffreys = "jeffreys"
    laplace = "laplace"


class Format(StrEnum):
    """A format of figures."""

    png = "png"
    svg = "svg"
    pdf = "pdf"


DomainArgument = Annotated[
    str, typer.Argument(metavar="DOMAIN", help="A domain folder, or the name of a shipped domain.")
]
PresetOption = Annotated[str | None, typer.Option(help="A preset of the domain; the first one by default.")]
SeedOption = Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of all random numbers.")]
JobsOption = Annotated[
    int | None, typer.Option(min=1, help="Processes; all cores by default. The results are the same.")
]
EpochsOption = Annotated[
    int | None, typer.Option(min=1, help="Training epochs; by default a number that suits the data.")
]
LearnerOption = Annotated[
    str | None,
    typer.Option(
        help="The learner: lstm, lstm-fast, summaries, forest, minirocket, or your own as MODULE:FUNCTION"
        " or FILE.py:FUNCTION. By default the domain's."
    ),
]
DeviceOption = Annotated[
    str, typer.Option(help="The device of the LSTM: cpu or cuda; other learners use the cpu.")
]
FeaturesOption = Annotated[
    str,
    typer.Option(
        help="The classifier's features of the motion, separated by commas: x, y, velocity, heading, facing"
        " and more, see docs/learning.md."
    ),
]
EvidenceOption = Annotated[
    Evidence, typer.Option(help="The reasoner's evidence: the label (hard) or a likelihood (soft).")
]
SmoothingOption = Annotated[
    Smoothing,
    typer.Option(
        help="Pseudo-count added to the confusion matrix, so that no rule has probability 0: 1/2 (jeffreys)"
        " or 1 (laplace)."
    ),
]
TracksOption = Annotated[
    int | None,
    typer.Option(min=20, max=MAX_TRACKS, help="Simulated training tracks; by default the domain's number."),
]
DataOption = Annotated[
    Path | None, typer.Option(help="Recorded tracks for training: a folder or a file, see docs/learning.md.")
]


def _parse_folder(text: str) -> Path:
    """Return the path of a folder; an empty text is none, although `Path("")` is the current folder."""
    if not text:
        raise typer.BadParameter("expected the name of a folder; the current one is '.'")
    return Path(text)


OutOption = Annotated[
    Path | None, typer.Option(metavar="FOLDER", parser=_parse_folder, help="Folder for the results.")
]
FormatOption = Annotated[
    list[Format] | None,
    typer.Option("--format", help="Format of the figures in --out; repeatable. By default png and pdf."),
]
