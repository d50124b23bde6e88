"""Programs of tables and blocks: recursions and other logic beside networks that are too wide to expand."""

from __future__ import annotations

import pickle
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from tests.reasoning.engines import force_tables

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning import Enumeration, Reasoner, parse_plog, parse_query
from lcorpp.reasoning.circuit import choice
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.factors import block_table, blocks
from lcorpp.reasoning.factors.block_table import BlockTable
from lcorpp.reasoning.factors.blocks import Part, find_blocks
from lcorpp.reasoning.factors.division import divide_program
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.values import Likelihood


def make_grid(n: int) -> str:
    """An n x n grid of truth values, each depending on those above and to the left."""
    rng = np.random.default_rng(n)
    lines = [f"row = {{1..{n}}}. col = {{1..{n}}}. g : row, col -> boolean. random(g(R, C))."]
    for i in range(1, n + 1):
        for j in range(1, n + 1):
            above = [f"g({i - 1}, {j})"] * (i > 1) + [f"g({i}, {j - 1})"] * (j > 1)
            for signs in np.ndindex(*[2] * len(above)):
                body = ", ".join("-" * sign + term for sign, term in zip(signs, above, strict=True))
                given = f" | {body}" if body else ""
                lines.append(f"pr(g({i}, {j}){given}) = {rng.integers(1, 20)}/20.")
    return "\n".join(lines)


def make_map(n: int, causes: str) -> str:
    """Rooms in a ring with a spoke each to the first one; some doors are blocked by causes."""
    doors = [(i, i % n + 1) for i in range(1, n + 1)] + [(1, i) for i in range(3, n)]
    return (
        f"room = {{1..{n}}}. works, door, blocked, open : room, room -> boolean. reach : room -> boolean.\n"
        + "\n".join(f"door({a}, {b})." for a, b in doors)
        + f"""
        random(works(A, B)) :- door(A, B). pr(works(A, B) | door(A, B)) = 2/5.
        {causes}
        open(A, B) :- works(A, B), not blocked(A, B).
        reach(1). reach(B) :- reach(A), open(A, B). reach(A) :- reach(B), open(A, B).
        -reach(A) :- not reach(A).
        """
    )


LINKS = "blocked(1, 2) :- g(2, 3). blocked(2, 3) :- -g(1, 4). blocked(1, 4) :- g(3, 1)."


@pytest.fixture
def only_tables(monkeypatch):
    """Tables and blocks wherever a program has them."""
    force_tables(monkeypatch)


def has_block(circuit: Circuit) -> bool:
    network = circuit.network
    return network is not None and any(isinstance(f.source, BlockTable) for f in network.graph.factors)


def compile_both(text: str, inputs: list[str], query: str, monkeypatch) -> tuple[Circuit, Circuit]:
    """Compile a program with blocks, and as one decision diagram."""
    program = parse_plog(text)
    found = Reasoner(program).compile(inputs, query)
    with monkeypatch.context() as patch:
        patch.setattr(choice, "is_cheaper", lambda *_: False)
        expected = Reasoner(program).compile(inputs, query)
    assert has_block(found)
    assert expected.network is None
    return found, expected


# which parts become blocks


def test_terms_that_only_a_block_reads_are_summed_out(monkeypatch):
    """A recursion (0) reads ten doors, and doors 1 and 2 depend on rain (11), which the network reads."""
    monkeypatch.setattr(blocks, "SMALL_BITS", 2)
    doors = [Part((i,), frozenset([i, 11] if i < 3 else [i]), True) for i in range(1, 11)]
    rain = [Part((11,), frozenset([11]), True), Part((12,), frozenset([11, 12]), True)]
    recursion = Part((0,), frozenset(range(11)), False)
    (block,) = find_blocks([*rain, *doors, recursion], dict.fromkeys(range(13), 1.0), {0, 12}) or []
    assert block.boundary == (0, 11)
    assert block.inner == {*range(1, 11)}


def test_blocks_that_share_terms_are_one():
    shared = [Part((i,), frozenset([i]), True) for i in range(2, 14)]
    recursions = [Part((i,), frozenset([i, *range(2, 14)]), False) for i in (0, 1)]
    (block,) = find_blocks([*shared, *recursions], dict.fromkeys(range(14), 1.0), {0, 1}) or []
    assert len(block.parts) > 2
    assert {*recursions} <= {*block.parts}
    assert len(block.boundary) <= blocks.SMALL_BITS


