"""`lcorpp ask`: answers, fractions, error bars and reasons."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PLOG = Path(__file__).parents[1] / "plog"
EVIDENCE = "obs(time=afternoon), obs(location=classroom), obs(classifier=zero)"

COIN = """\
p, q : boolean.
random(p).
random(q) :- p.
q=false :- p=false.
pr(q | p) = 3/4.
? q | obs(p).
"""


@pytest.fixture
def coin(tmp_path):
    file = tmp_path / "coin.plog"
    file.write_text(COIN)
    return file


def test_why_prints_the_parts_of_an_answer(lcorpp, coin):
    ended = lcorpp("ask", coin, "?{q} | obs(p)", "--why", "--exact")
    assert ended.code == 0, ended.err
    assert [line.rstrip() for line in ended.out.splitlines() if line.strip()] == [
        "?{q=true} | obs(p=true).",
        "  3/4",
        "  without obs(p=true):",
        "  3/8",
        "  world 1, probability 3/4:",
        "  p=true, q=true",
        "    line 2    p is random, here true       random(p).",
        "    line 3    q is random, here true       random(q) :- p=true.",
        "    line 5    q=true with probability 3/4  pr(q=true | p=true) = 3/4.",
        "  world 2, probability 1/4:",
        "  p=true, q=false",
        "    line 2    p is random, here true                   random(p).",
        "    line 3    q is random, here false                  random(q) :- p=true.",
        "    line 5    q=true with probability 3/4, here false  pr(q=true | p=true) = 3/4.",
    ]


def test_why_of_the_paper(lcorpp):
    ended = lcorpp("ask", PLOG / "lcorpp.plog", f"intention=interested | {EVIDENCE}", "--why")
    assert ended.code == 0
    assert "0.220250" in ended.out
    assert "without obs(time=afternoon):" in ended.out
    assert ended.out.count("world ") == 3


def test_why_an_impossible_question_says_what_can_be_left_out(lcorpp, coin):
    ended = lcorpp("ask", coin, "?{q} | obs(p=false), obs(q)", "--why")
    assert ended.code == 2
    assert "without obs(p=false):\n  1.000000" in ended.out
    assert "no possible world of positive measure has the evidence" in ended.err
    assert "Traceback" not in ended.err


def test_impossible_without_why(lcorpp, coin):
    ended = lcorpp("ask", coin, "?{q} | obs(p=false), obs(q)")
    assert ended.code == 2
    assert "no possible world of positive measure has obs(p=false), obs(q=true)" in ended.err


def test_cr_rules(lcorpp):
    ended = lcorpp("ask", PLOG / "heart.plog", "?{active} | obs(slow)", "--exact", "--why")
    assert ended.code == 0
    assert "  40/43\n" in ended.out
    assert "world 1" not in ended.out


@pytest.mark.parametrize("query", ["intention", "?{intention=interested}"])
def test_a_program_too_large_to_compile_is_estimated_with_a_warning(lcorpp, monkeypatch, query):
    monkeypatch.setattr("lcorpp.reasoning.diagram.decision_diagram.build_decision_diagram.__defaults__", (1,))
    ended = lcorpp("ask", PLOG / "lcorpp.plog", query)
    assert ended.code == 0
    assert "MiB of arcs in the decision diagram: estimated from 20000 worlds drawn at random" in ended.err
    assert "effective sample size 20000" in ended.err
    line = next(line for line in ended.out.splitlines() if "[" in line)
    estimate, low, high = (float(number) for number in re.findall(r"0\.\d{6}", line))
    assert low < estimate < high < low + 0.02
    assert abs(estimate - 0.4) < 0.02
    other = lcorpp("ask", PLOG / "lcorpp.plog", query, "--samples", "500", "--seed", "3")
    assert "estimated from 500 worlds drawn at random, effective sample size 500" in other.err
    assert other.out != lcorpp("ask", PLOG / "lcorpp.plog", query, "--samples", "500", "--seed", "4").out
    for option in ("--exact", "--why"):
        ended = lcorpp("ask", PLOG / "lcorpp.plog", query, option)
        assert ended.code == 2
        assert "MiB of arcs in the decision diagram" in ended.err
        ended = lcorpp("ask", PLOG / "lcorpp.plog", query, option, "--samples", "500")
        assert ended.code == 2
        assert f"--samples 500: {option} has exact answers only" in ended.err
    ended = lcorpp("ask", PLOG / "lcorpp.plog", query, "--samples", "-5")
    assert ended.code == 2
    assert "--samples" in ended.err


def test_a_condition_that_is_broken(lcorpp, coin):
    coin.write_text(COIN + "pr(q) = 1/2.\n")
    ended = lcorpp("ask", coin)
    assert ended.code == 2
    assert (
        f"{coin}:7:1: Condition 2: q=true also has a pr-atom at {coin}:5:1, in the world {{p=true"
        in ended.err
    )


def test_joint_distributions_are_tables(lcorpp, coin):
    ended = lcorpp("ask", coin, "p, q", "--exact")
    assert ended.code == 0, ended.err
    assert [line.split() for line in ended.out.splitlines()] == [
        ["?p,", "q."],
        ["p", "q"],
        ["true", "true", "3/8", "███████████▎"],
        ["true", "false", "1/8", "███▊"],
        ["false", "true", "0"],
        ["false", "false", "1/2", "███████████████"],
    ]


def test_the_best_values_and_worlds(lcorpp, coin):
    ended = lcorpp("ask", coin, "p, q", "--exact", "--best", "2", "--worlds", "1")
    assert ended.code == 0, ended.err
    lines = [line.split() for line in ended.out.splitlines() if line.strip()]
    assert [line[:3] for line in lines[2:4]] == [["false", "false", "1/2"], ["true", "true", "3/8"]]
    assert lines[4:] == [["world", "1,", "probability", "1/2:"], ["p=false,", "q=false"]]
    ended = lcorpp("ask", coin, "?{p}", "--best", "2")
    assert ended.code == 2
    assert "--best 2: ?{p=true}. asks for a number, not for values" in ended.err


def test_answers_and_worlds_as_json(lcorpp, coin):
    ended = lcorpp("ask", coin, "p, q | obs(p or q)", "--exact", "--json", "--worlds", "5")
    assert ended.code == 0, ended.err
    assert json.loads(ended.out) == {
        "query": "?p, q | obs(p=true or q=true).",
        "answer": [
            {"values": {"p": p, "q": q}, "probability": number}
            for p, q, number in [("true", "true", "3/4"), ("true", "false", "1/4"),
                                 ("false", "true", "0"), ("false", "false", "0")]
        ],
        "worlds": [
            {"probability": "3/4", "values": {"p": "true", "q": "true"}},
            {"probability": "1/4", "values": {"p": "true", "q": "false"}},
        ],
    }  # fmt: skip
    (record,) = map(json.loads, lcorpp("ask", coin, "--json", "--why").out.splitlines())
    assert record["answer"][0] == {"values": {"q": "true"}, "probability": 0.75}
    assert record["without"] == [
        {"condition": "obs(p=true)", "answer": [{"values": {"q": "true"}, "probability": 0.375},
                                                {"values": {"q": "false"}, "probability": 0.625}]}
    ]  # fmt: skip
    assert record["worlds"][0]["rules"][0] == {
        "line": 2, "effect": "p is random, here true", "statement": "random(p).",
    }  # fmt: skip


def test_worlds_of_a_program_without_queries(lcorpp, coin):
    coin.write_text(COIN.replace("? q | obs(p).", ""))
    ended = lcorpp("ask", coin, "--worlds", "9", "--json")
    assert ended.code == 0, ended.err
    worlds = json.loads(ended.out)["worlds"]
    assert [world["probability"] for world in worlds] == [0.5, 0.375, 0.125]
    assert lcorpp("ask", coin, "--worlds", "9").out.startswith(
        "\n  world 1, probability 0.500000:\n  p=false"
    )
    coin.write_text("p : boolean. random(p). :- p. :- -p.")
    ended = lcorpp("ask", coin, "--worlds", "9")
    assert ended.code == 2
    assert "no possible world" in ended.err


def test_expectations(lcorpp, tmp_path):
    file = tmp_path / "die.plog"
    file.write_text("score = {1..6}. roll : score. random(roll). pr(roll=6) = 1/4.")
    assert lcorpp("ask", file, "E[2*roll - 1] | obs(roll > 1)", "--exact").out.splitlines()[1] == "  127/17"
    assert lcorpp("ask", file, "{roll=1 or roll=6}").out.splitlines()[1] == "  0.400000"


def test_estimates_as_json(lcorpp, coin, monkeypatch):
    monkeypatch.setattr("lcorpp.reasoning.diagram.decision_diagram.build_decision_diagram.__defaults__", (1,))
    answer = json.loads(lcorpp("ask", coin, "{p}", "--json").out)["answer"]
    assert answer["low"] < 0.5 < answer["high"]
    assert answer["low"] < answer["estimate"] < answer["high"]


def test_ask_without_options_loads_only_what_it_needs(coin):
    code = (
        "import sys; from lcorpp.cli.main import main; sys.argv = ['lcorpp', 'ask', sys.argv[1]]; main();"
        "print(*sorted({'typer', 'rich', 'numpy', 'clingo', 'pathlib', 'tempfile'} & set(sys.modules)))"
    )
    # coverage imports modules, too
    alone = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE")}
    command = [sys.executable, "-c", code, coin]
    ended = subprocess.run(command, capture_output=True, text=True, check=True, env=alone)
    assert (
        ended.stdout
        == "?q | obs(p=true).\n  true   0.750000  ██████████████████████▌\n  false  0.250000  ███████▌\n\n"
    )


def test_a_reader_that_ends_early_is_no_error(coin):
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-c", "from lcorpp.cli.main import main; main()", "ask", coin]
    ended = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert (ended.returncode, ended.stderr) == (1, "")


def test_an_interrupt_of_the_sampling_follows_the_message_that_it_begins(lcorpp, monkeypatch):
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("lcorpp.reasoning.diagram.decision_diagram.build_decision_diagram.__defaults__", (1,))
    monkeypatch.setattr("lcorpp.reasoning.estimation.sample_worlds", interrupt)
    ended = lcorpp("ask", PLOG / "lcorpp.plog", "intention")
    assert ended.code == 130
    first, second = ended.err.splitlines()
    assert first.endswith("?intention. will be estimated from 20000 or more worlds drawn at random")
    assert second == "lcorpp: interrupted; this query and those after it have no answer"


def test_a_problog_file_is_read_checked_and_translated(lcorpp, tmp_path):
    file = tmp_path / "coins.pl"
    file.write_text("0.5::heads(1). 0.6::heads(2).\ntwo :- heads(1), heads(2).\nquery(two).\n")
    assert lcorpp("ask", file, "--exact").out == "two\n  3/10\n"
    assert lcorpp("check", file).out.endswith(": 2 attributes, 4 possible worlds: OK\n")
    shown = lcorpp("translate", file)
    assert "pr(heads(2)=true) = 3/5.\ntwo=true :- heads(1)=true, heads(2)=true.\n" in shown.out
    assert lcorpp("translate", file, "-o", tmp_path / "coins.plog").code == 0
    assert (tmp_path / "coins.plog").read_text() == shown.out
    assert lcorpp("ask", tmp_path / "coins.plog", "--exact").out == "?{two=true}.\n  3/10\n"
    file.write_text("0.5::heads(1) :- !.\n")
    ended = lcorpp("translate", file)
    assert ended.code == 2
    assert f"{file}:1:18: this is a ProbLog program: a cut (!) is not translated" in ended.err


def test_a_query_of_problog_is_shown_as_it_is_written(lcorpp, tmp_path):
    file = tmp_path / "do.pl"
    file.write_text("0.4::do. 0.5::random(2.5) :- do.\nquery(do). query(random(X)).\n")
    assert lcorpp("ask", file).out == "do\n  0.400000\nrandom(2.5)\n  0.200000\n"
    assert '"query": "do"' in lcorpp("ask", file, "--json").out


def test_a_rounded_sum_is_named_once(lcorpp, tmp_path):
    file = tmp_path / "die.plog"
    numbers = " ".join(f"pr(die(X)={i}) = 0.16667." for i in range(1, 7))
    file.write_text(f"n = {{1..6}}.\ndie : n -> n.\nrandom(die(X)).\n{numbers}\n?{{die(1)=1}}. ?die(2).\n")
    ended = lcorpp("ask", file, "--exact")
    assert ended.out.count("1/6") == 7
    words = "the probabilities of die sum to 1.00002, not 1, and are divided by their sum"
    assert ended.err == f"lcorpp: {file}:4:1: {words}\n"


def test_the_log_names_the_program_s_terms_only(lcorpp, caplog, tmp_path):
    file = tmp_path / "even.plog"
    file.write_text("p, q : boolean.\np :- not q.\nq :- not p.\n?{p}.\n")
    ended = lcorpp("ask", file)
    assert ended.out == "?{p=true}.\n  0.500000\n"
    assert f"{file}: p, q depend on each other: clingo enumerates their values" in caplog.text


def test_worlds_of_a_problog_program_have_its_names(lcorpp, tmp_path):
    file = tmp_path / "program.pl"
    file.write_text("0.4::do.\n0.9::a(1.5); 0.1::'B c' :- do.\nquery(a(X)).\n")
    ended = lcorpp("ask", file, "--worlds", "2", "--exact")
    assert ended.code == 0, ended.err
    assert ended.out.split("\n\n")[1:] == [
        "  world 1, probability 27/50:\n  do=false",
        "  world 2, probability 9/25:\n  a(1.5)=true, do=true\n",
    ]
    ended = lcorpp("ask", file, "--why")
    assert ended.code == 0, ended.err
    assert "'" not in ended.out
    assert "[choice 2:1]=1 with probability 9/10" in ended.out


@pytest.mark.parametrize("name", ["\\e[31mred", "\x1b[31mred\x1b[2J"], ids=["escape code", "raw escape"])
def test_escape_codes_in_quoted_names_do_not_reach_the_terminal(lcorpp, tmp_path, name):
    file = tmp_path / "program.pl"
    file.write_text(f"0.5::'{name}'('{name}').\nb :- '{name}'(X).\nquery('{name}'(X)).\nquery(b).\n")
    for options in ([], ["--worlds", "2"], ["--why"], ["--json", "--worlds", "1"]):
        ended = lcorpp("ask", file, *options)
        assert ended.code == 0, ended.err
        assert "\x1b" not in ended.out + ended.err
        assert "[31mred" in ended.out
    assert "\x1b" not in lcorpp("translate", file).out
    file.write_text(f"0.5::a.\nb :- '{name}'(a), a.\nquery(b).\n")
    ended = lcorpp("ask", file)
    assert ended.code == 2
    assert "\x1b" not in ended.out + ended.err


NETWORK = """network alarm { }
variable HISTORY { type discrete [ 2 ] { TRUE, FALSE }; }
variable "Blood pressure" { type discrete [ 3 ] { LOW, 12+, HIGH }; }
probability ( HISTORY ) { table 0.1, 0.9; }
probability ( "Blood pressure" | HISTORY ) { (TRUE) 0.8, 0.1, 0.1; (FALSE) 0.3333, 0.3333, 0.3333; }
"""


def test_a_bayesian_network_is_read_checked_and_translated(lcorpp, tmp_path):
    file, question = tmp_path / "alarm.bif", "HISTORY | obs('Blood pressure'='12+')"
    file.write_text(NETWORK)
    answered = lcorpp("ask", file, question, "--exact")
    assert answered.out.splitlines()[1].startswith("  TRUE   1/31")
    assert "alarm.bif:5:1: the probabilities of 'Blood pressure' sum to 0.9999, not 1" in answered.err
    table = lcorpp("ask", file, "HISTORY, 'Blood pressure'").out.splitlines()
    assert table[1].split() == ["HISTORY", "'Blood", "pressure'"]
    assert "2 variables, 8 numbers; an answer for all sums a table of" in " ".join(
        lcorpp("check", file).out.split()
    )
    translated = lcorpp("translate", file).out
    assert "pr('Blood pressure'='12+' | 'HISTORY'='TRUE') = 1/10." in translated
    again = tmp_path / "alarm.plog"
    again.write_text(translated)
    assert lcorpp("ask", again, question, "--exact").out == answered.out
    file.write_text(NETWORK.replace("0.3333, 0.3333, 0.3333", "0.3, 0.3, 0.3"))
    ended = lcorpp("check", file)
    assert ended.code == 2
    assert "alarm.bif:5:68: the probabilities of 'Blood pressure' sum to 0.9; expected 1" in ended.err


def test_a_markov_logic_network_is_asked_with_evidence(lcorpp, tmp_path):
    network, evidence = tmp_path / "s.mln", tmp_path / "e.db"
    network.write_text(
        "Smokes(person)\nFriends(person, person)\n1.1 Friends(x, y) ^ Smokes(x) => Smokes(y)\n"
    )
    evidence.write_text("Smokes(Anna)\nFriends(Anna, Bob)\n")
    ended = lcorpp("ask", network, "Smokes(Bob)", "--evidence", evidence)
    assert ended.code == 0, ended.err
    assert "?'Smokes'('Bob') | obs('Smokes'('Anna')=true), obs('Friends'('Anna','Bob')=true)." in ended.out
    refused = lcorpp("ask", network, "Smokes(Bob)")
    assert refused.code == 2
    assert "s.mln:2:1: the domain person has no constant" in refused.err
    evidence.write_text("Smokes(Anna)\nDrinks(Anna)\n")
    refused = lcorpp("ask", network, "Smokes(Bob)", "--evidence", evidence)
    assert refused.code == 2
    assert f"{evidence}:2:1: Drinks is not declared" in refused.err
    (tmp_path / "c.plog").write_text("a : boolean. random(a).")
    refused = lcorpp("ask", tmp_path / "c.plog", "a", "--evidence", evidence)
    assert refused.code == 2
    assert "has its evidence in queries; expected a .mln, .plp or .lp file" in " ".join(refused.err.split())


def test_best_decisions_and_bounds(lcorpp, tmp_path):
    file = tmp_path / "walk.pl"
    file.write_text("0.4::sun. ?::walk. fun :- sun, walk. utility(fun, 5). utility(walk, -1).")
    assert lcorpp("ask", file).out == (
        "best decisions: walk\n  expected utility 1\n  the next best, none, has 1 less\n"
    )
    record = json.loads(lcorpp("ask", file, "--json").out)
    assert record == {"decisions": {"walk": True}, "utility": 1.0, "difference": 1.0, "next": {"walk": False}}
    assert "a program with decisions has no query" in lcorpp("ask", file, "fun").err
    assert "--exact: " in lcorpp("ask", file, "--exact").err
    birds = tmp_path / "birds.lp"
    birds.write_text("0.4::bird. {fly} :- bird.")
    assert lcorpp("ask", birds, "fly").out == "?{fly=true}.\n  lower 0.000000, upper 0.400000\n"
    assert lcorpp("ask", birds, "fly | obs(bird)").out.endswith("lower 0.000000, upper 1.000000\n")
    record = json.loads(lcorpp("ask", birds, "fly", "--json").out)
    assert record == {"query": "?{fly=true}.", "lower": 0.0, "upper": 0.4, "inconsistent": 0.0}
    ended = lcorpp("ask", birds, "fly", "--worlds", 2)
    assert (ended.code, "has lower and upper probabilities" in " ".join(ended.err.split())) == (2, True)
    ended = lcorpp("ask", birds)
    assert (ended.code, "has no query of its own" in ended.err) == (2, True)
    file.write_text("1/2^2::a(X) :- b(X), not c.")  # an error of ProbLog stays one
    assert "this is a ProbLog program: unexpected '^'" in lcorpp("ask", file, "a(1)").err
