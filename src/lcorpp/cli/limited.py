"""`lcorpp solve --limit`: a policy within limits, with the check of what it earns and of each limit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.console import print_text
from lcorpp.errors import FileError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lcorpp.planning import LimitedProgress, LimitedSolution, Pomdp

SUFFIX = ".json"

MIN_CHECK_SECONDS = 20.0
"""Least time limit of the check, if none is given."""


def solve_within_limits(
    pomdp: Pomdp,
    texts: Sequence[str],
    out: Path,
    *,
    also: Sequence[Path],
    deterministic: bool,
    precision: float,
    time_limit: float,
    check: bool,
    check_time: float | None,
    plot: Path | None,
) -> None:
    """Search a policy within limits, write it, and print its return, its costs and its check.

    Raises:
        typer.Exit: with code 1 if the check refutes a claim.
    """
    from lcorpp import planning
    from lcorpp.planning.formats.model_file import read_model

    if out.suffix.lower() != SUFFIX:
        raise FileError(
            f"{out}: a policy within limits is a controller; expected a name that ends in {SUFFIX}"
        )
    output_files.check_writable(out)
    if plot is not None:
        output_files.check_figure(plot)
    limits = [planning.read_limit(pomdp, text) for text in texts]
    models = [pomdp, *(read_model(path)[0] for path in also)] if also else []
    with console.show_delayed_progress("solving") as advance:

        def show(now: LimitedProgress) -> None:
            advance(now.seconds / time_limit, f"{now.lower:.6g} to {now.upper:.6g}, {now.plans} plans")

        solution = planning.solve_limited(
            pomdp,
            limits,
            models=models,
            deterministic=deterministic,
            precision=precision,
            time_limit=time_limit,
            callback=show,
        )
    planning.write_randomised_policy(solution.policy, out)
    _print_solution(solution, out)
    if plot is not None and solution.history:
        from lcorpp.plot_style import save_figure

        save_figure(planning.draw_bounds(solution.history, title=Path(pomdp.file).name), plot)
        print_text(f"drew the bounds in {plot}")
    if check or check_time is not None:
        policy = planning.read_randomised_policy(out, pomdp)
        seconds = max(MIN_CHECK_SECONDS, solution.seconds) if check_time is None else check_time
        with console.show_delayed_progress("checking the limits") as advance:
            checked = planning.verify_limits(solution, policy, time_limit=seconds, callback=advance)
        print_text(checked.text)
        if checked.verdict == "refuted":
            raise typer.Exit(1)


def _print_solution(solution: LimitedSolution, out: Path) -> None:
    print_text(
        f"{Path(solution.pomdp.file).name}: return {solution.value:.6f}, at most {solution.upper:.6f} within"
        f" the limits, gap {solution.gap:.6f}"
    )
    for limit, cost, price in zip(solution.limits, solution.costs, solution.multipliers, strict=True):
        worth = f"; one more unit is worth {price:.4g}" if price > 0 else ""
        print_text(f"{limit.name}: {cost:.6g}, at most {limit.bound:g}{worth}")
    policy = solution.policy
    used = int((policy.probabilities.max(axis=0) > 0).sum())
    drawn = "nothing is drawn" if policy.is_deterministic else f"one of {used} start nodes is drawn"
    print_text(
        f"{solution.reason} after {solution.seconds:.2f} s; wrote {len(policy.controller)} nodes to {out},"
        f" {drawn}"
    )
