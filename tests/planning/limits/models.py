"""Models for the tests of limits."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.optimize import linprog

from lcorpp.planning import Limit, Pomdp


def random_model(rng, states=3, actions=2, observations=2, discount=0.9):
    """Return a dense random model."""
    return Pomdp(
        tuple(f"s{i}" for i in range(states)),
        tuple(f"a{i}" for i in range(actions)),
        tuple(f"o{i}" for i in range(observations)),
        rng.dirichlet(np.ones(states), size=(actions, states)),
        rng.dirichlet(np.full(observations, 0.5), size=(actions, states)),
        rng.normal(size=(actions, states)),
        discount,
        rng.dirichlet(np.ones(states)),
    )


def stage(model, steps):
    """Return a model whose steps are counted by its states, and that ends after some."""
    S, A = len(model.states), len(model.actions)
    n = steps * S + 1
    T, O = np.zeros((A, n, n)), np.zeros((A, n, len(model.observations)))  # noqa: E741
    R = np.zeros((A, n))
    T[:, -1, -1], O[:, :, 0] = 1, 1
    for t in range(steps):
        own = slice(t * S, t * S + S)
        R[:, own] = model.reward
        if t + 1 < steps:
            T[:, own, (t + 1) * S : (t + 2) * S] = model.transition.dense
            O[:, (t + 1) * S : (t + 2) * S] = model.observation.dense
        else:
            T[:, own, -1] = 1
    names = [f"{s}_{t}" for t in range(steps) for s in model.states] + ["end"]
    start = np.concatenate([model.start, np.zeros(n - S)])
    return Pomdp(names, model.actions, model.observations, T, O, R, model.discount, start)


def enumerate_plans(model, steps, limits):
    """Return (plans, 1 + K) return and costs of all deterministic plans of a staged model, by recursion."""
    A, n_obs = len(model.actions), len(model.observations)
    T, O = model.transition.dense, model.observation.dense  # noqa: E741

    def follow(tree, depth, joint, counts, found):
        a = tree[0]
        found[0] += model.discount**depth * (joint @ model.reward[a])
        after = []
        for k, limit in enumerate(limits):
            if limit.kind != "probability":
                factor = model.discount**depth if limit.kind == "discounted" else 1.0
                found[k + 1] += factor * (joint @ limit.cost[a])
                after.append(counts[k])
                continue
            happens = limit.cost[a] > 0
            found[k + 1] += counts[k][-1] @ happens
            raised = [np.zeros_like(joint), *[own * happens for own in counts[k][:-1]]]
            after.append([own * ~happens + up for own, up in zip(counts[k], raised, strict=True)])
        for o in range(n_obs if depth + 1 < steps else 0):
            seen = O[a][:, o]
            moved = [[(own @ T[a]) * seen for own in each] for each in after]
            follow(tree[1][o], depth + 1, (joint @ T[a]) * seen, moved, found)

    def trees(depth):
        if depth == 1:
            return [(a, ()) for a in range(A)]
        below = trees(depth - 1)
        return [(a, own) for a in range(A) for own in product(below, repeat=n_obs)]

    rows = []
    for tree in trees(steps):
        found = np.zeros(1 + len(limits))
        counts = [[model.start, *[np.zeros_like(model.start)] * limit.more_than] for limit in limits]
        follow(tree, 0, model.start, counts, found)
        rows.append(found)
    return np.array(rows)


def mix_plans(rows, bounds):
    """Return the largest return of a mixture of plans within bounds; None if there is none."""
    found = linprog(-rows[:, 0], rows[:, 1:].T, bounds, np.ones((1, len(rows))), [1.0], method="highs")
    return -found.fun if found.status == 0 else None


def random_limit(rng, model, name, kind):
    """Return a random limit of a kind."""
    A, S = model.reward.shape
    if kind == "probability":
        cost = np.zeros((A, S))
        cost[rng.integers(A), rng.random(S) < 0.5] = 1
        return Limit(name, cost, float(rng.uniform(0.1, 0.7)), more_than=int(rng.integers(0, 2)))
    cost = rng.random((A, S))
    steps = 1 / (1 - model.discount) if kind == "discounted" else 3
    return Limit(name, cost, float(rng.uniform(0.3, 0.7)) * steps, kind)
