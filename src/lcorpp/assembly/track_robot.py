"""Setup of a robot that classifies tracks while they are recorded: classifiers, knowledge and policy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from lcorpp.assembly.options import HARD_LABELS, ClassifierOptions
from lcorpp.assembly.progress import ProgressDisplay, no_progress
from lcorpp.assembly.robot import compose_robot, set_up_senses
from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.domains import Domain, Sense
from lcorpp.learning import StreamingClassifier, TrainedClassifier
from lcorpp.planning import SolverOptions

LEARNER = "lstm-fast"
"""The learner of senses of tracks, unless another one is chosen; the exported page can run it."""
POSITION = ("x", "y")
"""The inputs of a track that a pointer or a people tracker can give."""


def find_track_senses(domain: Domain, channels: Sequence[str] = POSITION) -> list[Sense]:
    """Return the senses whose signals are tracks of some channels, by default of positions."""
    return [
        sense
        for sense in domain.senses
        if set(sense.channels) <= set(channels) and (sense.name in domain.simulation.signals or sense.data)
    ]


def set_up_track_robot(
    domain: Domain,
    classifiers: Mapping[str, ClassifierOptions],
    solver: SolverOptions,
    *,
    cache: Path | None = None,
    progress: ProgressDisplay = no_progress,
    seed: int = 0,
    jobs: int = 1,
) -> tuple[RobotParts, dict[str, TrainedClassifier]]:
    """Train or load the classifiers, and solve the POMDP.

    Args:
        classifiers: sense -> how to get its classifier, None for a sense without one.

    Returns:
        Domain, policy and error rates; and sense -> its classifier of tracks.

    Raises:
        DataError: a classifier is not one of tracks; or as `set_up_senses`.
        ModelError, DomainError: as `solve_domain`.
    """
    senses = set_up_senses(domain, domain.senses, classifiers, HARD_LABELS, progress, seed=seed, jobs=jobs)
    trained = {name: setup.trained for name, setup in senses.items() if setup.trained is not None}
    for classifier in trained.values():
        StreamingClassifier.from_trained(classifier)  # raises an error before the POMDP is solved
    return compose_robot(domain, senses, solver, cache=cache, progress=progress).parts, trained
