"""Knowledge as tables in CSV and TOML: known answers, round trips, and mistakes named at their cells."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from lcorpp.errors import ParseError, ProgramError
from lcorpp.reasoning import (
    Enumeration,
    Reasoner,
    ReasoningWarning,
    parse_plog,
    program_text,
    read_plog,
    table_text,
    with_classifier,
)
from lcorpp.reasoning.language.networks.table_files import parse_tables
from lcorpp.values import ConfusionMatrix

PAPER = """\
# who comes, when and where
identity = student,identity = professor,identity = visitor
30 %,20 %,50 %

identity,time = morning,time = afternoon,time = evening
student,15,15,70
professor,80,10,rest
,10,70,20

identity,time,intention = interested,intention = not interested
student,,.3,.7
,evening,1/2,1/2
,,.8,.2
student,evening,0,1
"""

PAPER_TOML = """\
[identity]
values = ["student", "professor", "visitor"]
rows = [["30 %", "20 %", "50 %"]]

[time]
given = ["identity"]
values = ["morning", "afternoon", "evening"]
rows = [["student", 15, 15, 70], ["professor", 80, 10, "rest"], ["", 10, 70, 20]]

[intention]
given = ["identity", "time"]
values = ["interested", "not interested"]
rows = [
    ["student", "", 0.3, 0.7],
    ["", "evening", "1/2", "1/2"],
    ["", "", 0.8, 0.2],
    ["student", "evening", 0, 1],
]
"""


@pytest.mark.parametrize(("text", "file"), [(PAPER, "k.csv"), (PAPER_TOML, "k.toml")])
def test_tables_are_a_program(text: str, file: str):
    network = parse_tables(text, file=file)
    times = {"student": (15, 15, 70), "professor": (80, 10, 10), "visitor": (10, 70, 20)}
    expected = Fraction(0)
    for identity, share in (("student", 30), ("professor", 20), ("visitor", 50)):
        late = Fraction(times[identity][2], 100)
        early = Fraction(3, 10) if identity == "student" else Fraction(8, 10)
        evening = Fraction(0) if identity == "student" else Fraction(1, 2)
        expected += Fraction(share, 100) * (late * evening + (1 - late) * early)
    assert Reasoner(network).exact("intention")["interested"] == expected
    assert Enumeration(network).exact("intention")["interested"] == expected
    assert network.attributes["intention"].values == ("interested", "'not interested'")


def test_tables_of_a_spreadsheet_with_semicolons_and_decimal_commas():
    text = "\ufeffa = x; a = y;\n0,25; 0,75;;\n;;\na; b = yes; b = no\nx; 10,5 %; 89,5 %\ny; 100 %; 0\n"
    network = parse_tables(text, file="k.csv")
    assert Reasoner(network).exact("b")["yes"] == Fraction(1, 4) * Fraction(105, 1000) + Fraction(3, 4)


def test_columns_may_stand_in_any_order():
    text = "a = x,a = y\n1/4,rest\n\nb = no,a,b = yes\n.9,x,rest\n1,y,0\n"
    assert Reasoner(parse_tables(text)).exact("b")["yes"] == Fraction(1, 40)


def test_sums_that_rounding_explains_are_divided_and_named():
    with pytest.warns(ReasoningWarning, match="probabilities of a sum to 0.9999, not 1"):
        network = parse_tables("a = x,a = y,a = z\n33.33 %,33.33 %,33.33 %\n", file="k.csv")
    assert Reasoner(network).exact("a")["x"] == Fraction(1, 3)


def test_a_classifier_replaces_the_rates_of_a_table():
    text = PAPER + "\nintention,label = one,label = zero\ninterested,.6,.4\nnot interested,.5,.5\n"
    network = parse_tables(text)
    matrix = ConfusionMatrix(("interested", "'not interested'"), [[9, 1], [2, 8]])
    labels = {"interested": "one", "'not interested'": "zero"}
    changed = with_classifier(network, "label", "intention", matrix, labels)
    assert float(Reasoner(changed).exact("label", {"intention": "interested"})["one"]) > 0.8


# round trips


def make_random_text(seed: int) -> str:
    """Tables of random shapes; blank cells of parents stand for what more specific rows leave."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(2, 4, 4).tolist()
    lines = []
    for i, size in enumerate(sizes):
        parents = sorted(rng.choice(i, min(i, int(rng.integers(0, 3))), replace=False).tolist())
        lines.append(",".join([*[f"a{p}" for p in parents], *[f"a{i} = v{k}" for k in range(size)]]))
        given = list(product(*[[f"v{k}" for k in range(sizes[p])] for p in parents]))
        rows = [[*values, *draw_numbers(rng, size)] for values in given if rng.random() < 0.7 or not parents]
        if parents:
            rows.append([*[""] * len(parents), *draw_numbers(rng, size)])
        lines += [",".join(row) for row in rows] + [""]
    return "\n".join(lines)


