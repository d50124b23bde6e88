"""Composition of trust for a domain: sources, questions, and planners for estimated observation models."""

from __future__ import annotations

from dataclasses import replace

from lcorpp.assembly.strategies.fixed_policy import FixedPolicy
from lcorpp.assembly.strategies.replanning import Replanner
from lcorpp.decision.strategies import NO_RATES, Rates
from lcorpp.domains import Domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.domains.form_dialogue import FormDialogue
from lcorpp.errors import TooLargeError
from lcorpp.planning import Planner
from lcorpp.protocols import Reasoner
from lcorpp.trust import Trust, TrustOptions
from lcorpp.trust.form_learner import StatedForm
from lcorpp.trust.forms import AnswerForm, ByClass, ByNumber, Repeated
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
    dialogue, forms = DomainDialogue(domain), list[StatedForm]()
    if hearing:
        precision, starts = domain.planning.solver.precision, domain.start_beliefs()
        dialogue.planners = Replanner(planner, starts, precision, dialogue.tables)
        possible: list[AnswerForm] = [ByNumber(), Repeated(len(domain.pomdp.observations))]
        if isinstance(domain.shared, str):
            possible.append(ByClass())
        for form in possible:
            try:
                own = FormDialogue(domain, dialogue, form)
            except TooLargeError:
                continue
            stated = own.make_stated_planner(planner)
            own.planners = Replanner(stated, own.place_starts(starts), precision, own.tables)
            forms.append(StatedForm(form.name, own, own.answers, own.follow(stated)))
    else:  # a fixed policy always goes on asking
        dialogue.planners = FixedPolicy(planner, domain)
        options = replace(options, min_asked=0.0)
    return Trust(reasoner, domain, dialogue, planner, options=options, rates=rates, forms=forms)
