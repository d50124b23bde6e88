"""The session of a robot with trust: it learns from one person after another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from lcorpp.assembly.strategies.strategy_table import ASK_COST, FORM, NOISE, WEIGHT
from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot
from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, check_type
from lcorpp.planning import Planner
from lcorpp.trust import TrustOptions
from lcorpp.values import Label, Step


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

    def robot(self, full: Robot, person: str | None = None) -> Robot:
        """Return the robot for the next person, see `Session.robot`."""
        if person is None:
            return replace(full, reasoner=self.trust, planner=self.trust.make_planner())
        known = self.trust.recognise(person)
        return replace(full, reasoner=known, planner=known.make_planner())

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step], person: str | None = None) -> None:
        """Learn from the decision about that person."""
        self.trust.learn(evidence, steps, person)

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
        """Return weights of sources and forms, the noise of the answers, and the cost of asking to learn."""
        trust = self.trust
        weights = zip(trust.sources, trust.weights.tolist(), strict=True)
        columns = {WEIGHT + name.replace(" ", "_"): weight for name, weight in weights}
        if len(trust.forms) > 1:
            forms = zip(trust.forms, trust.form_weights.tolist(), strict=True)
            columns |= {FORM + name: weight for name, weight in forms}
        cost = trust.asking.spent / max(trust.n_people, 1)
        return columns | {NOISE: trust.learnt.estimates.mean_noise, ASK_COST: cost}
