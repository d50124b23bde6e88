"""Online learners of a run of Algorithm 1, updated after each person: trust and the alarm."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, check_type
from lcorpp.logs.watching import describe_finding, make_alarm, make_hypotheses
from lcorpp.planning import Planner
from lcorpp.protocols import Planner as PlannerProtocol
from lcorpp.reasoning import Reasoner
from lcorpp.runs.batches import NOISE, WEIGHT, Row
from lcorpp.runs.checkpoint import Json
from lcorpp.trust import Alarm, Finding, Trust
from lcorpp.values import Label, Step


class OnlineLearner(Protocol):
    """Learns from each person of a run, across trainings and interruptions."""

    def begin(self, reasoner: Reasoner, rates: Rates, state: Json | None) -> None:
        """Begin after a training.

        Args:
            reasoner: with the error rates of the classifiers. rates: as of `Strategy.start`.
            state: before that training, in an earlier run; None for a new run.

        Raises:
            DecisionError: the state is damaged.
        """

    def retrain(self, reasoner: Reasoner, rates: Rates) -> None:
        """Continue after a later training."""

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step]) -> None:
        """Learn from the decision about a person."""

    def state(self) -> Json | None:
        """Return the state as JSON; None before it begins."""

    def describe(self) -> Row:
        """Return the columns of a batch that ends."""


class TrustLearner:
    """Trust in a run.

    trust: None before it begins.

    Raises:
        DecisionError: the planner is none of lcorpp's.
    """

    def __init__(self, domain: Domain, planner: PlannerProtocol) -> None:
        check_type(planner, Planner, "the planner of a run with trust", DecisionError)
        self._domain, self._planner = domain, planner
        self.trust: Trust | None = None

    def begin(self, reasoner: Reasoner, rates: Rates, state: Json | None) -> None:
        assert isinstance(self._planner, Planner)
        self.trust = set_up_trust(self._domain, reasoner, self._planner, rates=rates)
        if state is not None:
            self.trust.restore(state)
            self.trust.retrain(reasoner, rates=rates)

    def retrain(self, reasoner: Reasoner, rates: Rates) -> None:
        assert self.trust is not None
        self.trust.retrain(reasoner, rates=rates)

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step]) -> None:
        assert self.trust is not None
        self.trust.learn(evidence, steps)

    def state(self) -> Json | None:
        return None if self.trust is None else self.trust.state()

    def describe(self) -> Row:
        """Return the weights of the sources, and the estimated noise of the answers."""
        if self.trust is None:
            return {}
        weights = zip(self.trust.sources, self.trust.weights.tolist(), strict=True)
        columns: Row = {WEIGHT + name.replace(" ", "_"): weight for name, weight in weights}
        return columns | {NOISE: self.trust.learnt.noise}


class AlarmLearner:
    """The alarm in a run.

    If the faults of the program after a training are others, it starts again, as in `LogWatch`.

    Args:
        listener: gets each alarm, with the number of people until then.
    """

    def __init__(self, domain: Domain, listener: Callable[[int, Finding], None]) -> None:
        self._domain, self._listener = domain, listener
        self._alarm: Alarm | None = None
        self._n_before = 0  # people of earlier alarms
        self._found = list[str]()  # in the current batch

    def begin(self, reasoner: Reasoner, rates: Rates, state: Json | None) -> None:
        self._n_before = 0
        self._alarm = self._make_alarm(reasoner)
        if state is None:
            return
        try:
            self._n_before, own = int(state["n_before"]), state["alarm"]
            if own["hypotheses"] == self._alarm.state()["hypotheses"]:
                self._alarm.restore(own)
            else:
                self._n_before += int(own["people"])
        except (LookupError, TypeError, ValueError) as error:
            raise DecisionError(f"the state of the alarm is damaged ({error})") from error

    def retrain(self, reasoner: Reasoner, rates: Rates) -> None:
        assert self._alarm is not None
        if not self._alarm.replace_hypotheses(make_hypotheses(self._domain, reasoner.program)):
            self._n_before += self._alarm.n_people
            self._alarm = self._make_alarm(reasoner)

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step]) -> None:
        assert self._alarm is not None
        for finding in self._alarm.update(evidence, steps):
            person = self._n_before + finding.person
            self._found.append(f"person {person}: {describe_finding(finding, self._domain)}")
            self._listener(person, finding)

    def state(self) -> Json | None:
        if self._alarm is None:
            return None
        return {"n_before": self._n_before, "alarm": self._alarm.state()}

    def describe(self) -> Row:
        """Return log E of each part, and the alarms of the batch as one text."""
        if self._alarm is None:
            return {}
        found, self._found = self._found, []
        log_e = {f"log_e_{part}": value for part, value in self._alarm.log_e.items()}
        return {**log_e, "alarm": "; ".join(found)}

    def _make_alarm(self, reasoner: Reasoner) -> Alarm:
        return make_alarm(self._domain, make_hypotheses(self._domain, reasoner.program))
