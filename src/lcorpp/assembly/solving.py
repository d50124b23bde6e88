"""The policy of a domain, and what is wrong with one that never reports."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Protocol

import numpy as np

from lcorpp.assembly.progress import Advance, show_nothing
from lcorpp.domains import Domain
from lcorpp.errors import NoReportError
from lcorpp.planning import Progress, Solution, SolverOptions
from lcorpp.planning.policy_cache import solve_cached
from lcorpp.reasoning import Program
from lcorpp.values import Array, ConfusionMatrix


class RatesSource(Protocol):
    """A classifier as the program knows it: the matrix that replaces its rules, and whether it is soft."""

    @property
    def confusion(self) -> ConfusionMatrix | None: ...
    @property
    def soft(self) -> bool: ...


def have_own_rates(classifiers: Mapping[str, RatesSource]) -> bool:
    """Whether a classifier has other rates than the domain's program states, or returns likelihoods."""
    return any(part.confusion is not None or part.soft for part in classifiers.values())


def solve_domain(
    domain: Domain,
    solver: SolverOptions | None = None,
    *,
    any_prior: bool = False,
    program: Program | None = None,
    cache: Path | None = None,
    advance: Advance = show_nothing,
) -> Solution:
    """Solve the domain's POMDP for all its start beliefs, or for all priors.

    At the time limit or after Ctrl-C, the result is the best policy so far.

    Args:
        solver: None takes that of the domain.
        any_prior: whether the robot's priors are others than those of the domain's own rates and labels as
            evidence: a classifier was trained or gives likelihoods. With `sarsop` and at most `MAX_MIXED`
            shared values the precision is then reached at every prior, within the solver's limit; also if the
            domain's own priors are too many to be listed.
        program: of the robot with its classifiers' rates, if all of its evidence is hard. Its priors are
            added where the domain has more than `MAX_MIXED` shared values.
        cache: a folder that keeps solutions; None solves.
        advance: receives the seconds and the time limit.

    Raises:
        ModelError: an own solver fails, or returns no policy for this model.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.assembly import solve_domain
        >>> solution = solve_domain(load_domain("intention"))
        >>> solution.start_count, solution.converged
        (33, True)
    """
    options = solver or domain.planning.solver
    limit = options.time_limit

    def show(now: Progress) -> None:
        advance(round(now.seconds), round(limit))

    callback = show if isfinite(limit) and advance is not show_nothing else None
    starts = domain.list_starts()
    beliefs = np.vstack([starts.beliefs, starts.labels_alone])
    is_mixed = options.name == "sarsop" and (any_prior or not starts.are_complete)
    mixed = find_mixed(domain) if is_mixed else None
    if program is not None and find_mixed(domain) is None:
        known = replace(domain, reasoning=replace(domain.reasoning, program=program)).list_starts()
        beliefs = np.vstack([beliefs, known.beliefs, known.labels_alone])
        beliefs = beliefs[np.sort(np.unique(beliefs, axis=0, return_index=True)[1])]  # the first one stays
    return solve_cached(domain.pomdp, beliefs, options, mixed=mixed, folder=cache, callback=callback)


def find_mixed(domain: Domain) -> Array | None:
    """Return the beliefs (V, S) whose mixtures are the priors; None if they are too many."""
    # loads the solver, which a stored policy does without
    from lcorpp.planning.sarsop.mixtures import MAX_MIXED

    corners = domain.planning.initial_states
    return corners if 2 <= len(corners) <= MAX_MIXED else None


FLAWS = {
    "qmdp": "it assumes that one action reveals the state, so it cannot value information; choose another"
    " one, e.g. --solver sarsop",
    "fib": "it overrates what answers are worth; choose another one, e.g. --solver sarsop",
}
"""Solver -> why its policy may never report, and what to do."""


@contextmanager
def explain_missing_reports(solution: Solution | None) -> Iterator[None]:
    """Add to the error of a policy that never reports which solver made it, and what to do.

    Args:
        solution: None if the policy was given.

    Raises:
        NoReportError: with the explanation.
    """
    try:
        yield
    except NoReportError as error:
        raise NoReportError(explain_error(error, solution)) from error


def explain_error(error: Exception, solution: Solution | None) -> str:
    """Return the message of an error; see `explain_missing_reports`."""
    return f"{error}; {_describe_solver(solution)}" if isinstance(error, NoReportError) else str(error)


def _describe_solver(solution: Solution | None) -> str:
    if solution is None:
        return "expected a policy that reports, with --policy or by solving"
    solver, gap = solution.solver or "sarsop", solution.upper - solution.lower
    if solver in FLAWS:
        advice = FLAWS[solver]
    elif solution.converged and gap <= SolverOptions().precision:
        advice = "the policy is nearly optimal, so no report is worth it; check the costs and rewards"
    else:
        advice = "a better policy may exist: give more time (--time-limit), a smaller --precision or another"
        advice += " --solver"
    return f"the solver {solver} ended ({solution.reason}) with a gap of {gap:.4g}; {advice}"