def draw_numbers(rng: np.random.Generator, size: int) -> list[str]:
    cuts = np.sort(rng.integers(0, 101, size - 1)).tolist()
    return [str(b - a) for a, b in zip([0, *cuts], [*cuts, 100], strict=True)]


@pytest.mark.parametrize("seed", range(20))
def test_tables_plog_and_tables_again_are_the_same(seed: int):
    network = parse_tables(make_random_text(seed), file="k.csv")
    program = parse_plog(program_text(network))
    for form in ("csv", "toml"):
        again = parse_tables(table_text(program, form), file=f"k.{form}")
        assert table_text(again, form) == table_text(network, form)
        for name in network.attributes:
            assert (
                Reasoner(again).exact(name) == Reasoner(network).exact(name) == Reasoner(program).exact(name)
            )


def test_a_program_with_rules_becomes_tables():
    program = parse_plog(
        "s = {x, y, z}. a : s. random(a). pr(a=x) = 1/3. b : boolean. b :- a=x. -b :- not a=x."
        " c : s. c=x :- b. random(c : {V : k(V)}) :- -b. k : s -> boolean. k(x). k(z)."
    )
    with pytest.raises(ProgramError, match="k has arguments; the attribute of a table has none"):
        table_text(program)
    program = parse_plog(
        "s = {x, y, z}. a : s. random(a). pr(a=x) = 1/3. b : boolean. b :- a=x. -b :- not a=x."
        " c : s. c=x :- b. random(c) :- -b. pr(c=z | -b) = 1/2."
    )
    again = parse_tables(table_text(program))
    assert "b,c = x,c = y,c = z\ntrue,1,0,0\nfalse,0.25,0.25,0.5\n" in table_text(program)
    assert Reasoner(again).exact("?a, c") == Reasoner(program).exact("?a, c")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a : boolean. a :- not b. b : boolean. b :- not a.", "a, b depend on each other"),
        ("a : boolean. random(a). :- a.", "a constraint or an observation is no table"),
        ("a : boolean. random(a). b : boolean. b :- a.", "b has no value in some worlds"),
        ("a : boolean. random(a). a :+ .", "a program with cr-rules is no table"),
        ("a : boolean. a. -a.", "no possible world|no distribution"),
        ("a : boolean. random(a). pr(a) = 1. pr(a) = 0.", "may break a condition of P-log"),
    ],
)
def test_a_program_that_is_no_network_is_refused(text: str, message: str):
    with pytest.raises(ProgramError, match=message):
        table_text(parse_plog(text))


def test_names_that_csv_cannot_write():
    program = parse_plog("s = {'#x', y}. 'a=b' : s. random('a=b').")
    with pytest.raises(ProgramError, match="cannot be written in CSV, but in TOML"):
        table_text(program)
    with pytest.raises(ProgramError, match="x=1 cannot be written in CSV"):  # a row with it would be a head
        table_text(parse_plog("s = {'x=1', y}. a : s. random(a)."))
    again = parse_tables(table_text(program, "toml"), file="k.toml")
    assert again.attributes["a=b"].values == ("'#x'", "y")


def test_files_are_read_by_their_suffix(tmp_path):
    (tmp_path / "k.csv").write_text(PAPER)
    (tmp_path / "k.toml").write_text(PAPER_TOML)
    assert table_text(read_plog(tmp_path / "k.csv")) == table_text(read_plog(tmp_path / "k.toml"))


