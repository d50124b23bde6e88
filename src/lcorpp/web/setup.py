"""Setup of a robot for the page."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from lcorpp.assembly.options import ClassifierOptions
from lcorpp.assembly.track_robot import set_up_track_robot
from lcorpp.decision import LCORPP, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.planning import SolverOptions
from lcorpp.planning.solver_table import ONLINE
from lcorpp.web.robot import PlayRobot


def set_up_robot(
    domain: Domain,
    classifiers: Mapping[str, ClassifierOptions],
    solver: SolverOptions,
    *,
    strategy: Strategy = LCORPP,
    **options: Any,
) -> PlayRobot:
    """Train or load the classifiers, and solve the POMDP.

    Args:
        classifiers: sense -> how to get its classifier, None if the page asks for its labels.
        strategy: of the robot.
        options: of `set_up_track_robot`, which also names the errors.
    """
    if solver.name == ONLINE:
        raise DomainError(f"the page acts by a policy; expected another solver than {ONLINE}")
    return PlayRobot(*set_up_track_robot(domain, classifiers, solver, **options), strategy)


def find_page_folder() -> Path:
    """Return the folder of the page's files."""
    return Path(str(files("lcorpp.web") / "page"))
