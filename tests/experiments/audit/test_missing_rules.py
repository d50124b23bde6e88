"""Pr-atoms for attributes without rules."""

from __future__ import annotations

from pathlib import Path

import pytest

from lcorpp.domains import Domain, load_domain
from lcorpp.experiments.audit.audit import audit_people
from lcorpp.experiments.audit.logged_people import read_people
from lcorpp.experiments.audit.missing_rules import add_missing_rules
from lcorpp.experiments.audit.report import format_audit, format_patch
from lcorpp.reasoning import Program, Reasoner, parse_plog
from tests.experiments.audit.logs import write_log


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


def test_data_refute_the_equal_probabilities_of_an_attribute_without_rules(tmp_path: Path) -> None:
    log = tmp_path / "log"
    write_log(log, "medium", 1000, 7)
    audit = audit_people(read_people(log))
    assert max(audit.attributes, key=lambda x: x.bic).name == "location"
    changed = {x.name: x for x in audit.changes}
    assert set(changed) == {x.name for x in audit.numbers if x.is_missing}
    right = changed["pr(location=library | identity=professor)"]
    assert right.interval is not None
    assert right.interval[0] < 0.1 < right.interval[1]
    text = format_audit(audit)
    assert "There are no rules about location: equal probabilities are taken as stated." in text
    assert "% new, as there are no rules: was 0.5, suggested 0." in format_patch(audit)