# mistakes

MISTAKES = [
    (
        "70\n",
        "73\n",
        "cell B6: the probabilities of time in this row sum to 103 %; expected 100 %, or 'rest'",
    ),
    ("student,15", "studnt,15", "cell A6: studnt is not a value of identity; expected one of student,"),
    ("professor,80", "student,80", "cell B7: a second row for identity=student; the first is row 6"),
    ("professor,80,10,", "professor,80,rest,", "cell D7: a second 'rest' in this row"),
    ("professor,80,10,", "professor,80,,", "cell C7: a blank cell; expected a probability such as 0.3,"),
    ("15,70", "15", "cell D6: a blank cell; expected a probability"),
    ("30 %", "30", "cell A3: 30 without %; other cells of this table have it"),
    ("15,70", "15,7o", "cell D6: '7o' is not a number; expected a probability such as 0.3, 30 % or 3/10"),
    ("15,70", "15,nan", "cell D6: 'nan' is not a number"),
    ("identity,time =", "identty,time =", "cell A5: identty has no table, nor is it 'attribute = value';"),
    ("time = afternoon", "tim = afternoon", "cell C5: a column of tim in the table of time, cell B5;"),
    ("time = afternoon", "time = morning", "cell C5: time has the value morning twice;"),
    ("time = afternoon", "time =", "cell C5: 'time =' is no head; expected a parent, or 'attribute = value'"),
    ("15,70", "15,70,3", "cell E6: a cell beyond the head, which has 4 columns"),
    ("# who", "1,2\n# who", "cell A1: '1' is in no table; expected a head with 'attribute = value'"),
    (",80,", ",-80,", "cell B7: -80 is negative; expected a probability"),
    (".3,.7", "3,.7", "cell C11: 3 is more than 1; expected a probability"),
    (
        "student,evening,0,1\n",
        "",
        "cell C12: this row and row 11 are both for identity=student",
    ),
    (",10,70,20\n", "", "cell B5: the table of time has no row for identity=visitor; expected one"),
    ("\nidentity,time,", "\ntime = x\n1\n\nidentity,time,", "cell A10: a second table of time; the first is"),
    ("identity,time,", "intention,time,", "cell A10: intention depends on itself"),
    (",80,", ',"80,', "cell B7: a quote that is not closed"),
]


TOML_MISTAKES = [
    ('["30 %"', '["1/0"', "[identity] row 1, cell 1: '1/0' is not a number"),
    ("given", "givn", "[time]: unknown key 'givn'; expected one of given, values, rows"),
    ("0.3, 0.7", "0.5, 0.7", "[intention] row 1, cell 3: the probabilities of intention in this row sum"),
    (
        '["professor", 80, 10, "rest"]',
        '["professor", 80, 10]',
        "[time] row 2: 3 cells; expected a list of 1 of",
    ),
    ("15, 15", "15, [15]", "[time] row 1, cell 3: [15] is no cell; expected a number or a text"),
    ("[time]", "[time", "Expected ']' at the end of a table declaration"),
    ('[["30 %", "20 %", "50 %"]]', "3", "[identity]: no list as rows; expected 'rows = [...]'"),
    ('values = ["student", "professor", "visitor"]\n', "", "[identity]: no values; expected 'values"),
    (
        '["student", "professor", "visitor"]',
        "[]",
        "[identity]: no values; expected a list of at least one",
    ),
    ("[identity]", "x = 3\n[identity]", "[x]: expected a table with values and rows"),
    ("15, 15", f"15, {'9' * 5000}", "k.toml: cannot be read: Exceeds the limit"),
]


@pytest.mark.parametrize(
    ("text", "file", "right", "wrong", "message"),
    [
        *[(PAPER, "k.csv", *mistake) for mistake in MISTAKES],
        *[(PAPER_TOML, "k.toml", *mistake) for mistake in TOML_MISTAKES],
    ],
)
def test_mistakes_are_named_at_their_cells(text: str, file: str, right: str, wrong: str, message: str):
    with pytest.raises((ParseError, ProgramError)) as found:
        parse_tables(text.replace(right, wrong, 1), file=file)
    assert getattr(found.value, "message", str(found.value)).startswith(message)


