"""`lcorpp solve`: solve a POMDP and write the policy."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.cli import console, model_files, output_files
from lcorpp.cli.console import print_text
from lcorpp.cli.options.solving import OFFLINE_SOLVERS
from lcorpp.planning.solver_table import ONLINE

if TYPE_CHECKING:
    from collections.abc import Callable

    from lcorpp.planning import Progress


def solve(
    problem: model_files.ModelArgument,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="POLICY",
            help="The file to write: .policy or .xml (APPL's format), .alpha; with --limit .json.",
        ),
    ],
    precision: Annotated[
        float, typer.Option(help="Stop at this gap between the bounds, in reward units.")
    ] = 5e-4,
    time_limit: Annotated[float, typer.Option(help="Stop after this many seconds.")] = 60.0,
    memory_limit: Annotated[
        float | None,
        typer.Option(
            min=1,
            metavar="MB",
            help="Maximal memory of sarsop for problem, search and policy. [default: 1000]",
        ),
    ] = None,
    name: Annotated[
        str,
        typer.Option("--solver", metavar="NAME", help=f"The solver: {OFFLINE_SOLVERS}."),
    ] = "sarsop",
    horizon: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Solve for N steps: one policy for each number of remaining steps, e.g. POLICY.3.policy.",
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LIMIT",
            help="Keep a limit, e.g. 'greet:not_interested<=.02': the probability of that action in that"
            " state. Repeatable.",
        ),
    ] = None,
    limit_model: Annotated[
        list[Path] | None,
        typer.Option(metavar="MODEL", help="Keep the limits if this model is the true one, too. Repeatable."),
    ] = None,
    deterministic: Annotated[
        bool, typer.Option("--deterministic", help="With --limit: draw nothing, at some loss of return.")
    ] = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="PICTURE", help="Draw the bounds over time: .png, .svg or .pdf.")
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Check the bounds by an independent evaluation of the policy.")
    ] = False,
    check_time: Annotated[
        float | None,
        typer.Option(
            min=0.1, help="Maximal seconds of --check, which it implies; by default those of the search."
        ),
    ] = None,
) -> None:
    """Solve a POMDP and write the policy, with bounds on its value.

    Ctrl-C writes the best policy so far; during --check it ends the check, which prints its result so far.
    The exit code is 1 if --check refutes the bounds.
    """
    from lcorpp import planning
    from lcorpp.cli.robot_output import describe_open_gap
    from lcorpp.planning.solvers import load_solver

    planning.SolverOptions(name, precision, time_limit)  # checks them before the work
    if name == ONLINE:
        raise typer.BadParameter(f"{ONLINE} makes no policy; its bounds are those of sarsop")
    for option, value in (("--memory-limit", memory_limit), ("--horizon", horizon)):
        if value is not None and name != "sarsop":
            raise typer.BadParameter(f"{option} is an option of sarsop, not of {name}")
    if horizon is not None and (check or check_time is not None):
        raise typer.BadParameter("--check is for policies without --horizon")
    if limit:
        if name != "sarsop" or horizon is not None or memory_limit is not None:
            raise typer.BadParameter("--limit goes with sarsop, without --horizon and --memory-limit")
        from lcorpp.cli.limited import solve_within_limits

        solve_within_limits(
            planning.read_pomdp(problem),
            limit,
            out,
            also=limit_model or (),
            deterministic=deterministic,
            precision=precision,
            time_limit=time_limit,
            check=check,
            check_time=check_time,
            plot=plot,
        )
        return
    if deterministic or limit_model:
        raise typer.BadParameter("--deterministic and --limit-model go with --limit")
    search: Callable[..., Any] = load_solver(name)
    if horizon is not None:
        search = partial(planning.solve_finite_horizon, horizon=horizon)
    if memory_limit is not None:
        search = partial(search, memory_limit=1e6 * memory_limit)
    pomdp = planning.read_pomdp(problem)
    steps = range(1, horizon + 1) if horizon is not None else []
    files = [out.with_name(f"{out.stem}.{k}{out.suffix}") for k in steps] or [out]
    writers = [model_files.make_policy_writer(file) for file in files]
    if plot is not None:
        output_files.check_figure(plot)
    with console.show_delayed_progress("solving") as advance:
        solution = search(
            pomdp,
            precision=precision,
            time_limit=time_limit,
            callback=_show_bounds(advance, precision, time_limit),
        )
    policies = [solution.policy] if horizon is None else solution.policies
    for write, policy in zip(writers, policies, strict=True):
        write(policy)
    print_text(
        f"{problem.name}: lower {solution.lower:.6f}, upper {solution.upper:.6f},"
        f" gap {solution.upper - solution.lower:.6f} at the start belief"
    )
    if horizon is None and not solution.converged:
        print_text(describe_open_gap(solution)[0])
    count = sum(map(len, policies))
    written = f"{out}" if horizon is None else f"{files[0]} to {files[-1].name}, for the remaining steps"
    print_text(f"{solution.reason} after {solution.seconds:.2f} s; wrote {count} vectors to {written}")
    if plot is not None:
        from lcorpp.planning import draw_bounds
        from lcorpp.plot_style import save_figure

        save_figure(draw_bounds(solution.history, title=problem.name), plot)
        print_text(f"drew the bounds in {plot}")
    if check or check_time is not None:
        from lcorpp.planning import certificate

        with console.show_delayed_progress("checking the bounds") as advance:
            checked = certificate(solution, time_limit=check_time, callback=advance)
        print_text(checked.text)
        if checked.verdict == "refuted":
            raise typer.Exit(1)


def _show_bounds(
    advance: Callable[[float, str], None], precision: float, time_limit: float
) -> Callable[[Progress], None]:
    """Return a callback that displays the bounds.

    The bar shows the closed part of the gap, on a log scale, or of the time limit if that is larger.
    """
    first: float | None = None

    def show(now: Progress) -> None:
        nonlocal first
        gap = max(now.upper - now.lower, precision)
        first = gap if first is None else max(first, gap)
        narrowed = math.log(first / gap) / math.log(first / precision) if first > precision else 1.0
        text = f"{now.lower:.6g} to {now.upper:.6g}, {now.vectors} vectors"
        advance(max(narrowed, now.seconds / time_limit), text)

    return show
