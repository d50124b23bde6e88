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


PROBLOG = """\
% weather
t(_)::rain.
0.5::sprinkler.   % known
wet :- rain.
wet :- sprinkler.
t(0.2)::a(X) :- p(X).
p(1). p(2). p(3).
b :- a(1).
query(wet).
"""
PROBLOG_DATA = """\
rain,wet,a(1),a(2),a(3),b
true,true,true,false,true,true
true,true,true,true,true,
false,false,false,false,true,false
true,true,false,true,true,false
"""


def test_the_learnable_numbers_of_problog(lcorpp, tmp_path):
    """Rain in 3 of 4 records; a(1), a(2), a(3) have one number: 8 of 12."""
    program, records = tmp_path / "m.pl", tmp_path / "m.csv"
    program.write_text(PROBLOG)
    records.write_text(PROBLOG_DATA)
    ended = lcorpp("fit", program, records)
    assert ended.code == 0, ended.err
    assert ended.out == PROBLOG.replace("t(_)", "0.75").replace("t(0.2)", "0.666667")
    assert "line 6: pr(a(X)=true) = 0.666667; 95 % interval " in ended.err
    ended = lcorpp("fit", program, records, "-o", tmp_path / "fitted.pl")
    assert ended.code == 0, ended.err
    assert lcorpp("ask", tmp_path / "fitted.pl").out.splitlines()[-1].strip() == "0.875000"  # 1 - .25 * .5
    assert "ends with .pl\n" in lcorpp("fit", program, records, "-o", tmp_path / "fitted.plog").err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t(_)::a; 0.2::b.", "a learnable probability in a disjunction is not translated"),
        ("t(_)::a. 0.2::b.", "a learnable clause needs a line of its own"),
        ("t(1)::a.", "the search cannot begin from t(1)"),
        ("p(1). p(2). t(_)::a(Y) :- p(X), Y is X + 1.", "whose instances are computed is not translated"),
        ("t(_, X)::a(X) :- p(X). p(1).", "the learnable probability t(_"),
    ],
)
def test_what_is_not_learnt_of_problog(lcorpp, tmp_path, text, words):
    program, records = tmp_path / "m.pl", tmp_path / "m.csv"
    program.write_text(text)
    records.write_text("a\ntrue\n")
    ended = lcorpp("fit", program, records)
    assert (ended.code, words in " ".join(ended.err.split())) == (2, True), ended.err
