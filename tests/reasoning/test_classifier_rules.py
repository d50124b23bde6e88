"""Confusion matrices as pr-atoms of a program."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from lcorpp.errors import ProgramError
from lcorpp.reasoning import Enumeration, parse_plog, program_text, read_plog, with_classifier
from lcorpp.values import ConfusionMatrix

PROGRAM = read_plog(Path(__file__).parent.parent / "plog" / "lcorpp.plog")
CLASSES = ("interested", "not_interested")
LABELS = {"interested": "one", "not_interested": "zero"}
MATRIX = ConfusionMatrix(CLASSES, [[75, 25], [28, 71]])


def test_rules_contain_the_exact_smoothed_rates() -> None:
    new = with_classifier(PROGRAM, "classifier", "intention", MATRIX, LABELS)
    rates = Enumeration(new).exact("classifier", {"intention": "interested"})
    assert rates == {"one": Fraction(151, 202), "zero": Fraction(51, 202)}
    rates = Enumeration(new).exact("classifier", {"intention": "not_interested"})
    assert rates == {"one": Fraction(57, 200), "zero": Fraction(143, 200)}
    assert Enumeration(new).exact("identity", {}) == Enumeration(PROGRAM).exact("identity", {})


def test_classifier_rules_are_replaced_and_the_program_is_unchanged() -> None:
    before = program_text(PROGRAM)
    once = with_classifier(PROGRAM, "classifier", "intention", MATRIX, LABELS)
    assert program_text(PROGRAM) == before
    assert with_classifier(once, "classifier", "intention", MATRIX, LABELS) == once
    assert parse_plog(program_text(once)) == once


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"attribute": "clasifier"}, "unknown attribute 'clasifier'; expected one of identity"),
        ({"target": "interest"}, "unknown attribute 'interest'"),
        ({"classes": ("a", "b")}, "class 'a' is not a value of intention; expected one of"),
        ({"labels": {"interested": "one"}}, "labels are given for interested, the confusion"),
        (
            {"labels": {**LABELS, "interested": "yes"}},
            "label 'yes' is not a value of classifier; expected one of zero, one",
        ),
        ({"labels": dict.fromkeys(CLASSES, "one")}, "classes share a label of classifier"),
    ],
)
def test_names_that_do_not_match_the_program_are_errors(changes: dict[str, Any], words: str) -> None:
    options = {
        "attribute": "classifier",
        "target": "intention",
        "classes": CLASSES,
        "labels": LABELS,
        **changes,
    }
    matrix = ConfusionMatrix(options["classes"], [[1, 0], [0, 1]])
    with pytest.raises(ProgramError) as caught:
        with_classifier(PROGRAM, options["attribute"], options["target"], matrix, options["labels"])
    assert words in str(caught.value)


def test_the_classifier_must_be_random_and_without_arguments() -> None:
    program = parse_plog("p : boolean. q : boolean. random(p). q :- p. f : boolean -> boolean. random(f(X)).")
    matrix = ConfusionMatrix(("true", "false"), [[1, 0], [0, 1]])
    labels = {"true": "true", "false": "false"}
    with pytest.raises(ProgramError, match=r"q has no random selection; expected 'random\(q\).'"):
        with_classifier(program, "q", "p", matrix, labels)
    with pytest.raises(ProgramError, match="f has arguments"):
        with_classifier(program, "f", "p", matrix, labels)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"program": "x"}, "program is 'x'; expected Program"),
        ({"attribute": ["classifier"]}, r"attribute is \['classifier'\]; expected str"),
        ({"target": None}, "target is None; expected str"),
        ({"confusion": [[1, 2], [3, 4]]}, "confusion is .*; expected ConfusionMatrix"),
        ({"label_of": None}, "label_of is None; expected Mapping"),
        ({"label_of": {1: "one", 2: "zero"}}, "labels are given for 1, 2, the confusion"),
        ({"label_of": {**LABELS, "interested": ["one"]}}, r"label \['one'\] is not a value of classifier"),
        ({"smoothing": "x"}, "smoothing is 'x'; expected int or float or Fraction"),
    ],
)
def test_arguments_of_a_wrong_type_are_refused(changes: dict[str, Any], words: str) -> None:
    arguments = {
        "program": PROGRAM, "attribute": "classifier", "target": "intention", "confusion": MATRIX,
        "label_of": LABELS, **changes,
    }  # fmt: skip
    with pytest.raises(ProgramError, match=words):
        with_classifier(**arguments)