def test_a_boundary_that_stays_large_is_no_block():
    part = Part((0,), frozenset(range(20)), False)
    assert find_blocks([part], dict.fromkeys(range(20), 1.0), range(20)) is None


# answers


@pytest.mark.usefixtures("only_tables")
def test_a_map_beside_a_grid_equals_the_decision_diagram(monkeypatch):
    inputs = ["g(4, 4)", "g(2, 3)", "reach(3)"]
    found, expected = compile_both(make_grid(4) + make_map(5, LINKS), inputs, "reach(4)", monkeypatch)
    for values in np.ndindex(2, 2, 2):
        evidence = {name: ("true", "false")[v] for name, v in zip(inputs, values, strict=True)}
        assert found.exact(evidence) == expected.exact(evidence)
        shares = found(evidence).probabilities
        np.testing.assert_allclose(shares, expected(evidence).probabilities, rtol=1e-12)
    codes = np.array([[0, -1, 0], [1, 1, -1], [-1, -1, -1]])
    np.testing.assert_allclose(found(codes), expected(codes), rtol=1e-12)
    soft = {
        "g(2, 3)": Likelihood(("true", "false"), [0.3, 0.9]),
        "reach(3)": Likelihood(("true", "false"), [0.8, 0.1]),
    }
    np.testing.assert_allclose(found(soft).probabilities, expected(soft).probabilities, rtol=1e-12)
    best, others = ([(w.measure, dict(w.values)) for w in c.most_probable({}, 3)] for c in (found, expected))
    assert best == others
    again = pickle.loads(pickle.dumps(found))
    assert again.exact({}) == found.exact({})
    np.testing.assert_array_equal(again(codes), found(codes))


def test_a_map_beside_a_grid_that_is_too_wide_to_expand():
    """One variable of the network blocks a door: P(reach) is a sum over its values, each with a map alone."""
    grid, cause = make_grid(14), "blocked(1, 2) :- g(9, 8). blocked(4, 5) :- g(9, 8)."
    program = parse_plog(grid + make_map(8, cause))
    query, given = "reach(5)", {"g(3, 12)": "true", "g(12, 3)": "false"}
    circuit = Reasoner(program).compile([*given, "reach(4)"], query)
    assert has_block(circuit)
    shares = Reasoner(parse_plog(grid)).posterior("g(9, 8)", given)

    def ask_map(blocked: str) -> Fraction:
        text = make_map(
            8, "c : boolean. c. blocked(1, 2) :- c. blocked(4, 5) :- c.".replace("c.", blocked, 1)
        )
        return Reasoner(parse_plog(text)).exact(query)["true"]

    expected = shares["true"] * float(ask_map("c.")) + shares["false"] * float(ask_map("-c."))
    assert circuit(given)["true"] == pytest.approx(expected, rel=1e-9)
    answer = Reasoner(program).ask(parse_query("reach(5) | obs(g(3, 12)), obs(-g(12, 3))", program))
    assert answer["true"] == pytest.approx(expected, rel=1e-9)


@pytest.mark.usefixtures("only_tables")
@pytest.mark.parametrize(
    "text",
    [
        # an input that may have no value, or has only some of its values
        "p, q : boolean. random(p). s = {x, y, z}. a : s. random(a : {V : k(V)}) :- p. k : s -> boolean."
        " k(x). k(z). pr(a=x | p) = 1/3. b, c : boolean. random(q)."
        " b :- c, q. c :- b, a=x. c :- a=z. b :- not a=x, not a=z. -b :- not b. -c :- not c.",
        # an input that is a fact, and one that an observation decides
        "p, q, b, c : boolean. random(p). random(q). q. b :- c, p. c :- b, q. c :- p, q. -b :- not b."
        " -c :- not c.",
        # a recursion with two stable models, and a constraint about its terms and an input
        "p, b, c : boolean. random(p). b :- not c. c :- not b. :- b, p. -b :- not b. -c :- not c.",
        # a random term in a cycle
        "p, b, c : boolean. random(p). random(b) :- not c, p. c :- not b, p. -c :- not c. b :- -p.",
    ],
)
def test_blocks_with_inputs_of_all_kinds(text: str, monkeypatch):
    monkeypatch.setattr(blocks, "SMALL_BITS", 3)  # so that inputs stay outside
    program = parse_plog(text)
    for query, observed in product(("c", "p"), ({}, {"p": "true"}, {"c": "false"})):
        found = answer_or_error(Reasoner(program), query, observed)
        expected = answer_or_error(Enumeration(program), query, observed)
        assert found == expected
        if isinstance(expected, dict):
            shares = Reasoner(program).posterior(query, observed).probabilities
            np.testing.assert_allclose(shares, [float(p) for p in expected.values()], atol=1e-14)


