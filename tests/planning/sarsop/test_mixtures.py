"""The precision at every mixture of some beliefs, e.g. at every prior, and not only at the starts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import spatial
from scipy.optimize import linprog
from scipy.spatial import QhullError

from lcorpp.domains import load_domain
from lcorpp.errors import ModelError
from lcorpp.planning import parse_pomdp, solve
from lcorpp.planning.sarsop import solver
from lcorpp.planning.sarsop.mixtures import find_envelope, find_vertices
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER)
MIXED = np.eye(2)


@pytest.fixture(scope="module", params=[("intention", 5e-4), ("museum", 0.1)])
def problem(request):
    name, precision = request.param
    domain = load_domain(name)
    return domain.pomdp, domain.start_beliefs()[:9], domain.planning.initial_states, precision


def draw_mixtures(mixed, count, seed=0):
    return np.random.default_rng(seed).dirichlet(np.ones(len(mixed)), count) @ mixed


def test_priors_far_from_all_starts_reach_the_precision(problem):
    pomdp, starts, mixed, precision = problem
    before = solve(pomdp, starts, precision=precision)
    after = solve(pomdp, starts, precision=precision, mixed=mixed)
    priors = draw_mixtures(mixed, 300)
    assert max(map(before.gap, priors)) > 10 * precision
    assert max(map(after.gap, priors)) <= precision + 1e-9
    assert after.converged
    assert after.start_count > before.start_count
    for start in starts:
        assert after.gap(start) <= precision + 1e-9
    again = solve(pomdp, starts, precision=precision, mixed=mixed)
    np.testing.assert_array_equal(again.policy.vectors, after.policy.vectors)


def test_the_bound_at_mixtures_is_an_upper_bound(problem):
    pomdp, starts, mixed, precision = problem
    solution = solve(pomdp, starts, precision=precision, mixed=mixed)
    for prior in draw_mixtures(mixed, 5, seed=1):
        optimal = solve(pomdp, prior, precision=1e-4)
        assert solution.policy.upper_bound.value(prior) >= optimal.lower - 1e-9
        assert solution.policy.value(prior) >= optimal.lower - precision


def test_elsewhere_the_bound_is_the_sawtooth():
    domain = load_domain("intention")  # whose robot has not turned at any prior
    mixed = domain.planning.initial_states
    solution = solve(domain.pomdp, precision=0.1, mixed=mixed)
    turned = np.array([0.0, 0.0, 0.5, 0.5, 0.0])
    assert not (mixed[:, 2:].any())
    bound = solution.policy.upper_bound
    assert bound.value(turned) == super(type(bound), bound).value(turned)


def test_a_previous_solution_is_continued_with_mixtures():
    first = solve(tiger, precision=1e-3, mixed=MIXED)
    again = solve(tiger, precision=1e-3, mixed=MIXED, previous=first)
    assert again.trials < first.trials
    for prior in draw_mixtures(MIXED, 100):
        assert again.gap(prior) <= 1e-3 + 1e-9


def test_the_work_limit_leaves_a_gap_and_valid_bounds(monkeypatch):
    monkeypatch.setattr(solver, "MIXTURE_WORK", 0)
    solution = solve(tiger, precision=1e-3, mixed=MIXED)
    fine = solve(tiger, precision=1e-5, mixed=MIXED)
    assert solution.reason == "precision reached"  # at the starts
    assert solution.start_count == 3
    priors = draw_mixtures(MIXED, 100)
    gaps = [solution.gap(prior) for prior in priors]
    assert max(gaps) > 1e-3
    for prior, gap in zip(priors, gaps, strict=True):
        assert fine.policy.value(prior) <= solution.policy.value(prior) + gap + 1e-9


@pytest.mark.parametrize(
    ("mixed", "message"),
    [
        ([0.5, 0.5], "1 beliefs to mix; expected 2 to 4"),
        (np.full((5, 2), 0.5), "5 beliefs to mix; expected 2 to 4"),
        ([[0.5, 0.5], [0.5, 0.5]], "one of the beliefs to mix is a mixture of the others"),
        ([[0.5, 0.5], [1.0, 1.0]], "sum"),
        ([[1.0], [1.0, 0.0]], "mixed must be one belief or several"),
    ],
)
def test_wrong_beliefs_to_mix_are_rejected(mixed, message):
    with pytest.raises(ModelError, match=message):
        solve(tiger, mixed=mixed)


def test_vertices_are_where_the_best_vectors_change():
    found = find_vertices(np.array([[4.0, 0.0], [0.0, 12.0], [1.0, 1.0]]))
    np.testing.assert_allclose(found, [[0, 1], [0.75, 0.25], [1, 0]], atol=1e-12)
    flat = find_vertices(np.zeros((3, 4)))
    np.testing.assert_allclose(flat, np.eye(4)[::-1], atol=1e-12)


@pytest.mark.parametrize("size", [2, 3, 4])
def test_envelope_and_vertices_agree_with_linear_programs(size):
    rng = np.random.default_rng(size)
    weights = np.vstack([np.eye(size), rng.dirichlet(np.ones(size), 30)])
    vectors = 100 * rng.normal(size=(20, size))
    values = (weights @ vectors.T).max(axis=1) + rng.random(len(weights))
    planes, vertices = find_envelope(weights, values), find_vertices(vectors)
    anywhere = rng.dirichlet(np.ones(size), 20)
    for own in anywhere:
        mixture = linprog(values, A_eq=weights.T, b_eq=own)
        assert (planes @ own).max() == pytest.approx(mixture.fun, abs=1e-7)

    def gap(own):
        return (own @ planes.T).max(axis=1) - (own @ vectors.T).max(axis=1)

    assert gap(rng.dirichlet(np.ones(size), 2000)).max() <= gap(vertices).max() + 1e-9


def test_rounding_that_defeats_qhull_is_overcome(monkeypatch):
    options = list[str]()
    hull = spatial.ConvexHull

    def fail_first(points, qhull_options=""):
        options.append(qhull_options)
        if not qhull_options:
            raise QhullError("a wide facet")
        return hull(points, qhull_options=qhull_options)

    monkeypatch.setattr(spatial, "ConvexHull", fail_first)
    planes = find_envelope(np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]]), np.array([4.0, 2.0, 1.0]))
    assert options == ["", "QJ"]
    assert (planes @ [0.75, 0.25]).max() == pytest.approx(2.5, abs=1e-6)
