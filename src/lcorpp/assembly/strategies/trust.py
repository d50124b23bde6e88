"""Strategies with trust: they learn from each person which source of knowledge to believe."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from lcorpp.decision import Robot, Strategy
from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError
from lcorpp.planning.solver_table import ONLINE
from lcorpp.trust.options import DEFAULT_OPTIONS, TrustOptions

if TYPE_CHECKING:
    from lcorpp.assembly.strategies.trust_session import TrustSession
    from lcorpp.planning import SolverOptions


@dataclass(frozen=True)
class StartTrust:
    """Starts sessions with some options of trust; hearing: as of `set_up_trust`."""

    options: TrustOptions = DEFAULT_OPTIONS
    hearing: bool = True

    def __call__(self, full: Robot, rates: Rates) -> TrustSession:
        from lcorpp.assembly.strategies.trust_session import TrustSession  # loads `lcorpp.trust`

        return TrustSession(full, rates, self.options, hearing=self.hearing)


TRUST = Strategy("LCORPP+trust", learns=True, reasons=True, plans=True, start=StartTrust())
"""LCORPP with trust: it estimates the observation model, and asks some people more in order to learn."""

WITH_TRUST = (
    TRUST,
    replace(TRUST, name=f"{TRUST.name}-hearing", start=StartTrust(hearing=False)),
    replace(TRUST, name=f"{TRUST.name}-asking", start=StartTrust(TrustOptions(ask_every=0))),
)
"""LCORPP+trust, and without its hearing or its asking; they are found by their names."""


def with_ask_budget(strategy: Strategy, points: float) -> Strategy:
    """Return a strategy with trust that has this budget for questions that are asked to learn.

    Args:
        points: `TrustOptions.ask_budget`.

    Raises:
        DecisionError: the strategy has no trust, or the budget is negative.
    """
    if not isinstance(strategy.start, StartTrust):
        raise DecisionError(
            f"the strategy {strategy.name!r} never asks to learn, so it has no budget for that; expected one"
            f" with trust, such as {TRUST.name}"
        )
    options = replace(strategy.start.options, ask_budget=points)
    return replace(strategy, start=replace(strategy.start, options=options))


def set_ask_budget(strategies: Iterable[Strategy], points: float) -> tuple[Strategy, ...]:
    """Return strategies of which those with trust have this budget.

    Raises:
        DecisionError: as of `with_ask_budget`, if none of them has trust.
    """
    given = tuple(strategies)
    if not any(isinstance(strategy.start, StartTrust) for strategy in given):
        with_ask_budget(given[-1], points)
    return tuple(
        with_ask_budget(strategy, points) if isinstance(strategy.start, StartTrust) else strategy
        for strategy in given
    )


def find_ask_budget(strategy: Strategy) -> float | None:
    """Return the budget of a strategy that has trust and another budget than the default, else None."""
    if not isinstance(strategy.start, StartTrust):
        return None
    points = strategy.start.options.ask_budget
    return None if points == DEFAULT_OPTIONS.ask_budget else points


def check_dialogue(
    domain: Domain, strategies: Iterable[Strategy], solver: SolverOptions | None = None
) -> None:
    """Check that the dialogue of a domain suits strategies that learn from earlier people, if there are some.

    Args:
        solver: of the robot; None is that of the domain.

    Raises:
        DomainError: as of `DomainDialogue`; or the program relates the labels of several senses; or the
            solver is `ONLINE`.
    """
    if any(strategy.start is not None for strategy in strategies):
        from lcorpp.domains.dialogue import DomainDialogue  # only such strategies need it

        if (solver or domain.planning.solver).name == ONLINE:
            raise DomainError(f"{TRUST.name} acts by a policy; expected another solver than {ONLINE}")

        DomainDialogue(domain)
        related = domain.find_related_senses(domain.program)
        if related:
            raise DomainError(
                f"{domain.program.file}: relates the labels of {' and '.join(related)}, and {TRUST.name}"
                " takes labels as independent given the value; expected a program with one of these senses"
            )
