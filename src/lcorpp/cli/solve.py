"""`lcorpp solve`: a model to a policy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console as show, model_files as models

if TYPE_CHECKING:
    from collections.abc import Callable

    from lcorpp.planning import Progress


def solve(
    problem: models.ModelArgument,
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="POLICY", help="Where the policy goes: .policy or .xml (APPL's), .alpha."
        ),
    ],
    precision: Annotated[
        float, typer.Option(help="Stop when the bounds are this close, in reward units.")
    ] = 5e-4,
    time_limit: Annotated[float, typer.Option(help="Stop after this many seconds.")] = 60.0,
    name: Annotated[
        str, typer.Option("--solver", metavar="NAME", help="sarsop, exact, perseus, qmdp or fib.")
    ] = "sarsop",
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="PICTURE", help="Also draw the bounds over time.")
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Also work out what the policy earns, from the model alone.")
    ] = False,
) -> None:
    """Solve a POMDP and write the policy, with bounds on how good it is.

    Ctrl-C writes the best policy so far. The exit code is 1 when --check refutes what the solver says.
    """
    from lcorpp import planning
    from lcorpp.planning.solvers import load_solver

    search = load_solver(name)
    pomdp = planning.read_pomdp(problem)
    write = models.policy_writer(out)
    if plot is not None:
        models.check_picture(plot)
    with show.late_progress("solving") as advance:
        solution = search(
            pomdp, precision=precision, time_limit=time_limit, callback=_told(advance, precision, time_limit)
        )
    write(solution.policy)
    typer.echo(
        f"{problem.name}: lower {solution.lower:.6f}, upper {solution.upper:.6f},"
        f" gap {solution.upper - solution.lower:.6f} at the start belief"
    )
    typer.echo(f"{solution.reason} after {solution.seconds:.2f} s; wrote {solution.vectors} vectors to {out}")
    if plot is not None:
        from lcorpp.planning import draw_bounds
        from lcorpp.plot_style import save_figure

        save_figure(draw_bounds(solution.history, title=problem.name), plot)
        typer.echo(f"drew the bounds in {plot}")
    if check:
        from lcorpp.planning import certificate

        found = certificate(solution)
        typer.echo(found.text)
        if found.verdict == "refuted":
            raise typer.Exit(1)


def _told(
    advance: Callable[[float, str], None], precision: float, time_limit: float
) -> Callable[[Progress], None]:
    """What shows the bounds while a search goes on. It ends by its gap, in factors, or by its time."""
    first: float | None = None

    def tell(now: Progress) -> None:
        nonlocal first
        gap = max(now.upper - now.lower, precision)
        first = gap if first is None else max(first, gap)
        narrowed = math.log(first / gap) / math.log(first / precision) if first > precision else 1.0
        words = f"{now.lower:.6g} to {now.upper:.6g}, {now.vectors} vectors"
        advance(max(narrowed, now.seconds / time_limit), words)

    return tell
