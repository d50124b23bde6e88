"""Bins of a score that keep as much information about the class as so few bins can."""

from __future__ import annotations

import numpy as np

from lcorpp.values import Array, Flags

CELLS = 24
"""Number of cells of equal numbers of cases, of which the bins are composed."""

PSEUDO_COUNT = 0.5
"""Of each class in each cell, so that a cell of one class has finite information."""


def choose_edges(scores: Array, is_class: Flags, bins: int) -> Array:
    """Return the edges (B - 1,) of the bins with the largest mutual information with the class.

    With equally frequent classes. Dynamic programming over the cells finds the optimum among all bins that
    are unions of neighbouring cells.

    Args:
        scores: (cases,). is_class: (2, cases) whether a case is of each class.
        bins: B.

    Returns:
        Edges that rise; a score that equals an edge is above it. Scores of fewer different values than bins
        repeat the last edge, so that the last bins but one are empty.

    Source: Fisher, "On grouping for maximum homogeneity", JASA 53, 1958; the information is Jensen and
    Shannon's divergence of the two classes.
    """
    cuts = np.unique(np.quantile(scores, np.linspace(0, 1, CELLS + 1)[1:-1]))
    n = len(cuts) + 1
    cell = np.searchsorted(cuts, scores, side="right")
    counts = np.array([np.bincount(cell[own], minlength=n) for own in is_class]) + PSEUDO_COUNT
    sums = np.concatenate([np.zeros((2, 1)), counts.cumsum(axis=1)], axis=1) / counts.sum(axis=1)[:, None]
    share = sums[:, None, :] - sums[:, :, None]  # (2, n + 1, n + 1) of the cells from i to before j
    mean = share.mean(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = 0.5 * (share * np.log(share / mean)).sum(axis=0)
    gain[~(mean > 0)] = -np.inf  # an empty bin
    best = np.full(n + 1, -np.inf)
    best[0] = 0.0
    origins = []
    for _ in range(min(bins, n)):
        total = best[:, None] + gain
        origins.append(total.argmax(axis=0))
        best = total.max(axis=0)
    chosen, end = list[int](), n
    for origin in reversed(origins):
        end = int(origin[end])
        chosen.append(end)
    edges = cuts[np.array(chosen[-2::-1], np.intp) - 1] if len(chosen) > 1 else cuts[:0]
    missing = bins - 1 - len(edges)
    filler = edges[-1] if len(edges) else float(np.max(scores))
    return np.concatenate([edges, np.full(missing, filler)])
