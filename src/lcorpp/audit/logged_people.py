"""The people of a log of decisions: their facts, labels and answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.errors import DataError
from lcorpp.logs.decision_log import DAMAGE, LoggedDecision, describe_damage
from lcorpp.logs.strategy_decisions import StrategyDecisions, read_decisions
from lcorpp.reasoning import Program, Reasoner
from lcorpp.trust.cases import NO_LABEL, Cases
from lcorpp.trust.sources.stated import StatedSources
from lcorpp.values import Array, Label, Likelihood

AnsweredPerson = tuple[int, list[int], list[int]]
"""The index of the context, those of the labels, and the answers in their order."""


@dataclass(frozen=True, eq=False)
class LoggedPeople:
    """The people about whom one strategy decided.

    program: with the rules of the log's last classifiers.
    contexts: the distinct facts. labels: for each sense its L possible labels.
    stated_rates: for each sense (V, L) the program's P(label | value); None for a sense with soft evidence.
    cases: the distinct people, by the numbers of their contexts and labels, with their weights.
    strategy: its name. n_others: number of decisions of other strategies.
    skipped: why lines are left out -> how many.
    parts: the description of the robot at the last decision.
    answered: the people one by one; forms of answers are tested with them. None: no form is tested.
    """

    domain: Domain
    program: Program
    dialogue: DomainDialogue
    contexts: Sequence[Mapping[str, str]]
    labels: Sequence[Sequence[str]]
    stated_rates: Sequence[Array | None]
    cases: Cases
    strategy: str
    n_others: int
    skipped: Mapping[str, int]
    parts: Mapping[str, Any]
    answered: Sequence[AnsweredPerson] = ()


def read_people(path: Path, *, folder: Path | None = None, strategy: str | None = None) -> LoggedPeople:
    """Read the people of a log.

    The knowledge, model and classifiers are those of the log's last decision, from the files as they are now.
    Labels of other classifiers are left out.

    Args:
        path: of the log. folder: of the domain, if it is not the one of the log.
        strategy: whose decisions are read; None: the one with the most decisions, of equal ones the last in
            the log, as strategies of one run decide about the same people.

    Raises:
        FileError: the log cannot be read.
        DataError: it has no decision of the strategy, or none that can be read.
        LcorppError: the domain cannot be loaded, or its dialogue cannot be followed.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_robot
        >>> from lcorpp.audit import read_people
        >>> from lcorpp.decision import LCORPP
        >>> from lcorpp.logs import DecisionLog
        >>> robot = load_robot("intention", cache=False)
        >>> with DecisionLog(Path("three.jsonl")) as log:
        ...     for answer in ("pos", "pos", "neg"):
        ...         log.append(robot.parts, LCORPP, {}, robot.decide({}, label="zero", world=9 * [answer]))
        >>> people = read_people(Path("three.jsonl"))
        >>> people.strategy, people.cases.weights.tolist()  # of two distinct people
        ('LCORPP', [2.0, 1.0])
    """
    found = read_decisions(path, strategy)
    return _Reader(*found.load(folder, "an audit"), found).read(path)


class _Reader:
    """Reads decisions as cases."""

    def __init__(self, domain: Domain, program: Program, found: StrategyDecisions) -> None:
        self._domain, self._program, self._found, self._parts = domain, program, found, found.parts
        self._dialogue = DomainDialogue(domain)
        self._senses = [sense.name for sense in domain.senses]
        self._labels: list[list[str]] = []
        self._rates: list[Array | None] = []
        self._contexts: dict[frozenset[tuple[str, str]], int] = {}
        start = domain.marginal(domain.pomdp.start)
        stated = StatedSources(Reasoner(program), domain, start)
        descriptions = self._parts["classifiers"]
        assert isinstance(descriptions, Mapping)
        for sense in domain.senses:
            if descriptions.get(sense.name, {}).get("soft"):
                self._labels.append(list(sense.label_of.values()))
                self._rates.append(None)
            else:
                labels, rates = stated.compute_rates(sense.attribute)
                self._labels.append(list(labels))
                self._rates.append(rates)

    def read(self, path: Path) -> LoggedPeople:
        skipped = self._found.skipped
        n_answers = self._dialogue.tables.shape[0] * self._dialogue.tables.shape[2]
        cases, answered = Cases(len(self._senses), n_answers), list[AnsweredPerson]()
        for line in self._found.decisions:
            try:
                person = self._read(line)
                cases.add(*person)
                answered.append(person)
            except DAMAGE as error:
                skipped[describe_damage(error)] += 1
        related = self._domain.find_related_senses(self._program)
        places = [self._senses.index(name) for name in related]
        if related and (cases.labels[:, places] != NO_LABEL).any(axis=0).all():
            raise DataError(
                f"{path}: the program relates the labels of {' and '.join(related)}, and an audit takes"
                " labels as independent given the value; expected a log of a strategy with one of them, e.g."
                f" LCORPP-{related[0]}"
            )
        if not cases.n:
            reason = next(iter(skipped), "it is empty")
            raise DataError(f"{path}: no decision can be read: {reason}")
        return LoggedPeople(
            self._domain,
            self._program,
            self._dialogue,
            [dict(context) for context in self._contexts],
            self._labels,
            self._rates,
            cases,
            self._found.strategy,
            self._found.n_others,
            skipped,
            self._parts,
            answered,
        )

    def _read(self, line: LoggedDecision) -> AnsweredPerson:
        """Return the context, labels and answers of a decision."""
        content = line.content
        history = [(s["action"], s["observation"]) for s in content["steps"] if s["observation"] is not None]
        answers = self._dialogue.find_answers(history)
        labels = [self._read_label(line, sense) for sense in range(len(self._senses))]
        facts = frozenset({str(name): str(value) for name, value in content["facts"].items()}.items())
        return self._contexts.setdefault(facts, len(self._contexts)), labels, answers

    def _read_label(self, line: LoggedDecision, place: int) -> int:
        """Return the index of a label; `NO_LABEL` if there is none, or another classifier's."""
        name, attribute = self._senses[place], self._domain.label_attributes[place]
        own, last = line.content["parts"]["classifiers"], self._parts["classifiers"]
        assert isinstance(last, Mapping)
        label: Label | None = line.content["evidence"].get(attribute)
        if label is None or own.get(name) != last.get(name):
            return NO_LABEL
        if isinstance(label, Mapping):
            label = Likelihood(tuple(label), np.array(list(label.values()))).most_likely()
        return self._labels[place].index(str(label))