def answer_or_error(reasoner: Reasoner | Enumeration, query: str, observed: dict[str, str]) -> object:
    try:
        return reasoner.exact(query, observed)
    except (ProgramError, UndefinedError) as error:
        return type(error)


@pytest.mark.usefixtures("only_tables")
def test_a_condition_that_only_impossible_inputs_break(monkeypatch):
    """Two selections of `a` apply if p and q hold, which they never do together."""
    monkeypatch.setattr(blocks, "SMALL_BITS", 3)
    program = parse_plog(
        "p, q, a, b : boolean. random(p). q :- not p. -q :- p. [one] random(a) :- p, not b."
        " [two] random(a) :- q. b :- a. -b :- not b. -a :- not p, not q."
    )
    assert Reasoner(program).exact("q") == Enumeration(program).exact("q")


@pytest.mark.usefixtures("only_tables")
def test_tables_that_floating_point_does_not_represent_are_expanded(monkeypatch):
    monkeypatch.setattr(blocks, "SMALL_BITS", -1)
    tiny = f"1/{10**299}"
    program = parse_plog(
        f"p, q, b, c : boolean. random(p). random(q). pr(p) = {tiny}. pr(q) = {tiny}."
        " b :- c, p. c :- b. b :- q, p. -b :- not b. -c :- not c."
    )
    circuit = Reasoner(program).compile([], "c")
    assert circuit.network is None
    assert circuit({}).probabilities.tolist() == [pytest.approx(0.0, abs=1e-320), 1.0]


def test_a_narrow_program_is_not_divided():
    """Its decision diagram may be large for other reasons."""
    text = make_map(6, "blocked(1, 2) :- c. c : boolean. random(c).")
    program = parse_plog(text)
    division = divide_program(ground_program(program, {}), ["reach(3)"], {})
    assert division is not None
    assert len(division.blocks) == 1
    assert not division.has_wide_tables
    assert "1 blocks" in repr(division)


# limits of numbers and shapes


def test_many_observed_doors_are_constants_of_a_block():
    """A table over 78 terms with one outcome each would have more axes than numpy has."""
    doors = [(a, b) for a in range(1, 14) for b in range(a + 1, 14)]
    program = parse_plog(
        make_grid(13) + " room = {1..13}. door : room, room -> boolean. reach : room -> boolean."
        " random(door(A, B)) :- A < B. reach(1). reach(B) :- reach(A), door(A, B), A < B, g(6, 6)."
        " reach(A) :- reach(B), door(A, B), A < B, g(6, 6). -reach(A) :- not reach(A)."
        + "".join([f" obs(door({a}, {b}))." for a, b in doors])
    )
    found = Reasoner(program).posterior("reach(3)")
    assert found["true"] == pytest.approx(Reasoner(parse_plog(make_grid(13))).posterior("g(6, 6)")["true"])


@pytest.mark.usefixtures("only_tables")
def test_fractions_of_a_table_with_many_constants():
    names = [f"x({i})" for i in range(1, 71)]
    program = parse_plog(
        make_grid(3) + " n = {1..70}. x : n -> boolean. y : boolean. random(x(N)). random(y)."
        f" pr(y | {', '.join(names)}, g(2, 2)) = 1/3." + "".join([f" obs({name})." for name in names])
    )
    circuit = Reasoner(program).compile([], "y")
    share = Reasoner(parse_plog(make_grid(3))).exact("g(2, 2)")["true"]
    assert circuit.exact({})["true"] == share / 3 + (1 - share) / 2
    assert circuit({})["true"] == pytest.approx(float(share / 3 + (1 - share) / 2), rel=1e-12)


