"""`lcorpp fit`: the fitted program, the report and bad input."""

from __future__ import annotations

import pytest

PROGRAM = """\
% two coins
p, q : boolean.
random(p).  random(q).
pr(p) = 1/2.         % a guess
pr(q | p) = 0.5.
"""
DATA = 'p,"q"\ntrue,true\ntrue, false\n true ,true\nfalse,?\n,\n'


@pytest.fixture
def files(tmp_path):
    (tmp_path / "coins.plog").write_text(PROGRAM)
    (tmp_path / "coins.csv").write_text(DATA)
    return tmp_path / "coins.plog", tmp_path / "coins.csv"


def test_prints_the_program_with_its_comments(lcorpp, files):
    ended = lcorpp("fit", *files)
    assert ended.code == 0, ended.err
    assert ended.out == PROGRAM.replace("1/2", "0.75").replace("0.5", "0.666667")
    assert "5 records, log likelihood" in ended.err
    assert "line 4: pr(p=true) = 0.75; 95 % interval " in ended.err


def test_writes_a_file_and_fixes_numbers(lcorpp, files, tmp_path):
    ended = lcorpp("fit", *files, "-o", tmp_path / "new.plog", "--fix", "q", "--prior", "4")
    assert ended.code == 0, ended.err
    assert (tmp_path / "new.plog").read_text() == PROGRAM.replace("1/2", "0.625")
    assert ended.out.count("line ") == 1
    assert lcorpp("fit", *files, "--fix", "4").out == PROGRAM.replace("0.5", "0.666667")


def test_random_starts(lcorpp, files):
    ended = lcorpp("fit", *files, "--starts", "3", "--seed", "7")
    assert ended.code == 0, ended.err
    assert ended.out == lcorpp("fit", *files).out
    assert "the best of 3 starts" in ended.err
    assert lcorpp("fit", *files, "--starts", "0").code == 2


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("", ":1: expected a header"),
        ("p,p\n", ":1: two columns are named p"),
        ("p,q\ntrue\n", ":2: 1 cells; expected 2"),
        ("p\n", "there are no records"),
        ("x\n1\n", "coins.csv:2: 'x'"),
        ("p,q\ntrue,?\n\ntrue,no\n", "coins.csv:4: 'no' is not a value of q"),
        ('p\n"true\n', "not CSV"),
    ],
)
def test_bad_data(lcorpp, files, data, message):
    files[1].write_text(data)
    ended = lcorpp("fit", *files)
    assert ended.code == 2
    assert message in ended.err
    assert ended.out == ""


def test_an_interrupt_writes_nothing(lcorpp, files, tmp_path, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("lcorpp.fitting.numbers.climb", interrupt)
    ended = lcorpp("fit", *files, "-o", tmp_path / "new.plog")
    assert ended.code == 130
    assert "interrupted while fitting; nothing is written" in ended.err
    assert not (tmp_path / "new.plog").exists()


def test_bad_output(lcorpp, files, tmp_path):
    ended = lcorpp("fit", *files, "-o", tmp_path / "new.csv")
    assert ended.code == 2
    assert "ends with .plog" in ended.err


def test_the_numbers_of_a_bayesian_network(lcorpp, tmp_path):
    file, data = tmp_path / "coin.bif", tmp_path / "data.csv"
    file.write_text(
        "variable C { type discrete [2] { HEADS, TAILS }; } probability ( C ) { table 0.5, 0.5; }"
    )
    data.write_text("C\n" + "HEADS\n" * 3 + "TAILS\n")
    fitted = lcorpp("fit", file, data)
    assert fitted.code == 0, fitted.err
    assert "pr('C'='HEADS') = 0.75." in fitted.out
