"""Sums of products of tables, against the joint distribution and known answers."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from tests.reasoning.engines import force_tables
from tests.reasoning.factors.networks import compute_joint, make_network

from lcorpp.errors import TooLargeError, UndefinedError
from lcorpp.reasoning import (
    EstimatedDistribution,
    Reasoner,
    ReasoningWarning,
    load_circuit,
    parse_plog,
    parse_query,
    program_text,
    save_circuit,
)
from lcorpp.reasoning.factors import network as tables
from lcorpp.reasoning.factors._tables import Network
from lcorpp.reasoning.language.networks.bif import parse_bif
from lcorpp.values import Likelihood


def draw_evidence(rng, program, count):
    names = list(program.attributes)
    chosen = rng.choice(names, count, replace=False).tolist()
    return {name: str(rng.choice(program.attributes[name].values)) for name in chosen}


def condition(program, joint, evidence):
    """Return the joint weights with evidence: values, or weights of values."""
    for i, (name, attribute) in enumerate(program.attributes.items()):
        if name in evidence:
            given = evidence[name]
            own = [given[v] if isinstance(given, dict) else float(v == given) for v in attribute.values]
            joint = joint * np.reshape(own, [-1 if k == i else 1 for k in range(joint.ndim)])
    return joint


@pytest.mark.parametrize("seed", range(30))
def test_answers_are_sums_of_the_joint_distribution(seed):
    rng, program = np.random.default_rng(seed), make_network(seed)
    joint, reasoner, names = compute_joint(program), Reasoner(program), list(program.attributes)
    for count in (0, 1, 2, 4):
        evidence = draw_evidence(rng, program, count)
        weights = condition(program, joint, evidence)
        if not weights.sum():
            with pytest.raises(UndefinedError, match="no possible world"):
                reasoner.posterior(names[0], evidence)
            with pytest.raises(UndefinedError, match="no possible world"):
                reasoner.posteriors(None, evidence)
            continue
        marginals = reasoner.posteriors(None, evidence)
        for i, name in enumerate(names):
            expected = weights.sum(tuple(k for k in range(len(names)) if k != i)) / weights.sum()
            np.testing.assert_allclose(reasoner.posterior(name, evidence).probabilities, expected, atol=1e-12)
            np.testing.assert_allclose(marginals[name].probabilities, expected, atol=1e-12)
        a, b = sorted(rng.choice(len(names), 2, replace=False).tolist())
        expected = weights.sum(tuple(k for k in range(len(names)) if k not in (a, b))).ravel() / weights.sum()
        found = reasoner.posterior([names[a], names[b]], evidence)
        np.testing.assert_allclose(found.probabilities, expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_soft_evidence_multiplies_the_joint_distribution(seed):
    rng, program = np.random.default_rng(seed), make_network(seed, zeros=0.0)
    names = list(program.attributes)
    values = program.attributes[names[2]].values
    given = dict(zip(values, rng.random(len(values)).tolist(), strict=True))
    evidence = draw_evidence(rng, program, 2) | {names[2]: given}
    weights = condition(program, compute_joint(program), evidence)
    likelihoods = evidence | {names[2]: Likelihood(values, [given[value] for value in values])}
    found = Reasoner(program).posterior(names[5], likelihoods)
    expected = weights.sum(tuple(k for k in range(len(names)) if k != 5)) / weights.sum()
    np.testing.assert_allclose(found.probabilities, expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_a_batch_may_observe_different_terms_in_each_row(seed):
    rng, program = np.random.default_rng(seed), make_network(seed, zeros=0.0)
    rows = [draw_evidence(rng, program, count) for count in (0, 1, 2, 2, 3)]
    found = Reasoner(program).posteriors("V4", rows)
    for row, distribution in zip(rows, found, strict=True):
        alone = Reasoner(program).posterior("V4", row)
        np.testing.assert_allclose(distribution.probabilities, alone.probabilities, atol=1e-12)
    for own, distribution in zip(Reasoner(program).posteriors(None, rows), found, strict=True):
        np.testing.assert_allclose(own["V4"].probabilities, distribution.probabilities, atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_fractions_are_those_of_the_decision_diagram(seed):
    program = make_network(seed, n=6)
    text = program_text(program)
    diagram = parse_plog(text)
    for question in ("V5", "V0, V4", "{V1=v0 or V3=v0}", "V5 | obs(V0=v0)", "V5, V2 | do(V3=v0)"):
        own, other = Reasoner(program), Reasoner(diagram)
        query = parse_query(question, program)
        try:
            expected = other.ask(query, exact=True)
        except UndefinedError:
            with pytest.raises(UndefinedError):
                own.ask(query, exact=True)
            continue
        assert own.ask(query, exact=True) == expected
        given = own.ask(query)
        assert given == pytest.approx(
            {k: float(p) for k, p in expected.items()} if isinstance(expected, dict) else float(expected)
        )


def test_an_intervention_cuts_the_table_of_its_term():
    rain = parse_bif(
        "variable rain { type discrete [2] { yes, no }; } variable wet { type discrete [2] { yes, no }; }"
        "probability ( rain ) { table 0.2, 0.8; }"
        "probability ( wet | rain ) { (yes) 0.9, 0.1; (no) 0.3, 0.7; }"
    )
    assert Reasoner(rain).exact("rain", {"wet": "yes"})["yes"] == Fraction(18, 42)
    assert Reasoner(rain).exact("rain", do={"wet": "yes"})["yes"] == Fraction(1, 5)
    assert Reasoner(rain).posterior("rain", do={"wet": "yes"})["yes"] == pytest.approx(0.2)


def test_products_that_underflow_are_computed_with_wide_numbers():
    """A coin of two kinds shows heads 3000 times: the likelihoods are .5 and .6 to the power of 3000."""
    n = 3000
    sizes, observed = [2, *[2] * n], list(range(1, n + 1))
    coin = np.array([0.5, 0.5, 0.6, 0.4])
    network = Network(
        sizes, [[0], *[[0, i] for i in observed]], [np.array([0.5, 0.5]), *[coin] * n], list(range(n + 1))
    )
    weights, logarithms = network.plan([0], observed, []).evaluate(
        np.zeros((1, n), np.int64), np.zeros((1, 0))
    )
    assert weights[0, 1] == 1.0
    assert np.log(weights[0, 0]) == pytest.approx(n * np.log(0.5 / 0.6), rel=1e-12)
    assert logarithms[0] == pytest.approx(n * np.log(0.6) + np.log(0.5), rel=1e-12)
    marginals, _ = network.plan([], observed[1:], [], True).evaluate(
        np.zeros((1, n - 1), np.int64), np.zeros((1, 0))
    )
    assert marginals[0, 2] / marginals[0, 2:4].sum() == pytest.approx(0.6)
    assert marginals[0, 4:6].tolist() == [1.0, 0.0]  # observed


def test_variables_on_which_nothing_depends_cost_nothing():
    sizes = [2] * 30
    network = Network(
        sizes,
        [[0], *[[0, i] for i in range(1, 29)], [*range(20), 29]],
        [np.array([0.5, 0.5]), *[np.full(4, 0.5)] * 28, np.full(2**21, 0.5)],
        list(range(30)),
    )
    plan = network.plan([0], [], [])
    assert plan.tables == [0]
    assert plan.cost == 0.0
    assert network.plan([0], [29], []).cost > 2**19


def test_an_answer_that_is_too_large_is_refused_before_it_begins(monkeypatch):
    program = make_network(3)
    monkeypatch.setattr(tables, "MAX_COST", 10.0)
    with pytest.raises(
        TooLargeError, match=r"random3.bif: .* sums a table of \d+ entries, about 1 MiB and 0.01 s; expected"
    ):
        Reasoner(program).exact("V7", {"V6": "v0"})
    with pytest.raises(TooLargeError, match="sums a table"):
        Reasoner(program).posteriors()


@pytest.mark.parametrize("seed", range(20))
def test_tables_of_many_shapes_are_summed_as_by_einsum(seed):
    """Large messages are written in another order than they are read in."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(2, 8, 7).tolist()
    scopes = [rng.choice(7, rng.integers(3, 6), replace=False).tolist() for _ in range(6)]
    arrays = [rng.random([sizes[v] for v in scope]) for scope in scopes]
    kept, seen = rng.choice(7, 3, replace=False).tolist(), sorted({v for scope in scopes for v in scope})
    kept = [v for v in kept if v in seen]
    network = Network(sizes, scopes, [np.ascontiguousarray(a).ravel() for a in arrays], [-1] * 6)
    operands = [part for array, scope in zip(arrays, scopes, strict=True) for part in (array, scope)]
    expected = np.einsum(*operands, kept, optimize=True).ravel()
    found, _ = network.plan(kept, [], []).evaluate(np.zeros((1, 0), np.int64), np.zeros((1, 0)))
    np.testing.assert_allclose(found[0] / found[0].max(), expected / expected.max(), rtol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_one_plan_answers_all_values_of_its_observed_variables(seed):
    """Some steps are computed for all values at once, the others for each evidence."""
    rng = np.random.default_rng(seed)
    n_variables, n_tables = 9, 8
    sizes = rng.integers(2, 8, n_variables).tolist()
    scopes = [rng.choice(n_variables, rng.integers(1, 5), replace=False).tolist() for _ in range(n_tables)]
    arrays = [rng.random(own) * (rng.random(own) > 0.1) for own in ([sizes[v] for v in s] for s in scopes)]
    seen = sorted({v for scope in scopes for v in scope})
    chosen = rng.permutation(seen)[: rng.integers(2, 7)].tolist()
    kept, observed = chosen[:1], chosen[1:]
    network = Network(sizes, scopes, [np.ascontiguousarray(a).ravel() for a in arrays], [-1] * n_tables)
    operands = [part for array, scope in zip(arrays, scopes, strict=True) for part in (array, scope)]
    expected = np.einsum(*operands, [*observed, *kept], optimize=True)
    rows = np.column_stack([rng.integers(0, sizes[v], 200) for v in observed])
    found, logarithms = network.plan(kept, observed, []).evaluate(rows, np.zeros((200, 0)))
    own = expected[tuple(rows.T)]
    assert (own.sum(axis=1) > 0).any()
    np.testing.assert_allclose(found * np.exp(logarithms)[:, None], own, rtol=1e-12)


def test_wrong_arguments_of_the_kernel():
    table = np.array([0.5, 0.5])
    for scopes, own, children, words in (
        ([[0]], [table], [], "a scope and a child"),
        ([[1]], [table], [0], "a variable that the network does not have"),
        ([[0, 0]], [table], [0], "a variable twice"),
        ([[0]], [np.ones(3)], [0], "whose size is not that of its scope"),
        ([[0]], [table], [1], "a variable that the network does not have"),
    ):
        with pytest.raises(ValueError, match=words):
            Network([2], scopes, own, children)
    plan = Network([2], [[0]], [table], [0]).plan([], [0], [])
    with pytest.raises(ValueError, match="a value out of range"):
        plan.evaluate(np.array([[2]]), np.zeros((1, 0)))
    with pytest.raises(ValueError, match="a value out of range"):
        plan.distribute([-1])
    with pytest.raises(ValueError, match="a wrong shape"):
        plan.distribute([])
    with pytest.raises(ValueError, match="a wrong shape"):
        plan.evaluate(np.zeros((1, 2), np.int64), np.zeros((1, 0)))


def test_circuits_of_tables_are_stored_and_pickled(tmp_path):
    program = make_network(1)
    circuit = Reasoner(program).compile(["V1", "V3"], "V7")
    assert repr(circuit).endswith("8 tables)")
    save_circuit(circuit, tmp_path / "network.npz")
    for other in (load_circuit(tmp_path / "network.npz"), pickle.loads(pickle.dumps(circuit))):
        np.testing.assert_allclose(
            other({"V1": "v0"}).probabilities, circuit({"V1": "v0"}).probabilities, atol=1e-12
        )


def test_wide_programs_of_p_log_are_tables():
    """Sixteen causes and effects, each of five of the causes: compared with the sum over all causes."""
    n, rng = 16, np.random.default_rng(7)
    lines, joint = (
        [f"n = {{1..{n}}}. c, e : n -> boolean. random(c(X)). random(e(X)). pr(c(X)) = 0.25."],
        np.ones([2] * n),
    )
    for i in range(n):
        joint = joint * np.reshape([0.75, 0.25], [2 if k == i else 1 for k in range(n)])
    for i in range(1, n + 1):
        parents = sorted(rng.choice(n, 5, replace=False).tolist())
        table = rng.integers(1, 1000, [2] * 5) / 1000
        for values in np.ndindex(*table.shape):
            body = ", ".join([f"{'' if v else '-'}c({p + 1})" for v, p in zip(values, parents, strict=True)])
            lines.append(f"pr(e({i}) | {body}) = {table[values]}.")
        joint = joint * table.reshape([2 if k in parents else 1 for k in range(n)])
    program, evidence = parse_plog("\n".join(lines)), {f"e({i})": "true" for i in range(1, n + 1)}
    expected = joint.sum(tuple(range(1, n)))[1] / joint.sum()
    circuit = Reasoner(program).compile(["e"], "c(1)")
    assert circuit.network is not None
    assert circuit(evidence)["true"] == pytest.approx(expected, abs=1e-12)
    query = parse_query(f"c(1) | {', '.join([f'obs({term})' for term in evidence])}", program)
    assert Reasoner(program).ask(query)["true"] == pytest.approx(expected, abs=1e-12)


def test_threads_share_a_circuit():
    program = make_network(5, n=14, max_parents=4, zeros=0.0)
    circuit = Reasoner(program).compile(["V1", "V9"], "V13")
    values = program.attributes["V1"].values, program.attributes["V9"].values
    rng = np.random.default_rng(0)
    codes = np.stack([rng.integers(0, len(own), 4000) for own in values], axis=1)
    plan_rows = codes + rng.integers(0, 1, codes.shape)
    alone = circuit(codes)

    def ask(_):
        # distinct rows, as a circuit answers equal ones once
        network = circuit.network
        variables = [network.graph.variable_of[name] for name in ("V13", "V1", "V9")]
        plan = network.find_plan(variables[:1], variables[1:], ())
        weights, _ = plan.evaluate(np.ascontiguousarray(plan_rows), np.zeros((len(plan_rows), 0)))
        return weights / weights.sum(axis=1, keepdims=True)

    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(ask, range(16)):
            np.testing.assert_allclose(found, alone, atol=1e-12)


@pytest.fixture
def only_tables(monkeypatch):
    """Tables wherever a program has them."""
    force_tables(monkeypatch)


@pytest.mark.usefixtures("only_tables")
def test_observations_that_exclude_all_worlds():
    program = parse_plog("s = {x, y, z}. a : s. random(a). b : boolean. random(b). a=x.")
    query = parse_query("b | obs(a=y), obs(a=z)", program)
    for exact in (False, True):
        with pytest.raises(UndefinedError, match="no possible world"):
            Reasoner(program).ask(query, exact=exact)


@pytest.mark.usefixtures("only_tables")
def test_a_tiny_excluded_outcome_is_not_forgotten():
    program = parse_plog(
        "s = {x, y}. a : s. p : boolean. random(p). random(a)."
        "pr(a=x | p) = 1/20000000000. pr(a=x | -p) = 0. :- a=x."
    )
    assert Reasoner(program).exact("p")["true"] == Fraction(19999999999, 39999999999)


def test_a_grid_that_is_too_large_for_the_diagram_is_exact():
    n = 15
    lines = [f"n = {{0..{n - 1}}}. c : n, n -> boolean. random(c(X,Y))."]
    for a, b, p in (("", "", 0.9), ("", "-", 0.6), ("-", "", 0.4), ("-", "-", 0.1)):
        for x in range(1, n):
            lines += [f"pr(c({x},{y}) | {a}c({x - 1},{y}), {b}c({x},{y - 1})) = {p}." for y in range(1, n)]
    # true and false are symmetric, so that without evidence each cell is even
    program = parse_plog("\n".join(lines))
    assert Reasoner(program).posterior(f"c({n - 1},{n - 1})")["true"] == pytest.approx(0.5, abs=1e-12)


def test_an_answer_that_is_too_large_is_sampled(monkeypatch):
    program = make_network(3, zeros=0.0)
    expected = Reasoner(program).posterior("V7", {"V6": "v0"}).probabilities
    monkeypatch.setattr(tables, "MAX_COST", 10.0)
    with pytest.warns(ReasoningWarning) as issued:
        found = Reasoner(program).posterior("V7", {"V6": "v0"})
    assert "sums a table of 12 entries" in str(issued[0].message)
    assert isinstance(found, EstimatedDistribution)
    np.testing.assert_allclose(found.probabilities, expected, atol=0.05)


def test_an_order_without_hope_is_given_up():
    """Two hundred variables, each of which depends on eight others: refused without steps."""
    rng = np.random.default_rng(0)
    scopes = [[*sorted(rng.choice(i, 8, replace=False).tolist()), i] for i in range(8, 200)]
    network = Network([2] * 200, scopes, [np.full(2**9, 0.5)] * len(scopes), list(range(8, 200)))
    plan = network.plan([], list(range(190, 200)), [], True)
    assert plan.cost > 1e12
    assert plan.memory > 2**31
    with pytest.raises(ValueError, match="too large"):
        plan.evaluate(np.zeros((1, 10), np.int64), np.zeros((1, 0)))


def test_marginals_of_a_variable_with_many_children_take_linear_time():
    """A naive Bayes network: the products of all children but one are shared."""
    n, rng = 3000, np.random.default_rng(1)
    table = rng.random((2, 2))
    table /= table.sum(axis=1, keepdims=True)
    scopes = [[0], *[[0, i] for i in range(1, n + 1)]]
    network = Network([2] * (n + 1), scopes, [np.array([0.3, 0.7]), *[table.ravel()] * n], list(range(n + 1)))
    plan = network.plan([], [1, 2, 3], [], True)
    assert plan.cost < 20 * n
    weights, _ = plan.evaluate(np.array([[0, 1, 0]]), np.zeros((1, 0)))
    cause = np.array([0.3, 0.7]) * table[:, 0] ** 2 * table[:, 1]
    cause /= cause.sum()
    pairs = weights.reshape(-1, 2) / weights.reshape(-1, 2).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(pairs[0], cause, atol=1e-12)
    np.testing.assert_allclose(pairs[4:], np.tile(cause @ table, (n - 3, 1)), atol=1e-12)
