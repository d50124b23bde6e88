"""Passes over circuits: likelihoods in batches, evidence below the range of floating point."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning import Circuit, Enumeration, Reasoner, load_circuit, parse_plog, save_circuit
from lcorpp.reasoning._diagram import Layers
from lcorpp.values import Likelihood

WEATHER = parse_plog(
    "t = {1..4}. #domain t(T). w = {sun, cloud, rain}. x : t -> w. random(x(T)). p : t -> boolean."
    " pr(x(T+1)=rain | x(T)=rain) = 2/3. pr(x(T+1)=sun | x(T)=sun) = 1/2. random(p(T)) :- not x(T)=sun."
    " pr(p(T) | x(T)=rain) = 9/10. :- x(1)=sun, x(4)=rain."
)
SENSORS = parse_plog(
    "i = {1..340}. kind = {a, b, c}. #domain i(I). x : kind. random(x). s : i -> boolean. random(s(I))."
    " pr(s(I) | x=a) = 9/10. pr(s(I) | x=b) = 1/10. pr(s(I) | x=c) = 1/100. last : boolean. random(last)."
    " pr(last | x=a) = 0. pr(last | x=b) = 1/2. pr(last | x=c) = 1/2."
)


def weigh(evidence: dict[str, str | Likelihood], term: str) -> dict[str, float]:
    """Sum the enumerated worlds, each with its measure times the weights of its values."""
    sums: dict[str, float] = {}
    for world in Enumeration(WEATHER).worlds:
        mass = float(world.measure)
        for name, given in evidence.items():
            weight_of = {given: 1.0} if isinstance(given, str) else dict(given)
            mass *= weight_of.get(world.values.get(name, ""), 0.0)
        if mass:
            sums[world.values[term]] = sums.get(world.values[term], 0.0) + mass
    total = sum(sums.values())
    return {value: sums.get(value, 0.0) / total for value in ("sun", "cloud", "rain")}


@pytest.fixture(params=["usual range", "extended range"])
def weather(request) -> Circuit:
    """A circuit whose numbers have the usual or the extended range."""
    circuit = Reasoner(WEATHER).compile(["x", "p"], ["x(2)", "x(4)"])
    if request.param == "extended range":
        stored = circuit.layers.store()  # weights with exponents of 2
        circuit.layers = Layers([(*own[:-1], np.zeros(len(own[-2]), dtype=np.int64)) for own in stored])
    return circuit


def test_batches_with_likelihoods_equal_the_weighted_worlds(weather):
    rng = np.random.default_rng(1)
    values = {name: weather.values[name] for name in weather.inputs}
    rows = []
    for _ in range(6):
        row = {}
        for name in rng.permutation(weather.inputs)[:3].tolist():
            weights = Likelihood(values[name][::-1], rng.random(len(values[name])))
            row[name] = weights if rng.random() < 0.7 else str(rng.choice(values[name]))
        rows.append(row)
    columns = {name: [row.get(name) for row in rows] for name in weather.inputs}
    batch = weather(columns, undefined="nan")
    for i, row in enumerate(rows):
        for query in weather.queries:
            if np.isnan(batch[query][i, 0]):
                with pytest.raises(UndefinedError):
                    weather(row)
                continue
            expected = pytest.approx(list(weigh(row, query).values()), abs=1e-12)
            assert batch[query][i].tolist() == expected
            assert weather(row)[query].probabilities.tolist() == expected


def test_one_likelihood_for_a_whole_column():
    circuit = Reasoner(WEATHER).compile(["x(1)", "x(3)"], "x(2)")
    likelihood = Likelihood(("sun", "cloud", "rain"), [1, 2, 5])
    batch = circuit({"x(1)": ["sun", "rain"], "x(3)": likelihood})
    assert batch[1].tolist() == circuit({"x(1)": "rain", "x(3)": likelihood}).probabilities.tolist()
    with pytest.raises(
        ProgramError, match=r"row 1: a likelihood of sun, rain for x\(1\); expected a number for each of"
    ):
        circuit({"x(1)": ["sun", Likelihood(("sun", "rain"), [1, 2])]})
    with pytest.raises(ProgramError, match=r"row 1: 'snow' is not a value of x\(1\)"):
        circuit({"x(1)": [likelihood, "snow"]})
    with pytest.raises(ProgramError, match=r"the likelihoods of x\(3\) have no codes"):
        circuit.encode({"x(1)": ["sun"], "x(3)": likelihood})


def test_many_likelihoods_cost_one_pass():
    """3^200 combinations of values."""
    program = parse_plog(
        "t = {1..200}. #domain t(T). w = {a, b, c}. x : t -> w. random(x(T)). pr(x(T+1)=V | x(T)=V) = 1/2."
        " #domain w(V)."
    )
    likelihood = Likelihood(("a", "b", "c"), [0.7, 0.2, 0.1])
    found = Reasoner(program).posterior("x(200)", {f"x({t})": likelihood for t in range(1, 201)})
    step, belief = np.full((3, 3), 1 / 4) + np.eye(3) / 4, np.full(3, 1 / 3)
    for t in range(200):
        belief = (belief @ step if t else belief) * likelihood.weights
        belief /= belief.sum()
    np.testing.assert_allclose(found.probabilities, belief, atol=1e-12)


def test_improbable_evidence_in_batches():
    """10^-320 of the weight is left after the last observation."""
    circuit = Reasoner(SENSORS).compile(["s", "last"], "x")
    names = [f"s({i})" for i in range(1, 341)]
    last = ["true", "true", None, "false", "true"]
    some = ["true", "false", "true", "true", None]
    batch = circuit({**dict.fromkeys(names, some), "last": last})
    for row, (value, end) in enumerate(zip(some, last, strict=True)):
        given = {name: value for name in names if value} | ({"last": end} if end else {})
        exact = [float(p) for p in circuit.exact(given).values()]
        assert batch[row].tolist() == pytest.approx(exact, rel=1e-9, abs=1e-300)
        assert circuit(given).probabilities.tolist() == pytest.approx(exact, rel=1e-9, abs=1e-300)
    soft = Likelihood(("true", "false"), [1, 1e-200])
    unlikely = circuit({"s(1)": soft, "s(2)": soft, "s(3)": "false", "last": "true"})
    assert unlikely["c"] == pytest.approx(1e-4 * 0.99 / (1e-4 * 0.99 + 1e-2 * 0.9), rel=1e-12)
    tiny = [Likelihood(("true", "false"), [1e-250, 1.0]), "true"]
    two = circuit({"s(1)": tiny[:1], "s(2)": tiny[:1], "last": "true"})
    assert two[0].tolist() == pytest.approx([0, 0.81 / (0.81 + 0.9801), 0.9801 / (0.81 + 0.9801)], rel=1e-12)


def test_improbable_hidden_values_in_batches():
    """The compiler sums out a value of probability 2^-2000, then one of 10^-598."""
    program = parse_plog(
        "i = {1..2000}. #domain i(I). heads, all : i -> boolean. random(heads(I)). all(1) :- heads(1)."
        " all(I+1) :- all(I), heads(I+1). last : boolean. random(last) :- all(2000)."
        " pr(last | all(2000)) = 1/4. last=false :- not all(2000)."
    )
    circuit = Reasoner(program).compile(["all(2000)"], "last")
    assert circuit({"all(2000)": ["true", None]})[0].tolist() == pytest.approx([0.25, 0.75])
    rare = parse_plog(
        f"a, b, c : boolean. random(a). pr(a) = 1/1{'0' * 299}. random(b). pr(b | a) = 1/1{'0' * 299}."
        " pr(b | -a) = 0. c :- b. c=false :- not b."
    )
    circuit = Reasoner(rare).compile(["c", "b"], "a")
    assert circuit({"c": ["true", "false"]}).tolist() == [[1, 0], [pytest.approx(1e-299), 1]]
    assert np.isnan(circuit({"c": ["true"], "b": ["false"]}, undefined="nan")).all()
    assert circuit.exact({"c": "true"})["true"] == Fraction(1)


def test_hidden_values_that_later_evidence_makes_probable(tmp_path):
    """The compiler sums out a value of probability 10^-400 if x=a; evidence of 10^-600 rules out x=b."""
    tiny = f"1/1{'0' * 200}"
    program = parse_plog(
        "kind = {a, b, c}. x : kind. random(x). i = {1..5}. s : i -> boolean. random(s(I)). #domain i(I)."
        f" pr(s(1) | x=a) = {tiny}. pr(s(2) | x=a) = {tiny}. pr(s(1) | x=b) = {tiny}."
        f" pr(s(3) | x=b) = {tiny}. pr(s(4) | x=b) = {tiny}. pr(s(I) | x=c) = 0. both : boolean."
        " both :- s(1), s(2). both=false :- not s(1). both=false :- not s(2)."
    )
    circuit = Reasoner(program).compile(["both", "s(3)", "s(4)", "s(5)"], "x")
    save_circuit(circuit, tmp_path / "a")
    given = {"both": "true", "s(3)": "true", "s(4)": "true"}
    certain, unlikely = (Likelihood(("true", "false"), weights) for weights in ([1, 0], [1, 3]))
    soft = given | {"both": certain, "s(5)": unlikely}
    exact = [float(p) for p in circuit.exact(given).values()]
    assert exact == pytest.approx([1, 2e-200, 0], rel=1e-9)
    for answer in (circuit, load_circuit(tmp_path / "a")):
        for evidence in (given, soft):
            assert answer(evidence).probabilities.tolist() == pytest.approx(exact, rel=1e-9)
            batch = answer({name: [value, None] for name, value in evidence.items()})
            assert batch.tolist() == [pytest.approx(exact, rel=1e-9), pytest.approx([1 / 3] * 3)]


def test_impossible_evidence_is_never_improbable():
    circuit = Reasoner(WEATHER).compile(["x", "p"], "x(2)")
    rows = list(product(circuit.values["x(1)"], circuit.values["x(4)"]))
    columns = {"x(1)": [row[0] for row in rows], "x(4)": [row[1] for row in rows]}
    for likelihood in (None, Likelihood(("true", "false"), [1e-200, 1])):
        batch = circuit({**columns, "p(3)": [likelihood] * len(rows)}, undefined="nan")
        assert [row for row, p in zip(rows, batch, strict=True) if np.isnan(p).any()] == [("sun", "rain")]


@pytest.mark.parametrize(("first", "second"), [(181, 141), (174, 148), (184, 140), (200, 140), (280, 140)])
def test_products_of_tiny_numbers_keep_their_digits(first, second, tmp_path):
    """Each number fits floating point, their product does not, or has few digits."""
    program = parse_plog(
        f"n = {{1..3}}. x, z : boolean. y : n. random(x). pr(x) = 3/1{'0' * first}. random(y)."
        f" pr(y=1 | x) = 1234/1{'0' * second}. pr(y=2 | x) = 777/1{'0' * second}. pr(y=1 | -x) = 1/3."
        " pr(y=2 | -x) = 1/3. random(z). pr(z | y=1) = 1/3. pr(z | y=2) = 3/4. :- y=3, x."
    )
    expected = (1234 / 3 + 777 * 3 / 4) / (1234 + 777)
    circuit = Reasoner(program).compile(["x"], "z")
    save_circuit(circuit, tmp_path / "a")
    for own in (circuit, load_circuit(tmp_path / "a")):
        assert own({"x": "true"})["true"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("rule", ["obs(b).", ":- not b."])
def test_a_product_that_vanishes_is_repeated_with_wide_numbers(rule):
    program = parse_plog(
        f"a, b, c : boolean. random(a). pr(a) = 1/1{'0' * 250}. random(b). pr(b | a) = 1/1{'0' * 140}."
        f" pr(b | -a) = 0. random(c). pr(c | a) = 1/3. {rule}"
    )
    assert Reasoner(program).posterior("a", {})["true"] == 1
    assert Reasoner(program).posterior("c", {})["true"] == pytest.approx(1 / 3, rel=1e-12)
