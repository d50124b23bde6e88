"""Where the nodes of a graph go when it is drawn in layers, and which way its arrows take between them.

Source: Sugiyama, Tagawa and Toda, "Methods for visual understanding of hierarchical system structures", IEEE
Transactions on Systems, Man and Cybernetics, 1981: long arrows pass through a place of their own in every
layer, and layers are ordered by the mean place of their neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lcorpp.values import Array

SWEEPS = 24
"""Times that the layers are ordered anew; the order with the fewest crossings is kept."""

LANE = 0.45
"""Room that a passing arrow takes in a layer, a node taking 1."""


class Layout(NamedTuple):
    """places: (n, 2) layer and height of each node. ways: of each arrow (m, 2) its ends and all it passes."""

    places: Array
    ways: list[Array]


def layout(depths: Sequence[int], arrows: Sequence[tuple[int, int]]) -> Layout:
    """Places for nodes in given layers (n,), and ways for arrows from node to node.

    An arrow within a layer, or from a node to itself, has its two ends alone.
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
        for place, depth in zip(chain[1:-1], between, strict=True):
            layers[depth].append(place)
        count += len(between)
        if depths[low] < depths[high]:
            links += pairwise(chain)
        chains.append(chain if low == source else chain[::-1])
    sizes = np.array([1.0 if place < len(depths) else LANE for place in range(count)])
    heights = _heights(_ordered(layers, links, count), links, sizes)
    layer_of = np.zeros(count)
    for number, layer in enumerate(layers):
        layer_of[layer] = number
    places = np.stack([layer_of, heights], axis=1)
    return Layout(places[: len(depths)], [places[chain] for chain in chains])


def _neighbours(links: list[tuple[int, int]], count: int) -> tuple[list[list[int]], list[list[int]]]:
    """Of each place those it is linked to on its left, and on its right."""
    left: list[list[int]] = [[] for _ in range(count)]
    right: list[list[int]] = [[] for _ in range(count)]
    for low, high in links:
        left[high].append(low)
        right[low].append(high)
    return left, right


def _ordered(layers: list[list[int]], links: list[tuple[int, int]], count: int) -> list[list[int]]:
    """The layers, each in an order that keeps crossings few."""
    sides = _neighbours(links, count)
    best, fewest = layers, _crossings(layers, links)
    now = [list(layer) for layer in layers]
    for sweep in range(SWEEPS):
        side = sides[sweep % 2]
        inner = range(1, len(now)) if sweep % 2 == 0 else range(len(now) - 2, -1, -1)
        rank = np.zeros(count)
        for layer in now:
            rank[layer] = np.linspace(0, 1, len(layer)) if len(layer) > 1 else 0.5
        for number in inner:
            means = {
                node: float(np.mean(rank[side[node]])) if side[node] else rank[node] for node in now[number]
            }
            now[number].sort(key=means.__getitem__)
            rank[now[number]] = np.linspace(0, 1, len(now[number])) if len(now[number]) > 1 else 0.5
        crossings = _crossings(now, links)
        if crossings < fewest:
            best, fewest = [list(layer) for layer in now], crossings
    return best


def _crossings(layers: list[list[int]], links: list[tuple[int, int]]) -> int:
    """How many pairs of links cross."""
    place = {node: i for layer in layers for i, node in enumerate(layer)}
    layer_of = {node: number for number, layer in enumerate(layers) for node in layer}
    crossings = 0
    for number in range(len(layers) - 1):
        ends = np.array([(place[a], place[b]) for a, b in links if layer_of[a] == number])
        if len(ends):
            below, beside = ends[:, 0], ends[:, 1]
            crossings += int(((below[:, None] < below) & (beside[:, None] > beside)).sum())
    return crossings


def _heights(layers: list[list[int]], links: list[tuple[int, int]], sizes: Array) -> Array:
    """(count,) heights near those of the neighbours, with room for each in its layer."""
    left, right = _neighbours(links, len(sizes))
    heights = np.zeros(len(sizes))
    for layer in layers:
        ends = np.cumsum(sizes[layer])
        heights[layer] = ends - sizes[layer] / 2 - ends[-1] / 2
    for sweep in range(SWEEPS):
        for layer in layers if sweep % 2 == 0 else reversed(layers):
            wanted = [
                float(np.mean(heights[[*left[node], *right[node]]]))
                if left[node] or right[node]
                else heights[node]
                for node in layer
            ]
            heights[layer] = _apart(np.array(wanted), sizes[layer])
    return heights


def _apart(wanted: Array, sizes: Array) -> Array:
    """Heights in the given order as close to what is wanted as room allows, by least squares.

    Source: pooling neighbours that violate their order (isotonic regression), once the room is taken off.
    """
    room = np.concatenate([[0.0], np.cumsum((sizes[:-1] + sizes[1:]) / 2)])
    pools: list[tuple[float, int]] = []
    for value in wanted - room:
        pools.append((float(value), 1))
        while len(pools) > 1 and pools[-2][0] >= pools[-1][0]:
            (a, m), (b, n) = pools[-2:]
            pools[-2:] = [((a * m + b * n) / (m + n), m + n)]
    flat: Array = np.concatenate([np.full(n, value) for value, n in pools]) + room
    return flat
