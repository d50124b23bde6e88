"""Arguments and options that several commands share, and the options that describe one decision."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.errors import DomainError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.domains import Domain
    from lcorpp.domains.sections.learning import Sense
    from lcorpp.planning import SolverOptions
    from lcorpp.values import Likelihood, SharedValue

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

STRATEGIES = (
    "L, R, P, L+R, R+P or LCORPP; with several senses LCORPP-SENSE leaves one out; the baselines ask-twice,"
    " random and always-report; or your own as FILE.py:NAME"
)
"""The strategies, for help: those of `lcorpp.experiments.baselines`, which takes longer to load."""

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


def parse_answers(domain: Domain, text: str) -> list[str]:
    """Return the answers in a text such as "pos,neg"; each is an observation of the POMDP."""
    answers = [part.strip() for part in text.split(",")]
    for answer in answers:
        if answer not in domain.pomdp.observations:
            raise DomainError(f"--answers {answer!r}: {expected_one_of(domain.pomdp.observations)}")
    return answers


def parse_facts(domain: Domain, pairs: list[str]) -> dict[str, str]:
    """Return the facts in texts such as "time=afternoon": attribute -> value."""
    facts: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not equals:
            raise DomainError(
                f"--fact {pair!r}: expected NAME=VALUE with NAME among {', '.join(domain.observed)}"
            )
        if name in facts:
            raise DomainError(f"--fact {pair!r}: {name} is given twice")
        facts[name] = value
    domain.evidence(facts, {})  # raises DomainError for an unknown fact
    return facts


def parse_truth(domain: Domain, text: str) -> SharedValue:
    """Return the shared value in a text such as "coffee,alice"."""
    parts = [part.strip() for part in text.split(",")]
    value = parts[0] if len(parts) == len(domain.reasoning.shared) == 1 else tuple(parts)
    if value not in domain.values:
        known = [",".join(domain.reasoning.split(v).values()) for v in domain.values]
        raise DomainError(f"--truth {text!r}: {expected_one_of(known)}")
    return value


def parse_labels(domain: Domain, texts: list[str]) -> dict[str, str]:
    """Return the classes that texts such as "gaze=left" name, sense -> class."""
    labels: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        sense = _find_sense(domain, "--label", text, name if equals else None)
        if sense.name in labels:
            raise DomainError(f"--label {text!r}: the label of {sense.name} is given twice")
        labels[sense.name] = _parse_class(sense, value if equals else text, "--label")
    return labels


def parse_likelihoods(domain: Domain, texts: list[str]) -> dict[str, Likelihood]:
    """Return the likelihoods of texts such as "gaze:left=0.3", sense -> likelihood; 1 for other classes."""
    import numpy as np

    from lcorpp.values import Likelihood

    weights: dict[str, dict[str, float]] = {}
    for text in texts:
        left, _, number = (part.strip() for part in text.rpartition("="))
        name, colon, value = (part.strip() for part in left.partition(":"))
        try:
            weight = float(number)
        except ValueError:
            left = ""
        if not left:
            raise DomainError(f"--likelihood {text!r}: expected VALUE=NUMBER") from None
        sense = _find_sense(domain, "--likelihood", text, name if colon else None)
        class_name = _parse_class(sense, value if colon else left, "--likelihood")
        own = weights.setdefault(sense.name, {})
        if class_name in own:
            raise DomainError(f"--likelihood {text!r}: {class_name} is given twice")
        own[class_name] = weight
    return {
        name: Likelihood(classes, np.array([own.get(value, 1.0) for value in classes]))
        for name, own in weights.items()
        for classes in [domain.find_sense(name).classes]
    }


def _find_sense(domain: Domain, option: str, text: str, name: str | None) -> Sense:
    """Return the sense of this name, or the only one."""
    if name is not None:
        return domain.find_sense(name)
    if len(domain.senses) != 1:
        names = ", ".join(sense.name for sense in domain.senses)
        expected = f"expected the name of a sense first: {names}" if names else "the domain has no [learning]"
        raise DomainError(f"{option} {text!r}: {expected}")
    return domain.senses[0]


def _parse_class(sense: Sense, text: str, option: str) -> str:
    """Return the class that a text names: by itself, or by its label in the program."""
    for class_name, label in sense.label_of.items():
        if text in (label, class_name):
            return class_name
    raise DomainError(f"{option} {text!r}: {expected_one_of(sense.label_of.values())}")
