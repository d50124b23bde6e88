"""Composition of trust for a domain: sources, questions, and the planners for what is heard."""

from __future__ import annotations

from collections.abc import Mapping

from lcorpp.domains import Domain
from lcorpp.domains.dialogue import DomainDialogue, PlannerFactory
from lcorpp.experiments.fixed_policy import FixedPolicy
from lcorpp.experiments.replanning import Replanner
from lcorpp.planning import Planner
from lcorpp.protocols import Reasoner
from lcorpp.trust import Trust, TrustOptions
from lcorpp.values import Array

DEFAULTS = TrustOptions()


def set_up_trust(
    domain: Domain,
    reasoner: Reasoner,
    planner: Planner,
    *,
    hearing: bool = True,
    options: TrustOptions = DEFAULTS,
    rates: Mapping[str, Mapping[str, Array]] = {},
) -> Trust:
    """Return trust in the sources of a domain.

    Args:
        reasoner, options, rates: as of `Trust`. planner: for the domain's POMDP.
        hearing: whether policies are computed for the estimated observation model. Otherwise the policy
            stays, e.g. one of a file or of another solver.

    Raises:
        DomainError: trust cannot follow the domain's dialogue.
    """
    planners: PlannerFactory = FixedPolicy(planner, domain)
    if hearing:
        planners = Replanner(planner, domain.start_beliefs(), domain.planning.solver.precision)
    return Trust(reasoner, domain, DomainDialogue(domain, planners), planner, options=options, rates=rates)
