"""Random Bayesian networks as text of BIF files, and their joint distributions."""

from __future__ import annotations

import numpy as np

from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork
from lcorpp.reasoning.language.networks.bif import parse_bif
from lcorpp.values import Array


def make_network(
    seed: int, n: int = 8, max_parents: int = 3, zeros: float = 0.2, max_values: int = 4
) -> BayesianNetwork:
    """Make a network of n variables of a few values, whose tables have zeros."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, max_values + 1, n) if max_values > 2 else np.full(n, 2)
    parts = [
        f"variable V{i} {{ type discrete [ {size} ] {{ {', '.join(f'v{k}' for k in range(size))} }}; }}"
        for i, size in enumerate(sizes)
    ]
    for i in range(n):
        parents = sorted(rng.choice(i, min(i, int(rng.integers(0, max_parents + 1))), replace=False).tolist())
        rows = []
        for combination in np.ndindex(*[int(sizes[p]) for p in parents]):
            numbers = rng.integers(1, 1000, sizes[i]) * (rng.random(sizes[i]) > zeros)
            numbers[rng.integers(sizes[i])] += 1
            shares = numbers / numbers.sum()
            values = ", ".join([repr(float(share)) for share in shares])
            key = ", ".join([f"v{k}" for k in combination])
            rows.append(f"({key}) {values};" if parents else f"table {values};")
        given = f" | {', '.join(f'V{p}' for p in parents)}" if parents else ""
        parts.append(f"probability ( V{i}{given} ) {{ {' '.join(rows)} }}")
    return parse_bif("\n".join(parts), file=f"random{seed}.bif")


def compute_joint(network: BayesianNetwork) -> Array:
    """Multiply all tables out: an axis for each variable in the order of declaration."""
    names = list(network.attributes)
    joint = np.ones([len(network.attributes[name].values) for name in names])
    for name, table in network.tables.items():
        axes = [names.index(v) for v in (*table.parents, name)]
        order = np.argsort(axes)
        shape = [joint.shape[i] if i in axes else 1 for i in range(len(names))]
        joint = joint * table.probabilities.transpose(order).reshape(shape)
    return joint
