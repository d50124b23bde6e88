"""Audits of knowledge by which some people of the log are impossible."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lcorpp.audit.audit import audit_people
from lcorpp.audit.logged_people import LoggedPeople, read_people
from lcorpp.audit.report import format_audit
from lcorpp.reasoning.language.syntax import Number, Probability
from tests.audit.logs import write_log

LIBRARY = "pr(location=library | identity=visitor)"
AFTERNOON = "pr(time=afternoon | identity=visitor)"


@pytest.fixture
def people(tmp_path: Path) -> LoggedPeople:
    """1000 people; one in ten has the identity as a fact."""
    log = tmp_path / "log"
    write_log(log, "paper", 1000, 0, extra={"identity": 10})
    return read_people(log)


def state(people: LoggedPeople, rule: str, number: str) -> LoggedPeople:
    """Return the people with another number of a rule in the program."""
    statements = [
        replace(s, number=Number(Fraction(number)))
        if isinstance(s, Probability) and str(s).startswith(rule)
        else s
        for s in people.program.statements
    ]
    return replace(people, program=replace(people.program, statements=tuple(statements)))


def count_visitors(people: LoggedPeople, **facts: str) -> float:
    own = {"identity": "visitor", **facts}.items()
    contexts = [i for i, context in enumerate(people.contexts) if own <= context.items()]
    return float(people.cases.weights[np.isin(people.cases.contexts, contexts)].sum())


@pytest.mark.parametrize("given", [False, True])
def test_a_stated_1_that_people_contradict_is_a_finding(people: LoggedPeople, given: bool) -> None:
    result = audit_people(state(people, LIBRARY, "1"), given=given)
    assert sum(result.excluded.values()) == count_visitors(people, location="classroom") > 0
    assert all("location=classroom" in x and "identity=visitor" in x for x in result.excluded)
    assert [x.name for x in result.changes] == [LIBRARY]
    (change,) = result.changes
    assert change.stated == 1
    assert change.interval is not None
    assert change.interval[0] < 0.8 < change.interval[1]


def test_a_value_for_which_nothing_is_left_is_a_finding(people: LoggedPeople) -> None:
    """Visitors come with .1 in the morning; .9 in the afternoon leaves nothing for the evening."""
    result = audit_people(state(people, AFTERNOON, "0.9"))
    assert sum(result.excluded.values()) == count_visitors(people, time="evening") > 0
    assert [x.name for x in result.changes] == [AFTERNOON]


def test_the_report_says_who_is_excluded(people: LoggedPeople) -> None:
    result = audit_people(state(people, LIBRARY, "1"))
    text = format_audit(result)
    number = sum(result.excluded.values())
    assert f"\nThe knowledge gives probability 0 to {number} people of the log.\n" in text
    assert "facts of people whom the knowledge excludes" in text
    for facts, n in result.excluded.items():
        assert any(line.split() == [*facts.split(), str(n)] for line in text.splitlines())
    assert "excludes" not in format_audit(audit_people(people))
