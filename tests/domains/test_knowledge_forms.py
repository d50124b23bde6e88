"""The paper's knowledge makes one robot in each form: tables, BIF, Markov logic, plingo, own code."""

import shutil
from itertools import product
from math import log

import numpy as np
import pytest

from lcorpp import ConfusionMatrix, load_domain, load_robot
from lcorpp.decision import strategies
from lcorpp.domains.loading import SHIPPED_FOLDER
from lcorpp.errors import ProgramError
from lcorpp.reasoning import Reasoner, read_plog, table_text, with_classifier
from lcorpp.scoring import evaluate_exactly

VALUES = {
    "identity": ("student", "professor", "visitor"),
    "time": ("morning", "afternoon", "evening"),
    "location": ("library", "classroom"),
    "intention": ("interested", "not_interested"),
    "classifier": ("one", "zero"),
}
TABLES = {
    "time": ("identity", ((0.15, 0.15, 0.7), (0.8, 0.1, 0.1), (0.1, 0.7, 0.2))),
    "location": ("identity", ((0.3, 0.7), (0.1, 0.9), (0.8, 0.2))),
    "intention": ("identity", ((0.3, 0.7), (0.1, 0.9), (0.8, 0.2))),
    "classifier": ("intention", ((0.76, 0.24), (0.29, 0.71))),
}


def list_cells():
    """Yield attribute, its value, parent, its value, and the probability."""
    for name, (parent, rows) in TABLES.items():
        for given, row in zip(VALUES[parent], rows, strict=True):
            for value, p in zip(VALUES[name], row, strict=True):
                yield name, value, parent, given, p


def write_bif():
    parts = ["network paper { }"]
    for name, values in VALUES.items():
        parts.append(f"variable {name} {{ type discrete [ {len(values)} ] {{ {', '.join(values)} }}; }}")
    parts.append("probability ( identity ) { table 0.3333333333, 0.3333333333, 0.3333333334; }")
    for name, (parent, rows) in TABLES.items():
        own = [f"({v}) {', '.join(map(str, row))};" for v, row in zip(VALUES[parent], rows, strict=True)]
        parts.append(f"probability ( {name} | {parent} ) {{ {' '.join(own)} }}")
    return "\n".join(parts)


def write_mln():
    parts = [f"{name}s = {{{', '.join(values)}}}" for name, values in VALUES.items()]
    parts += [f"{name}({name}s!)" for name in VALUES]
    parts += [f'{log(p)!r} {of}("{given}") ^ {name}("{v}")' for name, v, of, given, p in list_cells()]
    return "\n".join(parts)


def write_plingo():
    parts = [
        f"{name}s({'; '.join(values)}). &random {{ {name}(X) : {name}s(X) }}."
        for name, values in VALUES.items()
    ]
    parts += [f'&pr {{ {name}({v}) }} = "{p}" :- {of}({given}).' for name, v, of, given, p in list_cells()]
    return "\n".join(parts)


def write_csv():
    return table_text(read_plog(SHIPPED_FOLDER / "intention" / "knowledge.plog"))


def write_toml():
    return table_text(read_plog(SHIPPED_FOLDER / "intention" / "knowledge.plog"), "toml")


def write_own():
    return (SHIPPED_FOLDER / "intention" / "knowledge.plog").read_text()


@pytest.mark.parametrize(
    ("suffix", "write"),
    [
        ("csv", write_csv),
        ("toml", write_toml),
        ("bif", write_bif),
        ("mln", write_mln),
        ("plp", write_plingo),
        ("plog", write_own),
    ],
    ids=["csv", "toml", "bif", "mln", "plp", "own"],
)
def test_the_same_robot(tmp_path, suffix, write):
    folder = tmp_path / "paper"
    shutil.copytree(SHIPPED_FOLDER / "intention", folder)
    (folder / f"own.{suffix}").write_text(write())
    reasoner = ""
    if write is write_own:
        reasoner = 'reasoner = "own.py:Own"\n'
        (folder / "own.py").write_text(
            "from lcorpp.reasoning import Reasoner\ndef Own(program, rates): return Reasoner(program)\n"
        )
    text = (folder / "domain.toml").read_text().replace('"knowledge.plog"', f'"own.{suffix}"')
    (folder / "domain.toml").write_text(text.replace("[reasoning]\n", f"[reasoning]\n{reasoner}"))
    paper, own = load_domain("intention", preset="paper"), load_domain(folder, preset="paper")
    ours, theirs = own.make_reasoner(own.program), paper.make_reasoner(paper.program)
    for time, place, label in product(
        *[(None, *VALUES[name]) for name in ("time", "location", "classifier")]
    ):
        named = {"time": time, "location": place, "classifier": label}
        evidence = {name: value for name, value in named.items() if value is not None}
        found, expected = (each.posterior("intention", evidence).probabilities for each in (ours, theirs))
        np.testing.assert_allclose(found, expected, atol=1e-9)
    scores = []
    for domain in (paper, own):
        robot = load_robot(domain, cache=False)
        channels = {"motion": robot.senses["motion"].classifier}
        scores.append(evaluate_exactly(domain, robot.robot, channels, strategies(["L+R", "R+P", "LCORPP"])))
    for one, other in zip(*scores, strict=True):
        assert one.strategy == other.strategy
        assert one.accuracy.estimate == pytest.approx(other.accuracy.estimate, abs=1e-7)
        assert one.return_.estimate == pytest.approx(other.return_.estimate, abs=1e-4)


def test_error_rates_replace_pr_atoms_but_no_weights(tmp_path):
    """Formulas about the label would count beside the rates of a trained classifier."""
    confusion = ConfusionMatrix(("interested", "not_interested"), [[9, 1], [2, 8]])
    labels = {"interested": "one", "not_interested": "zero"}
    expected = load_domain("intention", preset="paper").program_for({"motion": confusion})
    (tmp_path / "own.plp").write_text(write_plingo())
    program = with_classifier(read_plog(tmp_path / "own.plp"), "classifier", "intention", confusion, labels)
    ours, theirs = (
        Reasoner(each).posterior("intention", {"classifier": "one"}) for each in (program, expected)
    )
    np.testing.assert_allclose(ours.probabilities, theirs.probabilities)
    (tmp_path / "own.mln").write_text(write_mln())
    with pytest.raises(ProgramError, match="a weight depends on classifier, and error rates cannot replace"):
        with_classifier(read_plog(tmp_path / "own.mln"), "classifier", "intention", confusion, labels)
