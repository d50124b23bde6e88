"""Models in which questions do not change a hidden value, for the tests of their bounds."""

from __future__ import annotations

from itertools import product

import numpy as np

from lcorpp.planning import Pomdp


def random_questions(
    seed: int, *, values: int = 3, questions: int = 2, signals: int = 2, moves: bool = False
) -> Pomdp:
    """Return a random model: questions with costs, reports, perhaps an action that changes the value."""
    rng = np.random.default_rng(seed)
    n, A = values, questions + values + moves
    T, Z = np.zeros((A, n + 1, n + 1)), np.zeros((A, n + 1, signals + 1))
    R = np.zeros((A, n + 1))
    T[:, n, n] = Z[:, n, signals] = 1
    for a in range(questions):
        T[a, :n, :n] = np.eye(n)
        if a == 1 and seed % 3 == 0:  # values that a question moves, each to another one
            T[a, :n, :n] = np.eye(n)[rng.permutation(n)]
        Z[a, :n, :signals] = rng.dirichlet(np.full(signals, rng.uniform(0.2, 2)), size=n)
        R[a, :n] = -rng.uniform(0.1, 2, size=n if seed % 2 else 1)
    for report in range(values):
        a = questions + report
        T[a, :n, n] = Z[a, :, signals] = 1
        R[a, :n] = rng.uniform(-20, 0, size=n)
        R[a, report] = rng.uniform(5, 10)
    if moves:
        T[-1, :n, :n] = rng.dirichlet(np.ones(n), size=n)
        Z[-1, :n, :signals] = rng.dirichlet(np.ones(signals), size=n)
        R[-1, :n] = -rng.uniform(0, 2, size=n)
    names = [[f"{kind}{i}" for i in range(k)] for kind, k in (("s", n + 1), ("a", A), ("o", signals + 1))]
    start = np.append(rng.dirichlet(np.ones(n)), 0)
    return Pomdp(*map(tuple, names), T, Z, R, float(rng.choice([0.8, 0.9, 0.95])), start)


def exchangeable_values(sizes: tuple[int, ...], *, discount: float = 0.9) -> Pomdp:
    """Return a model with variables of some sizes: questions about each, reports of all together."""
    combinations = list(product(*map(range, sizes)))
    n, A, O = len(combinations), len(sizes) + len(combinations), sum(sizes) + 1  # noqa: E741
    T, Z, R = np.zeros((A, n + 1, n + 1)), np.zeros((A, n + 1, O)), np.zeros((A, n + 1))
    T[:, n, n] = Z[:, n, -1] = 1
    for a, size in enumerate(sizes):
        T[a, :n, :n] = np.eye(n)
        R[a, :n] = -1
        first = sum(sizes[:a])
        for s, combination in enumerate(combinations):
            Z[a, s, first : first + size] = 0.2 / (size - 1)
            Z[a, s, first + combination[a]] = 0.8
    for report in range(n):
        a = len(sizes) + report
        T[a, :n, n] = Z[a, :, -1] = 1
        R[a, :n] = -10
        R[a, report] = 10
    names = [[f"{kind}{i}" for i in range(k)] for kind, k in (("s", n + 1), ("a", A), ("o", O))]
    return Pomdp(*map(tuple, names), T, Z, R, discount, np.append(np.full(n, 1 / n), 0))


def sharpening_sensor(values: int, steps: int) -> Pomdp:
    """Return a model of exchangeable values with a sensor that becomes better with each use."""
    n, A, O = values * steps, 1 + values, values + 1  # noqa: E741
    T, Z, R = np.zeros((A, n + 1, n + 1)), np.zeros((A, n + 1, O)), np.zeros((A, n + 1))
    T[:, n, n] = Z[:, n, -1] = 1
    for step, value in product(range(steps), range(values)):
        s = step * values + value
        T[0, s, min(step + 1, steps - 1) * values + value] = 1
        right = 0.4 + 0.5 * step / max(steps - 1, 1)
        Z[0, s, :values] = (1 - right) / (values - 1)
        Z[0, s, value] = right
        R[0, s] = -0.5
        T[1:, s, n] = Z[1:, s, -1] = 1
        R[1:, s] = -10
        R[1 + value, s] = 10
    names = [[f"{kind}{i}" for i in range(k)] for kind, k in (("s", n + 1), ("a", A), ("o", O))]
    return Pomdp(
        *map(tuple, names), T, Z, R, 0.95, np.append(np.full(values, 1 / values), np.zeros(n - values + 1))
    )


def two_hidden_blocks(paid: float) -> Pomdp:
    """Return a model of a question about two values, and an action that leads to four others.

    Which of the four it is remains hidden and does not matter: each step pays as much.
    """
    n, A = 7, 4
    T, Z, R = np.zeros((A, n, n)), np.zeros((A, n, 4)), np.zeros((A, n))
    T[:, 6, 6] = Z[:, 6, 3] = 1
    T[:, 2:6, 2:6] = np.eye(4)
    Z[:, 2:6, 2] = Z[:, :2, 0] = 1
    R[:, 2:6] = paid
    T[0, :2, :2] = np.eye(2)
    Z[0, :2, :2] = [[0.8, 0.2], [0.2, 0.8]]
    R[0, :2] = -0.1
    for report in range(2):
        T[1 + report, :2, 6] = 1
        R[1 + report, :2] = -10
        R[1 + report, report] = 10
    T[3, :2, 2:6] = 0.25
    names = [tuple(f"{kind}{i}" for i in range(k)) for kind, k in (("s", n), ("a", A), ("o", 4))]
    return Pomdp(*names, T, Z, R, 0.95, np.array([0.5, 0.5, 0, 0, 0, 0, 0]))


def values_without_end(values: int, right: float, discount: float) -> Pomdp:
    """Return a model of a question about exchangeable values; after a report a new value is drawn."""
    n, A = values, 1 + values
    T, Z, R = np.full((A, n, n), 1 / n), np.full((A, n, n), 1 / n), np.full((A, n), -10.0)
    T[0] = np.eye(n)
    Z[0] = (1 - right) / (n - 1)
    Z[0][np.diag_indices(n)] = right
    R[0] = -1
    R[1:][np.diag_indices(n)] = 10
    names = [tuple(f"{kind}{i}" for i in range(k)) for kind, k in (("s", n), ("a", A), ("o", n))]
    return Pomdp(*names, T, Z, R, discount, np.full(n, 1 / n))
