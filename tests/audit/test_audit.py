"""Audits of simulated people: wrong, right and not identifiable numbers."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from lcorpp.audit import answer_rates
from lcorpp.audit.answer_rates import AnswerRates
from lcorpp.audit.audit import audit_people
from lcorpp.audit.estimates import Audit
from lcorpp.audit.knowledge import EXCLUDED_SHARE, KnowledgeFits
from lcorpp.audit.logged_people import read_people
from lcorpp.audit.rates import describe_values
from lcorpp.audit.report import format_audit, format_patch
from lcorpp.domains import load_domain
from lcorpp.errors import DataError, DomainError, ProgramError, TooLargeError, UndefinedError
from lcorpp.fitting import fit
from lcorpp.fitting.number_model import list_free_numbers
from lcorpp.reasoning import parse_plog
from lcorpp.trust.answers import AnswerModel
from lcorpp.values import Array
from tests.audit.logs import write_log

INTENTION = "pr(intention=interested | identity={})".format


def audit(path: Path) -> Audit:
    return audit_people(read_people(path))


def test_swapped_rules_are_named_with_what_explains_the_data_as_well(tmp_path: Path) -> None:
    """Swapping professor and visitor in the intention rules equals swapping all their other rules."""
    log = tmp_path / "log"
    write_log(log, "low", 2000, 1)
    result = audit(log)
    worst = max(result.attributes, key=lambda x: x.bic)
    assert worst.name == "intention"
    assert worst.p_value < 1e-20
    assert [x.name for x in result.changes] == [INTENTION("professor"), INTENTION("visitor")]
    for x, right in zip(result.changes, (0.1, 0.8), strict=True):
        assert x.interval is not None
        assert x.interval[0] < right < x.interval[1]
    assert f"{INTENTION('professor')}: 0.8 -> " in repr(result)
    html = result._repr_html_()
    assert f"<td>{INTENTION('professor')}</td><td>0.8</td><td>{result.changes[0].estimate:.3f}</td>" in html
    assert html.count("<td>refuted</td>") == len(result.changes) + len(result.changed_rates)
    assert [rival.names for rival in result.rivals] == [("time", "location")]
    assert result.n_undetermined == 1
    assert len(result.undetermined) == 12
    assert "Not identifiable: other numbers of time and location explain the data as well." in format_audit(
        result
    )


def test_right_knowledge_is_not_refuted_but_the_stated_noise_is(tmp_path: Path) -> None:
    log = tmp_path / "log"
    write_log(log, "paper", 2000, 2)
    result = audit(log)
    assert not result.changes
    assert not result.rivals
    assert "The data do not refute the knowledge." in format_audit(result)
    assert {x.name for x in result.changed_rates} == {
        "greet: pos if interested", "greet: pos if not_interested"
    }  # fmt: skip
    (greet,) = [x for x in result.rates if x.name == "greet: pos if interested"]
    assert greet.stated == pytest.approx(0.8)
    assert greet.interval is not None
    assert greet.interval[0] < 0.7 < greet.interval[1]
    turns = [x for x in result.rates if x.name.startswith("turn")]
    assert [x.interval for x in turns] == [None, None]  # this question was never asked
    assert "% No number of the knowledge is refuted." in format_patch(result)


def test_the_identity_as_a_fact_of_some_people_identifies_the_swap(tmp_path: Path) -> None:
    log = tmp_path / "log"
    write_log(log, "low", 2000, 5, extra={"identity": 10})
    result = audit(log)
    assert [x.name for x in result.changes] == [INTENTION("professor"), INTENTION("visitor")]
    assert not result.rivals
    assert result.n_undetermined == 0


@pytest.mark.slow
def test_many_wrong_numbers_are_found_though_single_ones_make_up_for_each_other(tmp_path: Path) -> None:
    """Forward selection alone would end at five numbers, of which three are right."""
    log = tmp_path / "log"
    domain = write_log(log, "paper", 1000, 1, extra={"identity": 20})
    text = re.sub(" +", " ", (domain.folder / "knowledge.plog").read_text())
    wrong = {
        "pr(time=morning | identity=visitor)": "0.605",
        "pr(time=afternoon | identity=visitor)": "0.061",
        "pr(location=library | identity=student)": "0.945",
        INTENTION("student"): "0.845",
        INTENTION("professor"): "0.53",
        INTENTION("visitor"): "0.166",
    }
    for name, number in wrong.items():
        text, count = re.subn(re.escape(name) + r" = [\d.]+\d", f"{name} = {number}", text)
        assert count == 1
    result = audit_people(replace(read_people(log), program=parse_plog(text)))
    assert {x.name for x in result.changes} == set(wrong)


def test_rates_of_soft_evidence_are_estimated_though_none_are_stated(tmp_path: Path) -> None:
    log = tmp_path / "log"
    write_log(log, "paper", 1000, 6, soft=True)
    result = audit(log)
    assert not result.changes
    for x, right in zip(result.rates[:2], (0.76, 0.29), strict=True):
        assert x.stated is None
        assert x.interval is not None
        assert x.interval[0] < right < x.interval[1]
    lines = format_audit(result).splitlines()
    (line,) = [line for line in lines if line.startswith("motion: one if interested ")]
    assert len(line.split()) == 8  # the name, the estimate and its interval


def test_shared_values_of_several_variables_are_described_by_conditions() -> None:
    domain = load_domain("shopping")
    coffee = [v for v, value in enumerate(domain.values) if value[0] == "coffee"]
    assert describe_values(domain, coffee) == "item=coffee"
    others = [v for v, value in enumerate(domain.values) if value[0] != "coffee" and value[2] == "lab"]
    assert describe_values(domain, others) == "item=sandwich or notebook, room=lab"
    assert describe_values(domain, [0, 4]) == "(coffee, alice, office), (coffee, bob, lab)"


def test_the_noise_is_not_determined_by_one_answer_a_person(tmp_path: Path) -> None:
    """Contexts are the people's only repeated evidence; without labels, noise and prior trade off."""
    log = tmp_path / "log"
    write_log(log, "paper", 1000, 4, asked=1)
    people = read_people(log)
    people.cases.labels[:] = -1
    rates = AnswerRates(
        AnswerModel.of_tables(people.dialogue.tables),
        [r for r in people.stated_rates if r is not None],
        people.cases,
        len(people.contexts),
    )
    greet = rates.list_rows(1 + 1 + people.dialogue.questions.index("greet"))
    for row in greet:
        _, variance, prior = rates.describe_cell(row[0], row)
        assert variance > 0.5 * prior


