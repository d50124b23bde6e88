"""`lcorpp audit`: tables, patch, figure and bad input."""

from __future__ import annotations

import pytest

from lcorpp.reasoning import read_plog
from tests.audit.logs import write_log


@pytest.fixture
def log(tmp_path):
    write_log(tmp_path / "log.jsonl", "low", 1000, 1)
    return tmp_path / "log.jsonl"


def test_tables_patch_and_figure(lcorpp, log, tmp_path):
    patch, figure = tmp_path / "audit.plog", tmp_path / "audit.svg"
    ended = lcorpp("audit", log, "-o", patch, "--figure", figure)
    assert ended.code == 0, ended.err
    lines = ended.out.splitlines()
    assert lines[0].startswith("1000 people about whom LCORPP decided; ")
    assert lines[2].split() == ["rule,", "alone", "stated", "suggested", "95", "%", "interval", "p", "gain"]
    rule = "pr(intention=interested | identity=professor)"
    assert sum(line.startswith(f"{rule} ") for line in lines) == 1
    assert any(line.startswith(f"  {rule}: was 0.8, suggested 0.") for line in lines)
    assert lines[-1] == f"wrote {patch}, {figure}"
    text = patch.read_text()
    assert f"\n{rule} = 0." in text
    assert "\n% line 37: was 0.8, suggested 0." in text
    assert figure.read_text().startswith("<?xml")


def test_given_facts_are_an_option(lcorpp, log):
    ended = lcorpp("audit", log, "--given")
    assert ended.code == 0, ended.err
    assert ended.out.startswith("1000 people about whom LCORPP decided, facts given; ")
    assert "  pr(intention=interested | identity=visitor): was 0.1, suggested 0." in ended.out


def test_the_patch_can_be_applied(lcorpp, log, tmp_path):
    patch = tmp_path / "audit.plog"
    assert lcorpp("audit", log, "-o", patch).code == 0
    rules = [line for line in patch.read_text().splitlines() if line.startswith("pr(")]
    assert rules
    heads = [rule.rpartition(" = ")[0].replace(" ", "") for rule in rules]
    knowledge = read_plog(_find_knowledge()).file
    with open(knowledge) as file:
        kept = [line for line in file if line.rpartition("=")[0].replace(" ", "") not in heads]
    changed = tmp_path / "knowledge.plog"
    changed.write_text("".join(kept) + "\n".join(rules) + "\n")
    numbers = [str(s) for s in read_plog(changed).statements if str(s).startswith("pr(intention")]
    assert len(numbers) == 3


def _find_knowledge():
    from lcorpp.domains.loading import SHIPPED_FOLDER

    return SHIPPED_FOLDER / "intention" / "knowledge_low.plog"


def test_bad_input_is_one_message(lcorpp, log, tmp_path):
    for arguments, message in (
        ((tmp_path / "none",), "none: cannot be read: No such file or directory"),
        ((log, "-o", tmp_path / "x.txt"), "x.txt: expected a file name that ends with .plog"),
        ((log, "--figure", tmp_path / "x.txt"), "x.txt: not a figure file"),
        ((log, "--strategy", "R+P"), "no decision of R+P; strategies in it: LCORPP"),
        ((log, "--domain", tmp_path), "domain.toml"),
    ):
        ended = lcorpp("audit", *arguments)
        assert ended.code == 2
        assert ended.out == ""
        assert message in ended.err
        assert len(ended.err.splitlines()) == 1