def test_cycles_and_empty_files():
    with pytest.raises(ProgramError, match="a depends on itself: a -> b -> a; expected no cycle"):
        parse_tables("b,a = x,a = y\n,.5,.5\n\na,b = x,b = y\n,.5,.5\n")
    with pytest.raises(ProgramError, match="no table; expected one such as"):
        parse_tables("# nothing\n")
    with pytest.raises(ParseError, match="the table of a has no row; expected one"):
        parse_tables("a = x,a = y\n")


@pytest.mark.parametrize("seed", range(5))
def test_injected_mistakes_never_change_an_answer_silently(seed: int):
    """Deleted and doubled rows, misspelt values, changed digits and swapped cells of 40 tables each."""
    rng, lines_named = np.random.default_rng(seed), []
    for n in range(40):
        text = make_random_text(1000 * seed + n)
        lines = text.split("\n")
        reference = {name: Reasoner(parse_tables(text)).exact(name) for name in parse_tables(text).attributes}
        rows = [i for i, line in enumerate(lines) if line and "=" not in line]
        i = int(rng.choice(rows))
        cells = lines[i].split(",")
        k = int(rng.integers(0, len(cells)))
        kind = int(rng.integers(0, 3))
        if kind == 0 and cells[k]:
            cells[k] = cells[k] + str(rng.choice(["x", "O", "3"]))
        elif kind == 1:
            cells.append("7")
        elif len(cells) > 1:
            cells.pop(k)
        mistaken = "\n".join([*lines[:i], ",".join(cells), *lines[i + 1 :]])
        if mistaken == text:
            continue
        try:
            found = parse_tables(mistaken, file="k.csv")
        except ParseError as error:
            lines_named.append(error.line - i - 1 if "no row" not in error.message else 0)
            continue
        assert {name: Reasoner(found).exact(name) for name in found.attributes} == reference
    assert set(lines_named) <= {0}
    assert len(lines_named) > 30


FOUND = [
    # a first table with one value selects no separator
    ("a = x\n1\n\nkind = b,kind = c\n20,80\n", "kind", {"b": 1 / 5}),
    # comments have any characters, also quotes
    ('a = x,a = y\n.5,.5\n\na,b = u,b = v\n,.1,.9\n# new, "since May\nx,.8,.2\n', "b", {"u": 9 / 20}),
    # fractions are never percent
    ("a = x,a = y,a = z\n1/3,1/3,1/3\n", "a", {"x": 1 / 3}),
    ("a = x,a = y,a = z\n40 %,1/5,rest\n", "a", {"y": 1 / 5}),
    ("b = u,b = v\n50,50\n\na = x,a = y,b\n60,40,u\n1/2,rest,v\n", "a", {"x": 11 / 20}),
    # spaces that look as others are others
    ("a = not so,a = so\n.4,.6\n\na,b = u,b = v\nnot so,1,0\n​so,0,1\n", "b", {"u": 2 / 5}),
    ("sep=;\na = x;a = y\n0,3;Rest\n", "a", {"x": 3 / 10}),
    ('"a = x;y",a = z\n.3,.7\n', "a", {"z": 7 / 10}),
]


@pytest.mark.parametrize(("text", "name", "expected"), FOUND, ids=range(len(FOUND)))
def test_what_people_write_is_understood(text, name, expected):
    found = Reasoner(parse_tables(text)).exact(name)
    assert {value: float(found[value]) for value in expected} == pytest.approx(expected)