@dataclass
class CertainRates:
    """Rates without uncertainty that identify each person's value (as `AnswerRates`)."""

    likelihoods: Array
    weights: Array
    is_nuisance: Array = field(default_factory=lambda: np.ones(1, bool))
    covariance: Array = field(default_factory=lambda: np.zeros((1, 1)))

    @property
    def scores(self) -> Array:
        return self.compute_scores(self.likelihoods)

    def compute_scores(self, shares: Array) -> Array:
        return np.zeros((len(shares), 1))


def test_fits_of_known_values_are_those_of_records() -> None:
    program = parse_plog(
        "n = {1..3}. a : n. b : boolean. random(a). random(b). pr(a=1) = 0.2. pr(a=2) = 0.5.\n"
        "pr(b | a=1) = 0.7. pr(b | a=2) = 0.4."
    )
    records = [{"b": b, "a": a} for b in ("true", "false") for a in "123"]
    repeats = np.array([60, 90, 40, 20, 160, 30.0])
    rates = CertainRates(np.tile(np.eye(3), (2, 1)), repeats)
    parts = np.repeat(np.arange(6).reshape(2, 3), 3, axis=0)
    free = list_free_numbers(program, ())
    found = KnowledgeFits(program, free, records, parts, rates).fit(free)  # type: ignore[arg-type]
    people = [r for r, n in zip(records, repeats, strict=True) for _ in range(int(n))]
    expected = fit(program, people, prior=1)
    assert found.estimates == pytest.approx([float(x.value) for x in expected.numbers], abs=1e-5)
    for x, p, variance in zip(expected.numbers, found.estimates, np.diag(found.covariance), strict=True):
        assert x.interval is not None
        width = np.log([side / (1 - side) for side in x.interval])
        spread = np.sqrt(variance) / (p * (1 - p))
        assert (width[1] - width[0]) / (2 * 1.96) == pytest.approx(spread, rel=0.06)


