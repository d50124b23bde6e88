"""Rows of counts that share numbers: their sums, and the probabilities that follow from these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.values import Array, Indices


@dataclass(frozen=True, eq=False)
class Ties:
    """Rows (A, K, n), each of one of G groups; the entries of a row, of cells of its group.

    places: (A, K) the group of each row. flat: (A K n,) the group and cell of each entry, as one number.
    members: (G, 1) number of rows. sizes: (G, c) number of entries of all rows.
    """

    places: Indices
    flat: Indices
    members: Array
    sizes: Array

    @classmethod
    def of(cls, groups: Indices, cells: Indices) -> Ties:
        """Return the ties of groups (A, K), any numbers, and cells (A, K, n)."""
        used, places = np.unique(groups, return_inverse=True)
        places = places.reshape(groups.shape)
        width = int(cells.max()) + 1
        flat = (places[:, :, None] * width + cells).ravel()
        sizes = np.bincount(flat, minlength=len(used) * width).reshape(len(used), width)
        return cls(places, flat, np.bincount(places.ravel())[:, None].astype(float), sizes.astype(float))

    def sum(self, counts: Array) -> Array:
        """Return (G, c) the sums of counts (A, K, n)."""
        sums: Array = np.bincount(self.flat, counts.ravel(), self.sizes.size).astype(np.float64)
        return sums.reshape(self.sizes.shape)

    def spread(self, shares: Array) -> Array:
        """Return rows (A, K, n) in which each cell's share (G, c) is divided among its entries."""
        each = shares * self.members / np.maximum(self.sizes, 1.0)
        return each.ravel()[self.flat].reshape(*self.places.shape, -1)
