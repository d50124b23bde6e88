"""Strategies with trust: they learn from each person which source of knowledge to believe."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot, Strategy
from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.errors import DecisionError, check_type
from lcorpp.planning import Planner
from lcorpp.reasoning import Reasoner
from lcorpp.trust import TrustOptions
from lcorpp.trust.sources import StatedSources
from lcorpp.trust.trust import DEFAULT_OPTIONS
from lcorpp.values import JEFFREYS, ConfusionMatrix, Label, Step

WEIGHT, NOISE = "weight_", "noise"
"""Columns of trust in a table: the weight of each source, and the estimated noise of the answers."""


class TrustSession:
    """The decisions of a robot with trust, about one person after another.

    trust: what it has learnt so far.

    Args:
        full: the full robot. rates: of its senses with soft evidence.

    Raises:
        DecisionError: the robot's domain or planner is none of lcorpp's. DomainError: as of `DomainDialogue`.
    """

    def __init__(self, full: Robot, rates: Rates, options: TrustOptions, *, hearing: bool) -> None:
        domain, planner = full.domain, full.planner
        check_type(domain, Domain, "the domain of a strategy with trust", DecisionError)
        check_type(planner, Planner, "the planner of a strategy with trust", DecisionError)
        assert isinstance(domain, Domain)
        assert isinstance(planner, Planner)
        self._reasoner, self._rates = full.reasoner, rates
        self.trust = set_up_trust(
            domain, full.reasoner, planner, hearing=hearing, options=options, rates=rates
        )

    @property
    def n_people(self) -> int:
        """Number of people that it has learnt from."""
        return self.trust.n_people

    def robot(self, full: Robot) -> Robot:
        """Return the robot for the next person; `full`: whose classifiers perceive that person."""
        return replace(full, reasoner=self.trust, planner=self.trust.make_planner())

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step]) -> None:
        """Learn from the decision about that person."""
        self.trust.learn(evidence, steps)

    def retrain(self, full: Robot, rates: Rates) -> None:
        """Use a robot whose classifiers were trained again, see `Trust.retrain`."""
        self._reasoner, self._rates = full.reasoner, rates
        self.trust.retrain(full.reasoner, rates=rates)

    def state(self) -> dict[str, Any]:
        """Return what it has learnt as JSON."""
        return self.trust.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state, with the classifiers of this session.

        Raises:
            DecisionError: as of `Trust.restore`.
        """
        self.trust.restore(state)
        self.trust.retrain(self._reasoner, rates=self._rates)

    def describe(self) -> dict[str, float]:
        """Return the weights of the sources, and the estimated noise of the answers."""
        weights = zip(self.trust.sources, self.trust.weights.tolist(), strict=True)
        columns = {WEIGHT + name.replace(" ", "_"): weight for name, weight in weights}
        return columns | {NOISE: self.trust.learnt.noise}


@dataclass(frozen=True)
class StartTrust:
    """Starts sessions with some options of trust; hearing: as of `set_up_trust`."""

    options: TrustOptions = DEFAULT_OPTIONS
    hearing: bool = True

    def __call__(self, full: Robot, rates: Rates) -> TrustSession:
        return TrustSession(full, rates, self.options, hearing=self.hearing)


TRUST = Strategy("LCORPP+trust", learns=True, reasons=True, plans=True, start=StartTrust())
"""LCORPP with trust: it estimates the observation model, and asks some people more in order to learn."""

WITH_TRUST = (
    TRUST,
    replace(TRUST, name=f"{TRUST.name}-hearing", start=StartTrust(hearing=False)),
    replace(TRUST, name=f"{TRUST.name}-asking", start=StartTrust(TrustOptions(ask_every=0))),
)
"""LCORPP+trust, and without its hearing or its asking; they are found by their names."""


def check_dialogue(domain: Domain, strategies: Iterable[Strategy]) -> None:
    """Check that the dialogue of a domain suits strategies that learn from earlier people, if there are some.

    Raises:
        DomainError: as of `DomainDialogue`.
    """
    if any(strategy.start is not None for strategy in strategies):
        DomainDialogue(domain)


def compute_soft_rates(
    domain: Domain,
    confusions: Mapping[str, ConfusionMatrix],
    smoothing: Fraction = JEFFREYS,
    *,
    soft: Sequence[str],
) -> Rates:
    """Return the rates of senses with soft evidence, which the robot's program lacks.

    Args:
        confusions: sense -> its matrix; without one the rates of the domain's program remain.
        smoothing: of the matrices. soft: the senses with soft evidence.
    """
    if not soft:
        return {}
    program = domain.program_for(confusions, smoothing)
    sources = StatedSources(Reasoner(program), domain, domain.marginal(domain.pomdp.start))
    rates = {}
    for name in soft:
        attribute = domain.find_sense(name).attribute
        labels, table = sources.compute_rates(attribute)
        rates[attribute] = dict(zip(labels, table.T, strict=True))
    return rates
