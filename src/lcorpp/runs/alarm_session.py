"""The alarm in a run of Algorithm 1, across trainings and interruptions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lcorpp.decision import Robot
from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError
from lcorpp.logs.watching import describe_finding, make_alarm, make_hypotheses
from lcorpp.reasoning import Reasoner
from lcorpp.trust import Finding, Hypotheses
from lcorpp.values import Label, Step


class AlarmSession:
    """The alarm about the decisions of a run; it changes none of them (`lcorpp.decision.strategies.Session`).

    If the faults of the program after a training are others, it starts again, as in `LogWatch`.

    Args:
        full: the robot of the first person, after a training.
        listener: gets each alarm, with the number of people until then.

    Raises:
        DomainError: as of `make_alarm` and `make_hypotheses`.
    """

    def __init__(self, domain: Domain, full: Robot, listener: Callable[[int, Finding], None]) -> None:
        self._domain, self._listener = domain, listener
        self._n_before = 0  # people of earlier alarms
        self._found = list[str]()  # in the current batch
        self._alarm = make_alarm(domain, self._make_hypotheses(full))

    @property
    def n_people(self) -> int:
        """Number of people, also of earlier alarms."""
        return self._n_before + self._alarm.n_people

    def robot(self, full: Robot, person: str | None = None) -> Robot:
        """Return the robot as it is."""
        return full

    def learn(self, evidence: Mapping[str, Label], steps: Iterable[Step], person: str | None = None) -> None:
        """Update the alarm with the decision about a person, who counts as new whether known or not."""
        for finding in self._alarm.update(evidence, steps):
            number = self._n_before + finding.person
            self._found.append(f"person {number}: {describe_finding(finding, self._domain)}")
            self._listener(number, finding)

    def retrain(self, full: Robot, rates: Rates) -> None:
        """Continue with the hypotheses about the program after a training, or start again."""
        hypotheses = self._make_hypotheses(full)
        if not self._alarm.replace_hypotheses(hypotheses):
            self._n_before += self._alarm.n_people
            self._alarm = make_alarm(self._domain, hypotheses)

    def state(self) -> dict[str, Any]:
        """Return the state as JSON."""
        return {"n_before": self._n_before, "alarm": self._alarm.state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state of an earlier run.

        Raises:
            DecisionError: the state is damaged.
        """
        try:
            self._n_before, own = int(state["n_before"]), state["alarm"]
            if own["hypotheses"] == self._alarm.state()["hypotheses"]:
                self._alarm.restore(own)
            else:
                self._n_before += int(own["people"])
        except (LookupError, TypeError, ValueError) as error:
            raise DecisionError(f"the state of the alarm is damaged ({error})") from error

    def describe(self) -> dict[str, Any]:
        """Return log E of each part, and the alarms since the last description as one text."""
        found, self._found = self._found, []
        log_e = {f"log_e_{part}": value for part, value in self._alarm.log_e.items()}
        return {**log_e, "alarm": "; ".join(found)}

    def _make_hypotheses(self, full: Robot) -> Hypotheses:
        self._domain.check_program_decides("the alarm")
        assert isinstance(full.reasoner, Reasoner)
        return make_hypotheses(self._domain, full.reasoner.program)