@pytest.mark.usefixtures("only_tables")
def test_entries_near_the_smallest_numbers_stay_possible(monkeypatch):
    monkeypatch.setattr(blocks, "SMALL_BITS", -1)
    program = parse_plog(
        f"p, q, b, c : boolean. random(p). random(q). pr(p) = 1/{10**125}. pr(q) = 1/{10**255}. obs(p)."
        " b :- c, q. c :- b, p. c :- q, p. b :- c. -b :- not b. -c :- not c."
    )
    circuit = Reasoner(program).compile(["c"], "c")
    assert has_block(circuit)
    assert circuit({})["true"] == pytest.approx(1e-255, rel=1e-9)
    assert circuit({"c": "true"})["true"] == 1.0


@pytest.mark.usefixtures("only_tables")
def test_a_default_is_a_table():
    """A term that depends on itself alone needs no block."""
    program = parse_plog(
        "p, q, a, b, c : boolean. random(p). random(q). a :- p, q. -a :- not a. b :- not -b, p."
        " -b :- not b, p. -b :- not b, -p. random(c) :- not c, a. -c :- not c, -a."
    )
    circuit = Reasoner(program).compile([], "b")
    assert circuit.network is not None
    assert not has_block(circuit)
    for term in ("a", "b"):
        assert Reasoner(program).exact(term) == Enumeration(program).exact(term)


def test_a_joint_of_many_terms_is_no_block():
    program = parse_plog(make_grid(11))
    joint = [f"g(11, {i})" for i in range(1, 12)]
    circuit = Reasoner(program).compile(["g(1, 1)"], [joint])
    assert circuit.network is not None
    assert not has_block(circuit)
    answer = circuit({"g(1, 1)": "true"})
    assert isinstance(answer, dict)
    (shares,) = [own.probabilities.reshape([2] * 11) for own in answer.values()]
    expected = Reasoner(program).posterior("g(11, 4)", {"g(1, 1)": "true"})["true"]
    assert shares[:, :, :, 0].sum() == pytest.approx(expected, rel=1e-9)


def test_growth_ends_after_its_work(monkeypatch):
    monkeypatch.setattr(blocks, "MAX_WORK", 10)
    parts = [Part((i,), frozenset([i]), True) for i in range(1, 30)]
    recursion = Part((0,), frozenset(range(30)), False)
    assert find_blocks([*parts, recursion], dict.fromkeys(range(30), 1.0), {0}) is None


def test_an_observed_disjunction_about_a_network():
    program = parse_plog(make_grid(12))
    query = parse_query("g(3, 3) | obs(g(1, 1) or g(2, 2))", program)
    whole = Reasoner(program)
    given = whole.posterior(["g(3, 3)", "g(1, 1)", "g(2, 2)"])
    shares = np.reshape(given.probabilities, (2, 2, 2)).copy()
    shares[:, 1, 1] = 0.0
    assert Reasoner(program).ask(query)["true"] == pytest.approx(shares[0].sum() / shares.sum(), rel=1e-9)


@pytest.mark.usefixtures("only_tables")
def test_the_marginal_of_a_term_with_one_outcome():
    program = parse_plog(
        "p, b, c, d : boolean. random(p). random(d). pr(d | c) = 1/3. b :- p. b :- c. c :- b, p. -c :- not c."
        " obs(b)."
    )
    found = Reasoner(program).compile([], ["b", "c", "d", "p"])({})
    assert isinstance(found, dict)
    for name, shares in found.items():
        expected = Enumeration(program).exact(name)
        np.testing.assert_allclose(shares.probabilities, [float(p) for p in expected.values()], atol=1e-12)


@pytest.mark.usefixtures("only_tables")
def test_fractions_of_a_large_block_come_from_the_whole_diagram(monkeypatch):
    program = parse_plog(make_grid(3) + make_map(4, "blocked(1, 2) :- g(2, 3)."))
    expected = Reasoner(program).compile(["g(1, 1)"], "reach(3)").exact({"g(1, 1)": "true"})
    monkeypatch.setattr(block_table, "MAX_VISITED_ARCS", 10)
    assert Reasoner(program).compile(["g(1, 1)"], "reach(3)").exact({"g(1, 1)": "true"}) == expected


@pytest.mark.usefixtures("only_tables")
def test_a_table_that_takes_too_much_work_is_left_to_the_diagram(monkeypatch):
    monkeypatch.setattr(block_table, "MAX_WORK", 10)
    program = parse_plog(make_grid(3) + make_map(4, "blocked(1, 2) :- g(2, 3)."))
    assert Reasoner(program).compile(["g(1, 1)"], "reach(3)").network is None
