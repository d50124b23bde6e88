"""pomdp-solve's grammar beyond the published models, and the dialects of other tools."""

from __future__ import annotations

import logging
import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import FileError, ParseError
from lcorpp.planning import parse_pomdp, read_pomdp, solve
from lcorpp.planning.formats import alpha_file, policy_xml
from lcorpp.planning.formats.pomdp import _scanner, reader, scanner
from lcorpp.planning.formats.pomdpx import reader as pomdpx_reader
from tests.planning.formats.pomdp import python_scanner
from tests.planning.formats.pomdp.texts import BODY, HEAD, same
from tests.planning.models import SHARED, TIGER, pomdps

MDP = """\
discount: 0.5
values: reward
states: a b
actions: x y
start: b
T: * uniform
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("* -1\n", "* - 1\n"),
        ("* -1\n", "*- 1\n"),
        ("* -1\n", "* : -\n  # sign\n1\n"),
        ("* 10\n", "* + 10\n"),
        ("* -100\n", "* - 1e2\n"),
        ("0.85 0.15", "+ 0.85 + .15"),
        ("0.95", "+ 0.95"),
        ("values: reward", "values: rewards"),
    ],
)
def test_other_ways_to_write_the_tiger(old, new):
    assert old in TIGER
    assert same(parse_pomdp(TIGER.replace(old, new)), parse_pomdp(TIGER))


def test_signs_in_rows_and_matrices():
    text = HEAD + BODY + "R: x : a : b - 1 + 2\nR: y : a\n- 1 2\n3 -\n4\nT: x : a - 0 + 1\n"
    joined = HEAD + BODY + "R: x : a : b -1 2\nR: y : a\n-1 2\n3 -4\nT: x : a 0 1\n"
    assert same(parse_pomdp(text), parse_pomdp(joined))


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        (HEAD + BODY + "R: x : a : b : * - - 5", (8, 18), "reward needs a number, found 0 and then '-'"),
        (HEAD + BODY + "R: x : a : b : * -", (8, 18), "reward needs a number, found 0 and then '-'"),
        (HEAD + BODY + "T: x : a 1 0\nT: x\n1 0 + 0.5 - 1.5", (10, 11), "negative probability -1.5"),
        (HEAD + BODY + "R: x : a : b : * 5 - 6", (8, 20), "too many numbers: - is left over"),
        (HEAD.replace("0.9", "- 0.5") + BODY, (1, 11), "discount -0.5 is not between 0 and 1"),
        (MDP + "O: * uniform", (7, 1), "O needs observations, which the preamble does not declare"),
        (MDP + "T: x : a 1 0\nO: x : a : none 1", (8, 17), "O needs observations"),
        (MDP + "R: x : a : b : c 1", (7, 16), "unknown observation 'c'"),
        (MDP + "R: x 1 2 3", (7, 11), "reward matrix of 2 rows needs 4 numbers, found 3"),
        (MDP + "costs: 1 1", (7, 1), "'costs' must come before the first T, O or R"),
        (MDP.replace("start: b", "costs: 1"), (5, 8), "costs needs a number for each of 2 actions, found 1"),
        (MDP.replace("start: b", "init_state: c"), (5, 13), "unknown state 'c'; expected one of a, b"),
        ("states: a b\nobservations: u v\natom 0: a\n", (3, 1), "'atom N:' is a statement of pomdps-reveal"),
        (MDP + "prio 1 : a b\n", (7, 1), "'prio N:' is a statement of pomdps-reveal"),
        ("states: 2\nactions: 2\nT: * uniform", (3, 1), "missing preamble: discount, values"),
        ("agents: 2\n", (1, 1), "'agents:' begins a model for several agents (MADP's .dpomdp)"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_named(text, place, message):
    with pytest.raises(ParseError) as caught:
        parse_pomdp(text, file="x.pomdp")
    assert (caught.value.line, caught.value.column) == place
    assert message in str(caught.value)


def test_a_model_without_observations_has_a_single_one():
    declared = MDP.replace("start", "observations: none\nstart") + "O: * uniform\n"
    pairs = [
        ("R: x : a : b 5\n", "R: x : a : b : * 5\n"),
        ("R: * : * : * -1\nR: x : b : * : * 2\n", "R: * : * : * : * -1\nR: x : b : * : * 2\n"),
        ("R: x : a 1 - 2\n", "R: x : a\n1\n-2\n"),
        ("R: x\n1 2\n3 4\nR: * : b : b 7", "R: x : a : a 1\nR: x : a : b 2\nR: x : b : a 3\nR: * : b : b 7"),
        ("R: x : a : b 5\nR: x uniform\n", None),
    ]
    for own, full in pairs:
        if full is None:
            with pytest.raises(ParseError, match="reward matrix of 2 rows needs 4 numbers"):
                parse_pomdp(MDP + own)
            continue
        mdp = parse_pomdp(MDP + own)
        assert same(mdp, parse_pomdp(declared + full))
        assert mdp.observations == ("none",)
    assert solve(parse_pomdp(MDP + "R: y : * : * 3")).lower == pytest.approx(6)


def test_the_keys_of_pypomdp_are_ignored_with_a_warning(caplog):
    text = MDP.replace("actions: x y\n", "actions: x y\ncosts: 1 0.25\ninit_state: a\n") + "R: x : a : b 5\n"
    with caplog.at_level(logging.WARNING):
        pomdp = parse_pomdp(text, file="x.pomdp")
    assert same(pomdp, parse_pomdp(MDP + "R: x : a : b 5\n"))
    assert pomdp.start.tolist() == [0, 1]
    assert [record.getMessage().split(" ", 1)[0] for record in caplog.records] == [
        "x.pomdp:5:8:",
        "x.pomdp:6:13:",
    ]


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_comments_may_have_bytes_of_another_encoding(tmp_path, line_end):
    path = tmp_path / "x.pomdp"
    text = TIGER.replace("values", "# Zürich\nvalues").replace("\n", line_end)
    path.write_bytes(text.encode("latin-1"))
    assert same(read_pomdp(path), parse_pomdp(TIGER))
    path.write_bytes(text.replace("0.85 0.15", "0.85 x # é").encode("latin-1"))
    with pytest.raises(ParseError, match="found 1 and then 'x'"):
        read_pomdp(path)
    path.write_bytes(text.replace("tiger-left", "tiger-é").encode("latin-1"))
    with pytest.raises(FileError, match=r"x\.pomdp:\d+: not UTF-8 text: byte 0xe9, 'é' in Latin-1"):
        read_pomdp(path)


@st.composite
def written_models(draw):
    """Draw a model and a text for it, in which signs, spaces, comments and kinds of statements vary."""
    pomdp = draw(pomdps(discounts=(0.0, 0.5)))
    is_mdp = len(pomdp.observations) == 1 and draw(st.booleans())

    def join(*words):
        spaces = st.sampled_from([" ", "\t", "\n", " # + 5 T:\n", " "])
        return "".join(word + draw(spaces) for word in words)

    def write(number):
        sign = (
            draw(st.sampled_from(["-", "- ", "-\n"]))
            if number < 0
            else draw(st.sampled_from(["", "+ ", "+"]))
        )
        return sign + repr(abs(number))

    lines = [
        join("discount", ":", write(pomdp.discount)),
        join("values:", draw(st.sampled_from(["cost", "costs"]))),
    ]
    kinds = {"states": pomdp.states, "actions": pomdp.actions, "observations": pomdp.observations}
    lines += [
        join(f"{kind}:", *names) for kind, names in kinds.items() if not (is_mdp and kind == "observations")
    ]
    lines = [*draw(st.permutations(lines)), join("start:", *map(write, pomdp.start.tolist()))]
    tables = [("T", pomdp.transition.dense)] + [("O", pomdp.observation.dense)] * (not is_mdp)
    for keyword, table in tables:
        for a, matrix in enumerate(table.tolist()):
            if draw(st.booleans()):
                lines.append(join(f"{keyword}:", f"a{a}", *(write(p) for row in matrix for p in row)))
                continue
            lines += [
                join(f"{keyword}", ":", f"a{a}", ":", str(s), *map(write, row))
                for s, row in enumerate(matrix)
            ]
    for a, rewards in enumerate(pomdp.reward.tolist()):
        for s, number in enumerate(rewards):
            more = [":", "*"] * (1 if is_mdp else 2)
            lines.append(join("R", ":", f"a{a}", ":", f"s{s}", *more, write(-number)))
    return pomdp, "\n".join(lines), is_mdp


@given(written_models())
@settings(max_examples=12)
def test_both_scanners_read_what_was_written(written):
    pomdp, text, is_mdp = written
    found = []
    for implementation in (python_scanner, _scanner):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(scanner, "_scanner", implementation)
            found.append(parse_pomdp(text))
    assert found[0].fingerprint == found[1].fingerprint
    for name in ("states", "actions", "discount") + ("observations",) * (not is_mdp):
        assert getattr(found[0], name) == getattr(pomdp, name)
    assert np.array_equal(found[0].reward, pomdp.reward)
    assert np.array_equal(np.asarray(found[0].transition), np.asarray(pomdp.transition))


@pytest.mark.parametrize(
    ("module", "name", "read"),
    [
        (reader, "map_text", lambda path: read_pomdp(path)),
        (pomdpx_reader, "read_bytes", lambda path: pomdpx_reader.read_factored(path)),
        (policy_xml, "read_bytes", lambda path: policy_xml.read_policy(path, parse_pomdp(TIGER))),
        (alpha_file, "read_text", lambda path: alpha_file.read_alphas(path, parse_pomdp(TIGER))),
    ],
)
def test_a_full_memory_is_an_error_of_the_file(monkeypatch, module, name, read):
    def fail(*_, **__):
        raise MemoryError

    monkeypatch.setattr(module, name, fail)
    with pytest.raises(FileError, match=re.escape("x.pomdp: the memory is full")) as caught:
        read("x.pomdp")
    assert caught.value.__context__.__traceback__ is None  # it would keep the arrays


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("11_discount_zero", 4.0),
        ("12_sign_space", -25.0),
        ("13_latin1_comment", 25.0),
        ("14_mdp_without_observations", 50.0),
    ],
)
def test_cases_from_the_field(name, value):
    path = SHARED.parent / "cases" / "pomdp" / f"{name}.pomdp"
    if not path.exists():
        pytest.skip(f"the case {name} is not beside this checkout")
    assert solve(read_pomdp(path)).lower == pytest.approx(value)
