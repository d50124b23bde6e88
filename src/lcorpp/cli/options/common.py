"""Arguments and options that several commands share."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.assembly.strategies.strategy_table import (
    BASELINE_TABLE,
    LIMITS_NAME,
    TABLE_NAMES,
    TRUST_NAMES,
)

if TYPE_CHECKING:
    from lcorpp.domains import Domain

MAX_TRIALS = 10_000_000
"""Maximum of --trials: the results of all trials are kept in memory."""

MAX_STEPS = 1_000_000
"""Maximum length of a simulated episode."""

MAX_TRACKS = 1_000_000
"""Maximum of --tracks, --batch-size and other numbers of people."""


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
PresetOption = Annotated[
    str | None, typer.Option(help="A preset of the domain, or several with commas; the first one by default.")
]
SeedOption = Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of all random numbers.")]
JobsOption = Annotated[
    int | None, typer.Option(min=1, help="Processes; all cores by default. The results are the same.")
]
SmoothingOption = Annotated[
    Smoothing,
    typer.Option(
        help="Pseudo-count added to the confusion matrix, so that no rule has probability 0: 1/2 (jeffreys)"
        " or 1 (laplace)."
    ),
]


def join_names(names: Sequence[str], word: str = "or") -> str:
    """Return names for help: ``a, b or c``."""
    return f"{', '.join(names[:-1])} {word} {names[-1]}"


STRATEGIES = (
    f"{join_names(TABLE_NAMES)}; with several senses LCORPP-SENSE leaves one out; {TRUST_NAMES[0]}, and"
    f" {join_names(TRUST_NAMES[1:], 'and')} without its hearing or asking; {LIMITS_NAME}; the"
    f" baselines {join_names(tuple(BASELINE_TABLE), 'and')}; or your own as FILE.py:NAME"
)
"""The strategies, for help."""

WorldOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE.py:NAME",
        help="Your own world instead of the domain's simulated answers: NAME(person, rng) returns an object"
        " with act(action) and report(action), see docs/guides/robot/worlds.md.",
    ),
]

ReasonerOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE.py:NAME",
        help="Your own reasoner instead of the domain's: NAME(program, rates) returns an object with"
        " posterior(shared, evidence), see docs/guides/reasoning/own.md.",
    ),
]


def load_domain(name: str, preset: str | None, world: str | None, reasoner: str | None) -> Domain:
    """Load a domain with its preset, and the user's world and reasoner if they are given."""
    from lcorpp.domains import load_domain as load, with_reasoner, with_world

    loaded = load(name, preset=preset)
    if world is not None:
        loaded = with_world(loaded, world)
    return loaded if reasoner is None else with_reasoner(loaded, reasoner)


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

AskBudgetOption = Annotated[
    float | None,
    typer.Option(
        min=0,
        metavar="POINTS",
        help="What LCORPP+trust may spend on questions that it asks to learn: points of reward a person, on"
        " average over the first 100; 1 by default.",
    ),
]

LogOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Append each decision as a line of JSON, for `lcorpp replay`."),
]
