"""The folder of a run: a folder for each sense, the trained classifiers, and the list of what is written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from lcorpp.errors import DataError
from lcorpp.files import make_folder
from lcorpp.planning import Solution
from lcorpp.planning.solution import describe_start

if TYPE_CHECKING:
    from lcorpp.protocols import Classifier

T = TypeVar("T")

FORMATS = ("png", "pdf")
"""The formats in which figures are written by default."""


@dataclass(frozen=True)
class WrittenFiles:
    """The files of a result folder. problem: why the classifier is not among them, None if it is."""

    paths: tuple[Path, ...]
    problem: str | None = None


def describe_solution(solution: Solution | None) -> dict[str, Any] | None:
    """Return the bounds of a solution and how its search ended; None if a policy was given."""
    if solution is None:
        return None
    return {
        "solver": solution.solver,
        "lower": solution.lower,
        "upper": solution.upper,
        "gap": solution.upper - solution.lower,
        "bounds_at": describe_start(solution.start_count),
        "converged": solution.converged,
        "reason": solution.reason,
        "seconds": solution.seconds,
        "cached": solution.cached,
    }


def make_folders(folder: Path, senses: Mapping[str, T]) -> Iterator[tuple[Path, T]]:
    """Yield the folder for the files of each sense, which is created if it is missing, and the sense."""
    for name, sense in senses.items():
        yield make_folder(folder if len(senses) == 1 else folder / name), sense


def join_files(paths: Sequence[Path], parts: Sequence[WrittenFiles]) -> WrittenFiles:
    """Return some files and those of each sense as one."""
    problems = [part.problem for part in parts if part.problem]
    complete = (*paths, *[path for part in parts for path in part.paths])
    return WrittenFiles(complete, "; ".join(problems) or None)


def save_if_trained(classifier: Classifier | None, folder: Path) -> WrittenFiles:
    """Save a trained classifier as classifier.npz; others, and kinds that cannot be stored, are left out."""
    if classifier is None:  # a noisy channel does without scikit-learn, which takes seconds to load
        return WrittenFiles(())
    from lcorpp.learning import SoftClassifier, TrainedClassifier, save_classifier

    if isinstance(classifier, SoftClassifier):
        classifier = classifier.trained
    if not isinstance(classifier, TrainedClassifier):
        return WrittenFiles(())
    try:
        save_classifier(classifier, folder / "classifier.npz")
    except DataError as error:
        return WrittenFiles((), str(error))
    return WrittenFiles((folder / "classifier.npz",))
