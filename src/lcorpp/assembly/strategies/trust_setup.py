"""Composition of trust for a domain: sources, questions, and planners for estimated observation models."""

from __future__ import annotations

from dataclasses import replace

from lcorpp.assembly.strategies.fixed_policy import FixedPolicy
from lcorpp.assembly.strategies.replanning import Replanner
from lcorpp.decision.strategies import NO_RATES, Rates
from lcorpp.domains import Domain
from lcorpp.domains.dialogue import DomainDialogue, PlannerFactory
from lcorpp.planning import Planner
from lcorpp.protocols import Reasoner
from lcorpp.trust import Trust, TrustOptions
from lcorpp.trust.options import DEFAULT_OPTIONS


def set_up_trust(
    domain: Domain,
    reasoner: Reasoner,
    planner: Planner,
    *,
    hearing: bool = True,
    options: TrustOptions = DEFAULT_OPTIONS,
    rates: Rates = NO_RATES,
) -> Trust:
    """Return trust in the sources of a domain.

    Args:
        reasoner, options, rates: as of `Trust`. planner: for the domain's POMDP.
        hearing: whether policies are computed for the estimated observation model. Otherwise the policy
            stays, e.g. one of a file or of another solver.

    Raises:
        DomainError: trust cannot follow the domain's dialogue.
    """
    planners: PlannerFactory
    if hearing:
        planners = Replanner(planner, domain.start_beliefs(), domain.planning.solver.precision)
    else:  # a fixed policy does not explore, so it needs the estimates; and it always goes on asking
        planners, options = FixedPolicy(planner, domain), replace(options, max_loss=0.0, min_asked=0.0)
    return Trust(reasoner, domain, DomainDialogue(domain, planners), planner, options=options, rates=rates)
