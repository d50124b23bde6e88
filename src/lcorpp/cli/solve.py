"""`lcorpp solve`: a POMDP file to a policy file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import show


def solve(
    problem: Annotated[Path, typer.Argument(metavar="FILE.pomdp", help="The model.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE.policy", help="Where the policy goes.")],
    precision: Annotated[
        float, typer.Option(help="Stop when the bounds are this close, in reward units.")
    ] = 5e-4,
    time_limit: Annotated[float, typer.Option(help="Stop after this many seconds.")] = 60.0,
) -> None:
    """Solve a POMDP with SARSOP and write the policy, with bounds on how good it is.

    Ctrl-C writes the best policy so far.
    """
    from lcorpp import planning

    pomdp = planning.read_pomdp(problem)
    with show.progress("solving") as advance:
        solution = planning.solve(
            pomdp,
            precision=precision,
            time_limit=time_limit,
            callback=lambda now: advance(
                now.trials, title=f"solving: {now.lower:.4g} to {now.upper:.4g}, {now.vectors} vectors, trial"
            ),
        )
    planning.write_policy(solution.policy, out)
    show.console.print(
        f"{problem.name}: lower {solution.lower:.6f}, upper {solution.upper:.6f},"
        f" gap {solution.upper - solution.lower:.6f} at the start belief"
    )
    show.console.print(
        f"{solution.reason} after {solution.seconds:.2f} s; wrote {solution.vectors} vectors to {out}"
    )
