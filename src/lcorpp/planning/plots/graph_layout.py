"""Layered graph layout: positions of nodes, and routes of arrows between them.

Source: Sugiyama, Tagawa and Toda, "Methods for visual understanding of hierarchical system structures", IEEE
Transactions on Systems, Man and Cybernetics, 1981: long arrows have a dummy node in every layer that they
cross, and layers are ordered by the barycentre of their neighbours. No light library does this: networkx
neither orders layers nor routes arrows, and grandalf (GPL) has had no release since January 2023.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lcorpp.values import Array

SWEEPS = 24
"""Number of passes of the ordering; the order with the fewest crossings is returned."""

DUMMY_SIZE = 0.45
"""Height of a dummy node, relative to a node."""


Neighbours = tuple[list[list[int]], list[list[int]]]
"""The left and the right neighbours of each node."""


class Layout(NamedTuple):
    """positions: (n, 2) layer and height of each node. routes: (m, 2) of each arrow: ends and dummy nodes."""

    positions: Array
    routes: list[Array]


def layout_graph(depths: Sequence[int], arrows: Sequence[tuple[int, int]]) -> Layout:
    """Lay out nodes in given layers (n,) and arrows between them.

    The route of an arrow within a layer, or from a node to itself, consists of its two ends.
    """
    layers: list[list[int]] = [[] for _ in range(max(depths) + 1)]
    for node, depth in enumerate(depths):
        layers[depth].append(node)
    chains: list[list[int]] = []
    links: list[tuple[int, int]] = []  # between neighbouring layers, from left to right
    count = len(depths)
    for source, target in arrows:
        low, high = sorted((source, target), key=depths.__getitem__)
        between = range(depths[low] + 1, depths[high])
        chain = [low, *range(count, count + len(between)), high]
        for dummy, depth in zip(chain[1:-1], between, strict=True):
            layers[depth].append(dummy)
        count += len(between)
        if depths[low] < depths[high]:
            links += pairwise(chain)
        chains.append(chain if low == source else chain[::-1])
    sizes = np.array([1.0 if node < len(depths) else DUMMY_SIZE for node in range(count)])
    sides = _find_neighbours(links, count)
    heights = _compute_heights(_order_layers(layers, links, sides), sides, sizes)
    layer_of = np.zeros(count)
    for number, layer in enumerate(layers):
        layer_of[layer] = number
    positions = np.stack([layer_of, heights], axis=1)
    return Layout(positions[: len(depths)], [positions[chain] for chain in chains])


def _find_neighbours(links: list[tuple[int, int]], count: int) -> Neighbours:
    """Return the left and the right neighbours of each node."""
    left, right = ([list[int]() for _ in range(count)] for _ in range(2))
    for low, high in links:
        left[high].append(low)
        right[low].append(high)
    return left, right


def _order_layers(
    layers: list[list[int]], links: list[tuple[int, int]], sides: Neighbours
) -> list[list[int]]:
    """Order each layer so that few links cross."""
    best, fewest = layers, _count_crossings(layers, links)
    current = [list(layer) for layer in layers]
    for sweep in range(SWEEPS):
        side = sides[sweep % 2]
        inner = range(1, len(current)) if sweep % 2 == 0 else range(len(current) - 2, -1, -1)
        rank = np.zeros(len(side))
        for layer in current:
            rank[layer] = _spread(len(layer))
        for number in inner:
            means = {node: np.mean(rank[side[node] or node]) for node in current[number]}
            current[number].sort(key=means.__getitem__)
            rank[current[number]] = _spread(len(current[number]))
        crossings = _count_crossings(current, links)
        if crossings < fewest:
            best, fewest = [list(layer) for layer in current], crossings
    return best


def _spread(count: int) -> Array:
    """Return (count,) equally spaced ranks from 0 to 1."""
    return np.linspace(0, 1, count) if count > 1 else np.array([0.5])


def _count_crossings(layers: list[list[int]], links: list[tuple[int, int]]) -> int:
    """Return the number of crossing pairs of links."""
    index = {node: i for layer in layers for i, node in enumerate(layer)}
    layer_of = {node: number for number, layer in enumerate(layers) for node in layer}
    crossings = 0
    for number in range(len(layers) - 1):
        ends = np.array([(index[a], index[b]) for a, b in links if layer_of[a] == number])
        if len(ends):
            left, right = ends[:, 0], ends[:, 1]
            crossings += int(((left[:, None] < left) & (right[:, None] > right)).sum())
    return crossings


def _compute_heights(layers: list[list[int]], sides: Neighbours, sizes: Array) -> Array:
    """Return (count,) heights close to those of the neighbours, without overlap within a layer."""
    neighbours = [[*left, *right] for left, right in zip(*sides, strict=True)]
    heights = np.zeros(len(sizes))
    for layer in layers:
        ends = np.cumsum(sizes[layer])
        heights[layer] = ends - sizes[layer] / 2 - ends[-1] / 2
    for sweep in range(SWEEPS):
        for layer in layers if sweep % 2 == 0 else reversed(layers):
            wanted = [np.mean(heights[neighbours[node] or node]) for node in layer]
            heights[layer] = _separate(np.array(wanted), sizes[layer])
    return heights


def _separate(wanted: Array, sizes: Array) -> Array:
    """Return non-overlapping heights in the given order, closest to the wanted ones by least squares.

    Isotonic regression (pool adjacent violators) of the wanted heights minus the required offsets.
    """
    offsets = np.concatenate([[0.0], np.cumsum((sizes[:-1] + sizes[1:]) / 2)])
    pools: list[tuple[float, int]] = []
    for value in wanted - offsets:
        pools.append((float(value), 1))
        while len(pools) > 1 and pools[-2][0] >= pools[-1][0]:
            (a, m), (b, n) = pools[-2:]
            pools[-2:] = [((a * m + b * n) / (m + n), m + n)]
    heights: Array = np.concatenate([np.full(n, value) for value, n in pools]) + offsets
    return heights
