"""Markov logic networks: their measure by definition, known answers, and errors with their places."""

from __future__ import annotations

from math import exp

import pytest
from tests.reasoning.language.markov import list_worlds, make_random_text

from lcorpp.errors import ParseError, UndefinedError
from lcorpp.reasoning import Enumeration, Reasoner, parse_query, read_plog
from lcorpp.reasoning.language.parser import parse_mln
from lcorpp.reasoning.language.translation.mln_reader import read_mln

SMOKERS = """\
// friends smoke alike
person = {Anna, Bob}
Smokes(person)
Cancer(person)
Friends(person, person)
1.5 Smokes(x) => Cancer(x)
1.1 Friends(x, y) => (Smokes(x) <=> Smokes(y))
"""


def check(text: str) -> None:
    """Compare the marginals of all atoms with the sums over all worlds."""
    network, (program, _) = read_mln(text, "t.mln"), parse_mln(text)
    worlds = list(list_worlds(network))
    total = sum(measure for _, measure in worlds)
    if not total:
        with pytest.raises(UndefinedError):
            Reasoner(program).posteriors(evidence={})
        return
    found = Reasoner(program).posteriors(evidence={})
    for name, values in worlds[0][0]:
        expected = sum(measure for world, measure in worlds if world[name, values]) / total
        if network.predicates[name].is_exclusive:
            *values, value = values
        else:
            value = "true"
        term = f"{name}({','.join(values)})" if values else name
        assert found[term][value] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(60))
def test_random_networks_equal_the_sums_over_all_worlds(seed: int):
    check(make_random_text(seed))


@pytest.mark.slow
def test_two_thousand_random_networks():
    for seed in range(1000, 3000):
        check(make_random_text(seed))


def test_the_ratio_of_two_worlds_is_e_to_the_weight():
    program, _ = parse_mln("thing = {A}\nP(thing)\n1.5 P(x)\n")
    assert Reasoner(program).posterior("P(A)")["true"] == pytest.approx(exp(1.5) / (1 + exp(1.5)), rel=1e-12)
    program, _ = parse_mln("thing = {A}\nP(thing)\n-600 P(x)\nlog(3) !P(x)\n")
    assert Reasoner(program).posterior("P(A)")["true"] == pytest.approx(exp(-600) / 3, rel=1e-9)


def test_a_star_stands_for_both_signs():
    program, _ = parse_mln(SMOKERS + "0.7 *Smokes(x) <=> Cancer(x)\n")
    both, _ = parse_mln(SMOKERS + "0.7 Smokes(x) <=> Cancer(x)\n0.7 !Smokes(x) <=> Cancer(x)\n")
    none, _ = parse_mln(SMOKERS)
    for term in ("Smokes(Anna)", "Cancer(Bob)"):
        found = Reasoner(program).posterior(term)["true"]
        assert found == pytest.approx(Reasoner(both).posterior(term)["true"], rel=1e-12)
        assert found == pytest.approx(Reasoner(none).posterior(term)["true"], rel=1e-12)  # one of both holds


def test_evidence_of_a_file():
    text = SMOKERS.replace("person = {Anna, Bob}\n", "")
    facts = "Smokes(Anna)\n!Smokes(Zoe)  // not she\nFriends(Anna, Bob)\n"
    program, observed = parse_mln(text, facts=facts)
    assert observed == ["obs('Smokes'('Anna'))", "obs(-'Smokes'('Zoe'))", "obs('Friends'('Anna', 'Bob'))"]
    query = parse_query(f"Cancer(Bob) | {', '.join(observed)}", program)
    network = read_mln("person = {Anna, Bob, Zoe}\n" + text, "t.mln")
    sums = [0.0, 0.0]
    for world, measure in list_worlds(network):
        known = [world["Smokes", ("Anna",)], not world["Smokes", ("Zoe",)], world["Friends", ("Anna", "Bob")]]
        sums[world["Cancer", ("Bob",)]] += measure * all(known)
    assert Reasoner(program).ask(query)["true"] == pytest.approx(sums[1] / sum(sums), rel=1e-9)