def test_numbers_that_sum_to_one_change_together() -> None:
    program = parse_plog("n = {1..3}. a : n. random(a). pr(a=1) = 0.2. pr(a=2) = 0.3. pr(a=3) = 0.5.")
    rates = CertainRates(np.eye(3), np.array([50, 30, 20.0]))
    free = list_free_numbers(program, ())
    records = [{"a": a} for a in "123"]
    fits = KnowledgeFits(program, free, records, np.tile(np.arange(3), (3, 1)), rates)  # type: ignore[arg-type]
    first, *_ = free
    assert fits.complete([first]) == tuple(free)
    found = fits.fit(tuple(free))
    assert found.estimates == pytest.approx(np.array([50.2, 30.3, 20.5]) / 101, abs=1e-6)
    assert found.covariance.sum() == pytest.approx(0, abs=1e-12)
    assert found.covariance[0, 0] == pytest.approx(0.5 * 0.5 / 101, rel=0.02)


def test_logs_without_a_decision_to_read(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text("")
    with pytest.raises(DataError, match="no decision"):
        read_people(log)
    write_log(log, "paper", 3, 0)
    with pytest.raises(DataError, match="no decision of R\\+P; strategies in it: LCORPP"):
        read_people(log, strategy="R+P")
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    lines[0]["steps"][0]["observation"] = "maybe"
    log.write_text("".join(json.dumps(line) + "\n" for line in lines) + "{")
    people = read_people(log)
    assert people.cases.weights.sum() == 2
    assert sum(people.skipped.values()) == 2
    assert "1 lines are left out: unknown observation 'maybe'" in format_audit(audit_people(people))
    for line in lines:
        line["steps"][0]["observation"] = "maybe"
    log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.raises(DataError, match="no decision can be read: unknown observation 'maybe'"):
        read_people(log)
    lines[-1]["parts"]["domain"]["folder"] = "/nowhere"
    log.write_text(json.dumps(lines[-1]) + "\n")
    with pytest.raises((DataError, DomainError), match="/nowhere"):
        read_people(log)


def test_facts_that_the_knowledge_excludes_and_too_many_of_them_are_errors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "log"
    write_log(log, "paper", 100, 0)
    people = read_people(log)
    program = parse_plog(f"{people.program} :- time=evening.")
    with pytest.raises(UndefinedError, match=r"a person with the facts of .*time=evening.* is in no"):
        audit_people(replace(people, program=program))
    with pytest.raises(UndefinedError, match=r"a person with the facts of .*time=evening.* is in no"):
        audit_people(replace(people, program=program), given=True)
    monkeypatch.setattr(answer_rates, "MAX_CELLS", 11)
    with pytest.raises(TooLargeError, match="6 different combinations of facts with 2 shared values"):
        audit_people(people)


def test_a_program_without_numbers_is_an_error(tmp_path: Path) -> None:
    log = tmp_path / "log"
    write_log(log, "paper", 3, 0)
    people = read_people(log)
    lines = str(people.program).splitlines()
    kept = [line for line in lines if not line.startswith("pr(") or "classifier" in line]
    with pytest.raises(ProgramError, match="no number of a pr-atom to audit"):
        audit_people(replace(people, program=parse_plog("\n".join(kept))))


@pytest.mark.slow
def test_given_facts_do_not_determine_their_own_numbers(tmp_path: Path) -> None:
    """A robot on duty in the library in the mornings: no number of the knowledge is wrong."""
    log = tmp_path / "log"
    write_log(log, "paper", 2000, 8)
    people = read_people(log)
    own = [x for x in people.contexts if x["time"] == "morning" or x["location"] == "library"]
    numbers = [people.contexts.index(x) for x in own]
    people.cases.keep(np.flatnonzero(np.isin(people.cases.contexts, numbers)))
    assert audit_people(people).changes
    result = audit_people(people, given=True)
    assert not result.changes
    assert ", facts given; " in format_audit(result)
    right = {str(s).rpartition(" = ")[0]: s for s in people.program.statements}
    for x in result.numbers:
        if x.name.startswith("pr(intention"):
            assert x.interval is not None
            assert x.interval[0] < float(right[x.name].number.value) < x.interval[1]  # type: ignore[attr-defined]


def test_facts_that_are_independent_of_the_value_are_not_determined_if_given() -> None:
    program = parse_plog(
        "a, b, c : boolean. random(a). random(b). random(c). pr(a) = 0.3. pr(b) = 0.6.\n"
        "pr(c | a) = 0.8. pr(c | a=false) = 0.3."
    )
    records = [
        {"a": a, "b": b, "c": c}
        for a in ("true", "false")
        for b in ("true", "false")
        for c in ("true", "false")
    ]
    rates = CertainRates(np.tile(np.eye(2), (4, 1)), np.array([80, 20, 60, 40, 30, 70, 25, 75.0]))
    parts = np.repeat(np.arange(8).reshape(4, 2), 2, axis=0)
    free = list_free_numbers(program, ())
    fits = KnowledgeFits(program, free, records, parts, rates, given=True)  # type: ignore[arg-type]
    of_a, of_b, *of_c = free
    for i in (of_a, of_b):
        fit = fits.fit((i,))
        assert fit.estimates == pytest.approx(fit.stated, abs=1e-6)
        assert fit.covariance[0, 0] == pytest.approx(fit.prior_variance[0])
    assert fits.find_undetermined(1e-6)[0] == 2
    both = fits.fit(of_c)
    assert both.estimates == pytest.approx([(140 + 0.8) / 201, (55 + 0.3) / 201], abs=1e-6)


def test_a_search_leaves_numbers_that_sum_to_one() -> None:
    program = parse_plog("n = {1..3}. a : n. random(a). pr(a=1) = 0.3. pr(a=2) = 0.7.")
    rates = CertainRates(np.eye(3), np.array([10.0, 70.0, 20.0]))
    records = [{"a": a} for a in "123"]
    free = list_free_numbers(program, ())
    fits = KnowledgeFits(program, free, records, np.tile(np.arange(3), (3, 1)), rates)  # type: ignore[arg-type]
    first, _ = free
    fit = fits.fit((first,))
    second = 0.7 + EXCLUDED_SHARE * (1 / 3 - 0.7)  # as the stated numbers exclude people with a=3
    assert fit.estimates == pytest.approx([(1 - second) * 10.3 / 30.3], abs=1e-4)
    expected = [10 * np.log(fit.estimates[0]), 70 * np.log(second)]
    expected.append(20 * np.log(1 - second - fit.estimates[0]))
    assert fit.log_likelihood == pytest.approx(sum(expected))


def test_numbers_that_are_0_or_1_can_be_refuted() -> None:
    program = parse_plog(
        "n = {1..3}. a : n. b : boolean. random(a). random(b). pr(a=1) = 0. pr(a=2) = 1. pr(b) = 1."
    )
    values = [(a, b) for a in "123" for b in ("true", "false")]
    counts = np.array([8, 2, 40, 10, 30, 10.0])
    free = list_free_numbers(program, (), with_certain=True)
    records, parts = [{"a": a, "b": b} for a, b in values], np.tile(np.arange(6), (6, 1))
    fits = KnowledgeFits(program, free, records, parts, CertainRates(np.eye(6), counts))  # type: ignore[arg-type]
    found = fits.fit(free)
    assert found.stated == pytest.approx([0, 1, 1])
    assert found.estimates == pytest.approx([10.01 / 101, 50.98 / 101, 78.99 / 101], abs=1e-3)
    (of_b,) = (i for i in free if program.statements[i].at.line == 1 and "b" in str(program.statements[i]))
    certain = CertainRates(np.eye(6)[2:4], counts[2:4])
    alone = KnowledgeFits(program, free, records, parts[2:4], certain).fit((of_b,))  # type: ignore[arg-type]
    assert alone.estimates == pytest.approx([40.99 / 51], abs=1e-3)
    assert alone.log_likelihood == pytest.approx(
        40 * np.log(alone.estimates[0]) + 10 * np.log(1 - alone.estimates[0])
    )
