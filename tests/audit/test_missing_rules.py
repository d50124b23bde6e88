"""Pr-atoms for attributes without rules."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from lcorpp.audit.audit import audit_people
from lcorpp.audit.estimates import Audit
from lcorpp.audit.logged_people import read_people
from lcorpp.audit.missing_rules import add_missing_rules
from lcorpp.audit.report import format_audit, format_patch
from lcorpp.domains import Domain, load_domain
from lcorpp.reasoning import Program, Reasoner, parse_plog
from tests.audit.logs import write_log


def add(domain: Domain, program: Program) -> tuple[Program, list[str]]:
    used = [*domain.observed, *domain.reasoning.shared]
    changed = add_missing_rules(program, used, domain.label_attributes)
    n = len(program.statements)
    assert changed.statements[:n] == program.statements
    return changed, [str(s) for s in changed.statements[n:]]


def test_rules_are_added_where_there_are_none_and_change_no_probability() -> None:
    domain = load_domain("intention", preset="medium")
    changed, added = add(domain, domain.program)
    people = ("student", "professor", "visitor")
    assert added == [f"pr(location=library | identity={name}) = 1/2." for name in people]
    before, after = Reasoner(domain.program), Reasoner(changed)
    for evidence in ({}, {"location": "library", "classifier": "one"}, {"time": "evening"}):
        expected = before.posterior("intention", evidence)
        assert after.posterior("intention", evidence).probabilities == pytest.approx(expected.probabilities)


@pytest.mark.parametrize(("attribute", "n"), [("time", 6), ("intention", 3)])
def test_all_values_but_one_have_a_rule_for_each_condition(attribute: str, n: int) -> None:
    domain = load_domain("intention")
    kept = [s for s in str(domain.program).splitlines() if not s.startswith(f"pr({attribute}=")]
    _, added = add(domain, parse_plog("\n".join(kept)))
    assert len(added) == n
    assert all(rule.startswith(f"pr({attribute}=") and "| identity=" in rule for rule in added)


def test_attributes_in_other_rules_get_no_rules() -> None:
    domain = load_domain("shopping")
    assert add(domain, domain.program) == (domain.program, [])


def test_without_any_rule_there_is_no_condition() -> None:
    domain = load_domain("intention")
    kept = [s for s in str(domain.program).splitlines() if not s.startswith("pr(") or "classifier" in s]
    assert add(domain, parse_plog("\n".join(kept)))[1] == []


def audit_with(path: Path, change: Callable[[str], str]) -> Audit:
    """Audit people of right knowledge, with changed lines of the program."""
    write_log(path, "paper", 1500, 7)
    people = read_people(path)
    text = "\n".join(map(change, str(people.program).splitlines()))
    return audit_people(replace(people, program=parse_plog(text)))


def test_the_numbers_of_missing_rules_are_estimated_together(tmp_path: Path) -> None:
    audit = audit_with(tmp_path / "log", lambda line: "" if line.startswith("pr(time=") else line)
    assert max(audit.attributes, key=lambda x: x.bic).name == "time"
    changed = {x.name: x for x in audit.changes}
    for name, right in (("morning | identity=professor", 0.8), ("afternoon | identity=visitor", 0.7)):
        interval = changed[f"pr(time={name})"].interval
        assert interval is not None
        assert interval[0] < right < interval[1]
    assert set(changed) == {x.name for x in audit.numbers if x.is_missing}
    text = format_audit(audit)
    assert "There are no rules about time: equal probabilities are taken as stated." in text
    assert "% new, as there are no rules: was 0.333, suggested 0." in format_patch(audit)


@pytest.mark.slow
def test_weakly_determined_numbers_do_not_return_to_wrong_ones(tmp_path: Path) -> None:
    """Wald's statistic of each is small if all numbers of an attribute are free, even if all are wrong."""
    wrong = {"3/20": "17/40", "4/5": "1/10", "1/10": "9/20", "7/10": "3/20"}

    def invert(line: str) -> str:
        head, _, number = line.rstrip(".").rpartition(" = ")
        return f"{head} = {wrong[number]}." if line.startswith("pr(time=") else line

    audit = audit_with(tmp_path / "log", invert)
    assert max(audit.attributes, key=lambda x: x.bic).name == "time"
    assert len(audit.changes) >= 5