def test_the_translation_is_a_program_for_every_engine(tmp_path):
    (tmp_path / "s.mln").write_text(SMOKERS)
    program = read_plog(tmp_path / "s.mln")
    expected = Reasoner(program).exact("Smokes(Anna)", {"Cancer(Bob)": "false"})
    assert Enumeration(program).exact("Smokes(Anna)", {"Cancer(Bob)": "false"}) == expected


def test_eight_smokers_are_exact():
    names = "Anna, Bob, Edward, Frank, Gary, Helen, Iris, Jim"
    program, _ = parse_mln(SMOKERS.replace("Anna, Bob", names))
    answer = Reasoner(program).ask(
        parse_query("Smokes(Anna) | obs(Smokes(Bob)), obs(Friends(Anna, Bob))", program)
    )
    assert isinstance(answer["true"], float)
    assert 0.5 < answer["true"] < 1


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "Smokes(x) => Cancer(x)",
            "6:1: a formula without weight; expected a number before it, or '.'",
        ),
        (
            "1.5 Smokes(x) => Drinks(x)",
            "6:18: Drinks is not declared; expected one of Smokes,",
        ),
        ("1.5 Smokes(x, y)", "6:5: Smokes has 2 arguments; expected 1"),
        ("1.5 (Smokes(x) => )", "6:19: unexpected ')'; expected a constant"),
        ("1.5 Smokes(x) Cancer(x)", "6:15: unexpected 'Cancer'; expected the end of the line"),
        ("1.5 Smokes(mother(x))", "6:12: mother(...) is a function, which is not translated"),
        ("1.5 Smokes(+x)", "6:12: unexpected '+'; a weight for each constant, '+', is not translated"),
        ("nan Smokes(x)", "6:1: unexpected 'nan'; expected a number as the weight"),
        ("1e9 Smokes(x)", "6:1: the weight 1e+09; expected at most 600, or a hard formula with '.'"),
        ("log(0) Smokes(x)", "6:1: the logarithm of 0; expected a positive number"),
        ("1.5 Smokes(x).", "6:14: unexpected '.'; expected a weight or '.', not both"),
        ("1.5 x = y", "6:1: x is in no predicate, so that its domain is unknown; expected one"),
        ("1.5 Smokes(x) ^ EXIST z Cancer(x)", "6:17: z is in no predicate below its quantifier"),
        ("Likes(person?, person)", "6:1: Likes has '?', at most one value, which is not translated"),
        ('#include "other.mln"', "6:1: #include and other directives are not read; expected one file"),
        ("1.5 Smokes(x) & Cancer(x)", "6:15: unexpected '&'; expected a formula of Markov logic"),
        ("number = {1, ..., 0}", "6:20: unexpected '}'; expected two integers around '...', not 1 and 0"),
        ("Knows(person, language)", "6:1: the domain language has no constant; expected 'language = {...}'"),
        (
            "1.5 " + "(" * 70 + "Smokes(x)" + ")" * 70,
            "6:65: unexpected '('; a formula of more than 60",
        ),
    ],
)
def test_errors_have_their_place(line: str, message: str):
    lines = SMOKERS.splitlines()
    with pytest.raises(ParseError) as found:
        parse_mln("\n".join([*lines[:5], line, *lines[5:]]), file="s.mln")
    assert f"s.mln:{message}" in str(found.value)


def test_names_of_types_need_not_be_names_of_p_log():
    program, _ = parse_mln("my-type = {A, B}\nrandom = {C}\nP(my-type)\nQ(random)\n1 P(x)\n")
    assert Reasoner(program).posterior("P(B)")["true"] == pytest.approx(exp(1) / (1 + exp(1)), rel=1e-12)
    assert Reasoner(program).posterior("Q(C)")["true"] == 0.5


def test_errors_of_evidence_have_their_place():
    for facts, message in (
        ("Smokes(Anna)\nDrinks(Anna)", "e.db:2:1: Drinks is not declared; expected one of Smokes,"),
        ("Smokes(Anna, Bob)", "e.db:1:1: Smokes has 2 arguments; expected 1"),
        ("0.7 Smokes(Anna)", "e.db:1:1: unexpected '0.7'; expected a predicate"),
    ):
        with pytest.raises(ParseError) as found:
            parse_mln(SMOKERS, facts=facts, facts_file="e.db")
        assert message in str(found.value)
