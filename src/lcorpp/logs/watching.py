"""Alarms about the decisions of a log, see `lcorpp.trust.Alarm`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from math import exp
from pathlib import Path

from lcorpp.assembly.logged_parts import list_changed_files, load_logged_domain, read_program
from lcorpp.domains import Domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.errors import DataError, DecisionError, expected_one_of
from lcorpp.fitting import list_faults
from lcorpp.logs.decision_log import DAMAGE, LoggedDecision, describe_damage, read_log
from lcorpp.logs.replay import ChangedPart
from lcorpp.reasoning import Program
from lcorpp.trust import Alarm, Finding, Hypotheses
from lcorpp.trust.alarm import FALSE_ALARM_RATE, check_rate
from lcorpp.trust.finding import BETTER_CHANGE, BIAS_CHANGE, HEARING, REPEATED_CHANGE, WORSE_CHANGE


def make_hypotheses(domain: Domain, program: Program | None = None, *, given: bool = False) -> Hypotheses:
    """Return a domain's program and its faults.

    Args:
        program: with the rules of its classifiers; by default the domain's.
        given: whether the facts are given, see `Hypotheses`.

    Raises:
        DomainError: a reasoner of the domain's own decides.
    """
    domain.check_program_decides("the alarm")
    used = (*domain.observed, *domain.label_attributes, *domain.reasoning.shared)
    may_lack_rules = (*domain.observed, *domain.reasoning.shared)
    faults = list_faults(domain.program if program is None else program, used, may_lack_rules)
    return Hypotheses(
        faults.reasoners,
        faults.weights,
        faults.attributes,
        faults.changes,
        faults.priors,
        domain,
        given=given,
    )


def make_alarm(domain: Domain, hypotheses: Hypotheses, *, rate: float = FALSE_ALARM_RATE) -> Alarm:
    """Return the alarm of a domain.

    Raises:
        DomainError: as of `DomainDialogue`.
        DecisionError: as of `Alarm`.
    """
    return Alarm(hypotheses, DomainDialogue(domain), rate=rate)


def describe_finding(finding: Finding, domain: Domain) -> str:
    """Return an alarm in one sentence."""
    evidence = f"E = {exp(min(finding.log_e, 700)):.3g}"
    if finding.part == HEARING:
        if finding.change == BIAS_CHANGE:
            return f"the answers are biased: one is observed too often, whatever the value; {evidence}"
        if finding.change in (WORSE_CHANGE, BETTER_CHANGE):
            return f"the answers get {finding.change}; {evidence}"
        if finding.change == REPEATED_CHANGE:
            return f"the same question again gets the answer of before more often than stated; {evidence}"
        how = "noisier" if finding.noise > 0 else "less noisy"
        return f"the answers are {how} than the model states (degree {finding.noise:.2f}); {evidence}"
    sense_of = {sense.attribute: sense.name for sense in domain.senses}
    names = [
        f"the rates of the classifier {sense_of[name]}" if name in sense_of else f"the knowledge about {name}"
        for name in finding.attributes
    ]
    return (
        f"probably wrong: {' or '.join(names)} (most likely: {finding.change});"
        f" {evidence}, probability {finding.probability:.2f}"
    )


class LogWatch:
    """The alarm about the decisions of one strategy in a log.

    If the program changes within the log, as the rates of a classifier do after a training, the alarm
    continues with the hypotheses about the new program; if its faults are others, it starts again.

    Args:
        path: of the log. folder: of the domain, if it is not the one of the log.
        strategy: whose decisions are read; by default all, which must be of one strategy.
        given, rate: as of `Hypotheses` and `Alarm`.
        keep_log_e: whether the attribute `log_e` is filled.

    Attributes:
        alarm, domain: the present ones, None before the first decision.
        strategy: its name, "" before the first decision. n_decisions: number of decisions so far.
        log_e: the logarithm of E of each part after each decision.

    Raises:
        DecisionError: `rate` is not between 0 and 1.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import LCORPP
        >>> from lcorpp.logs import DecisionLog, LogWatch
        >>> robot = load_robot("intention", cache=False)
        >>> with DecisionLog(Path("watched.jsonl")) as log:
        ...     log.append(robot.parts, LCORPP, {}, robot.decide({}, label="one", world=3 * ["pos"]))
        >>> for alarm in LogWatch(Path("watched.jsonl"), strategy="R+P").read():
        ...     print(alarm)
        Traceback (most recent call last):
            ...
        lcorpp.errors.DecisionError: watched.jsonl: no decision of the strategy 'R+P'; expected one of LCORPP
    """

    def __init__(
        self,
        path: Path,
        *,
        folder: Path | None = None,
        strategy: str | None = None,
        given: bool = False,
        rate: float = FALSE_ALARM_RATE,
        keep_log_e: bool = False,
    ) -> None:
        check_rate(rate)
        self._path, self._folder, self._chosen = path, folder, strategy
        self._given, self._rate, self._keeps = given, rate, keep_log_e
        self._parts, self._others = "", dict[str, None]()
        self.domain: Domain | None = None
        self.alarm: Alarm | None = None
        self.strategy, self.n_decisions = "", 0
        self.log_e = list[Mapping[str, float]]()

    def read(
        self, wait: Callable[[], None] | None = None
    ) -> Iterator[tuple[int, Finding] | ChangedPart | DataError]:
        """Read the log; yield alarms with their lines, changed files, and lines that cannot be read.

        Args:
            wait: as of `read_log`.

        Raises:
            FileError: the log cannot be read.
            DecisionError: none of its decisions is of the strategy, or they are of several and none is
                chosen.
        """
        for line in read_log(self._path, wait=wait):
            if isinstance(line, DataError):
                yield line
            elif self._check_strategy(line):
                try:
                    yield from self._update(line)
                except DAMAGE as error:
                    yield DataError(f"{self._path}:{line.line}: cannot be watched: {describe_damage(error)}")
        if self._chosen is not None and not self.strategy:
            expected = f"; {expected_one_of(self._others)}" if self._others else ""
            raise DecisionError(f"{self._path}: no decision of the strategy {self._chosen!r}{expected}")

    def _check_strategy(self, line: LoggedDecision) -> bool:
        """Whether a decision is of the chosen strategy, or of the only one."""
        name = str(dict(line.content.get("strategy") or {}).get("name"))
        if self._chosen is not None and name.upper() != self._chosen.upper():
            self._others[name] = None
            return False
        if self.strategy and name != self.strategy:
            raise DecisionError(
                f"{self._path}:{line.line}: a decision of {name} after those of {self.strategy}, perhaps"
                " about the same people; choose the strategy"
            )
        self.strategy = name
        return True

    def _update(self, line: LoggedDecision) -> Iterator[tuple[int, Finding] | ChangedPart]:
        """Update the alarm with a decision."""
        parts = json.dumps(line.content["parts"])
        if parts != self._parts:
            yield from self._set_up(line)
            self._parts = parts
        assert self.alarm is not None
        assert self.domain is not None
        episode = line.read_episode(self.domain)
        found = self.alarm.update(episode.evidence, episode.steps)
        self.n_decisions += 1
        if self._keeps:
            self.log_e.append(self.alarm.log_e)
        for finding in found:
            yield line.line, finding

    def _set_up(self, line: LoggedDecision) -> Iterator[ChangedPart]:
        """Set up the domain and the alarm of a decision."""
        description = line.content["parts"]
        self.domain = load_logged_domain(description, self._folder)
        program = read_program(description, self.domain)
        hypotheses = make_hypotheses(self.domain, program, given=self._given)
        if self.alarm is None or not self.alarm.replace_hypotheses(hypotheses):
            self.alarm = make_alarm(self.domain, hypotheses, rate=self._rate)
        for what in list_changed_files(self.domain, description):
            yield ChangedPart(line.line, what)