NAMED = [
    (
        "a = x,a = y,a = z\n3,.22,rest\n",
        "cell A2: 3 is more than 1; expected a probability, or percent",
    ),
    ("a = x,a = y\nrest,9\n", "cell B2: 9 is more than 1"),
    ("b = u,b = v\n1,0\n\na = x,a = y,a = z,b\n80,10,10,u\nrest,0,1,v\n", "cell C6: 1 in a table of percent"),
    ("a = x,a = y\n.5,.5\n\na,b = u,b = v\n,.1,.9\n#N/A,.8,.2\n", "cell A6: #N/A is not a value of a"),
    ("a = x,a = y\n.5,50%\n", "cell A2: .5 without %; other cells of this table have it"),
    ("a = x,a = y\n.5,.5\n\na,b = u,b = v\nx,.1,.9\n\ny,.8,.2\n", "cell A7: 'y' is in no table"),
    ("a = x,a = y\n.5,,.5\n", "cell B2: a blank cell, and the row has 3 cells; the head has 2 columns"),
    ("a = x,a = y\n0,5,0,5\n", "cell A2: the row has 4 cells, the head 2 columns; is 0,5 one number?"),
    ("a = x,a = y\n.5,.5\n\na,b = u b = v\nx,.1,.9\ny,.8,.2\n", "cell B4: the head has 2 columns"),
    ("a = x,a = y\n.5,.5\n\nab = u,b = v,a\n.1,.9,x\n.8,.2,y\n\nb,c = s\n,1\n", "cell A4: a column of ab in"),
    ("a = x,a = y\n.5,.5\n\na,b = u,b = v\n.1,.9\n,.8,.2\n", "cell A5: .1 is not a value of a; expected"),
    ('a = x",a = y\n.5,.5\n', "cell A1: a quote inside of a cell"),
    ('a = "x,a = y\n.5,.5\n', "cell A1: a quote inside of a cell"),
    (
        "a = x,a = y\n.5,.5\n\na,b = u,b = v\nx,.1,.9\n",
        "cell B4: the table of b has no row for a=y; expected",
    ),
]


@pytest.mark.parametrize(("text", "message"), NAMED, ids=range(len(NAMED)))
def test_more_mistakes_are_named_at_their_cells(text, message):
    with pytest.raises(ParseError) as found:
        parse_tables(text, file="k.csv")
    assert found.value.message.startswith(message), found.value.message


def test_a_value_with_a_separator_is_written_and_read():
    program = parse_tables('"x = a;b","x = c\td"\n.25,.75\n')
    assert Reasoner(parse_tables(table_text(program))).exact("x") == Reasoner(program).exact("x")


TOML = """\
[a]
values = ["x", "y"]
rows = [[0.25, 0.75]]
[b]
given = ["a"]
values = ["u", "v"]
rows = [
    ["x", 0.1, 0.9],
    ["y", 0.8, "rest"],
]
"""

TOML_NAMED = [
    ('["x", 0.1', '["x, 0.1', 8, "[b] row 1, cell 1: a text without its closing quote"),
    ('"rest"', 'rest"', 9, "[b] row 2, cell 3: Invalid value"),
    ('["y", 0.8', '["y", 0.8"', 9, "[b] row 2, cell 2: a list without ',' or ']' here"),
    ('["u", "v"]', '["u, "v"]', 6, "[b] values, entry 1: a list without ',' or ']' here"),
    ("[b]\n", "", 5, "[a] values: a second time; is a head such as [weather] missing above?"),
    ("[a]\n", "", 1, "values: outside of a table; expected a head such as [weather] above"),
    (
        "[0.25, 0.75]",
        "[0.25]",
        1,
        "[a] row 1: 1 cells; expected a list of 0 of the parents and 2 probabilities",
    ),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), TOML_NAMED, ids=range(len(TOML_NAMED)))
def test_mistakes_in_toml_are_named_by_row_and_cell(old, new, line, message):
    assert Reasoner(parse_tables(TOML, file="k.toml")).exact("b")["u"] == Fraction(5, 8)
    with pytest.raises(ParseError) as found:
        parse_tables(TOML.replace(old, new, 1), file="k.toml")
    assert (found.value.line, found.value.message) == (line, message)


def test_of_two_units_the_one_is_named_without_which_the_row_is_whole():
    with pytest.raises(ParseError, match=r"cell A2: \.5% has %; other cells of this table have none"):
        parse_tables("a = x,a = y\n.5%,.5\n", file="k.csv")
    with pytest.raises(ParseError, match="cell B2: 60 without %; other cells of this table have it"):
        parse_tables("a = x,a = y\n40%,60\n", file="k.csv")
