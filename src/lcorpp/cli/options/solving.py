"""The options of the solver that several commands share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.cli.options.common import join_names
from lcorpp.errors import DomainError
from lcorpp.planning.solver_table import ONLINE, SOLVER_NAMES

if TYPE_CHECKING:
    from lcorpp.domains import Domain
    from lcorpp.planning import SolverOptions

OFFLINE_SOLVERS = f"{join_names(SOLVER_NAMES)}, or your own as FILE.py:NAME"
"""The solvers that make a policy, for help."""

SOLVERS = f"{join_names((*SOLVER_NAMES, ONLINE))}, or your own as FILE.py:NAME"
"""The solvers of a robot, for help."""

NoCacheOption = Annotated[
    bool,
    typer.Option("--no-cache", help="Solve again, and keep nothing, instead of using the cache of policies."),
]


def find_cache(*, no_cache: bool) -> Path | None:
    """Return the folder that keeps policies; None for none."""
    from lcorpp.planning.policy_cache import find_cache_folder

    return None if no_cache else find_cache_folder()


@dataclass(frozen=True)
class SolverGroup:
    """How a command solves the POMDP of a domain; each field is an option of its name."""

    solver: Annotated[
        str | None,
        typer.Option(metavar="NAME", help=f"The solver: {SOLVERS}; by default the domain's, or sarsop."),
    ] = None
    precision: Annotated[
        float | None,
        typer.Option(
            help="Stop solving at this gap between the bounds, in reward units; by default the domain's, or"
            " 0.0005."
        ),
    ] = None
    time_limit: Annotated[
        float | None,
        typer.Option(help="Stop solving after this many seconds; by default the domain's limit, or 60."),
    ] = None
    step_seconds: Annotated[
        float | None,
        typer.Option(
            help=f"With --solver {ONLINE}: about the seconds of the search at each step; by default those of"
            " the domain, or 0.1."
        ),
    ] = None
    no_cache: NoCacheOption = False

    def choose_solver(self, domain: Domain) -> SolverOptions:
        """Return the domain's solver with the values of the options.

        Raises:
            ModelError: the solver is unknown, or a number is not positive. DomainError: an option is for
                another solver.
        """
        given: dict[str, Any] = {
            "name": self.solver,
            "precision": self.precision,
            "time_limit": self.time_limit,
            "step_seconds": self.step_seconds,
        }
        chosen = {key: value for key, value in given.items() if value is not None}
        if chosen and domain.planning.search is not None:
            option = "solver" if "name" in chosen else next(iter(chosen)).replace("_", "-")
            raise DomainError(
                f"--{option}: {domain.model.file} is simulated, so that no policy is solved; the work of the"
                f" search at each step is in [planning] of {domain.folder / 'domain.toml'}"
            )
        solver = replace(domain.planning.solver, **chosen)
        if self.step_seconds is not None and solver.name != ONLINE:
            raise DomainError(f"--step-seconds is an option of {ONLINE}, not of {solver.name}")
        return solver

    def find_cache(self) -> Path | None:
        """Return the folder that keeps policies; None for none."""
        return find_cache(no_cache=self.no_cache)
