"""Arguments and options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from lcorpp.planning import SolverOptions

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
PresetOption = Annotated[str | None, typer.Option(help="A preset of the domain; the first one by default.")]
SeedOption = Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of all random numbers.")]
JobsOption = Annotated[
    int | None, typer.Option(min=1, help="Processes; all cores by default. The results are the same.")
]
EpochsOption = Annotated[
    int | None, typer.Option(min=1, help="Training epochs; by default a number that suits the data.")
]
DeviceOption = Annotated[
    str, typer.Option(help="The device of the LSTM: cpu or cuda; other learners use the cpu.")
]
FeaturesOption = Annotated[
    str | None,
    typer.Option(
        help="The classifier's features of the motion, separated by commas: x, y, velocity, turn_rate"
        " and more, see docs/learning.md; by default those that suit the learner."
    ),
]
SecondsOption = Annotated[
    float | None,
    typer.Option(
        min=0.001,
        max=3600,
        help="The last seconds of each track that are used; by default those of the domain, ten of recorded"
        " and all of simulated tracks.",
    ),
]
RateOption = Annotated[
    float | None,
    typer.Option(
        min=0.001, max=1000, help="Points per second at which the features are computed; 3 by default."
    ),
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

STRATEGIES = (
    "L, R, P, L+R, R+P, L+P or LCORPP; with several senses LCORPP-SENSE leaves one out;"
    " LCORPP+trust, and LCORPP+trust-hearing and LCORPP+trust-asking without its hearing or asking; the"
    " baselines ask-twice, random and always-report; or your own as FILE.py:NAME"
)
"""The strategies, for help: those of `assembly.strategies.baselines`, which takes longer to load."""

WorldOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE.py:NAME",
        help="Your own world instead of the domain's simulated answers: NAME(person, rng) returns an object"
        " with act(action) and report(action), see docs/worlds.md.",
    ),
]

SOLVERS = "sarsop, exact, perseus, qmdp or fib, or your own as FILE.py:NAME"
"""The solvers, for help: those of `lcorpp.planning.SOLVER_NAMES`, which takes longer to load."""

SolverOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help=f"The solver: {SOLVERS}; by default the domain's, or sarsop.",
    ),
]
PrecisionOption = Annotated[
    float | None,
    typer.Option(
        help="Stop solving at this gap between the bounds, in reward units; by default the domain's, or"
        " 0.0005."
    ),
]
TimeLimitOption = Annotated[
    float | None,
    typer.Option(help="Stop solving after this many seconds; by default the domain's limit, or 60."),
]
NoCacheOption = Annotated[
    bool,
    typer.Option("--no-cache", help="Solve again, and keep nothing, instead of using the cache of policies."),
]


def choose_solver(
    default: SolverOptions, name: str | None, precision: float | None, time_limit: float | None
) -> SolverOptions:
    """Return the domain's solver with the values of the options.

    Raises:
        ModelError: the solver is unknown, or a number is not positive.
    """
    from dataclasses import replace

    given: dict[str, Any] = {"name": name, "precision": precision, "time_limit": time_limit}
    return replace(default, **{key: value for key, value in given.items() if value is not None})


def choose_training(
    *,
    tracks: int | None,
    epochs: int | None,
    features: str | None,
    rate: float | None,
    device: str = "cpu",
    seconds: float | None = None,
    threshold: str | None = None,
    prevalence: float | None = None,
) -> dict[str, Any]:
    """Return the given fields of `TrainingOptions`; None is the default."""
    return {
        "tracks": tracks,
        "epochs": epochs,
        "threshold": threshold,
        "prevalence": prevalence,
        "device": device if device != "cpu" else None,
        "features": None if features is None else tuple(name.strip() for name in features.split(",")),
        "rate": rate,
        "seconds": seconds,
    }


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


LogOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Append each decision as a line of JSON, for `lcorpp replay`."),
]
