"""Numbers of any size: each has its own exponent, so that none underflows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.reasoning.circuit.matrices import Groups, Index, Matrix
from lcorpp.values import Array

_ZERO_EXPONENT = -(1 << 40)
"""The exponent of 0: smaller than any other."""

_NEGLIGIBLE = -2000
"""Numbers smaller by this exponent do not change a sum."""


@dataclass(frozen=True, slots=True, eq=False)
class ExtendedNumbers:
    """Numbers ``fraction * 2**exponent``; the fraction is 0 or in [1/2, 1)."""

    fraction: Array
    exponent: Index

    @classmethod
    def normalise(cls, numbers: Array, exponents: Index | int = 0) -> ExtendedNumbers:
        """Return the numbers ``numbers * 2**exponents``."""
        fraction, exponent = np.frexp(numbers)
        return cls(fraction, np.where(fraction == 0, _ZERO_EXPONENT, exponents + exponent))

    def __getitem__(self, places: Index | slice) -> ExtendedNumbers:
        return ExtendedNumbers(self.fraction[places], self.exponent[places])

    def __mul__(self, other: ExtendedNumbers) -> ExtendedNumbers:
        return self.normalise(self.fraction * other.fraction, self.exponent + other.exponent)

    def scale(self, exponents: Index | int) -> Array:
        """Divide by ``2**exponents``; the result must not overflow."""
        scaled: Array = np.ldexp(self.fraction, np.maximum(self.exponent - exponents, _NEGLIGIBLE))
        return scaled


class ExtendedArithmetic:
    """The operations of a pass on numbers of any size."""

    def convert(self, numbers: Array) -> ExtendedNumbers:
        """Convert weights."""
        return ExtendedNumbers.normalise(numbers)

    def multiply(self, a: ExtendedNumbers, b: ExtendedNumbers) -> ExtendedNumbers:
        """Multiply the numbers of two branches."""
        return a * b

    def sum(self, groups: Groups, numbers: ExtendedNumbers) -> ExtendedNumbers:
        """(groups, B) Sum the rows (n, B) of each group."""
        largest = np.full((groups.size, numbers.exponent.shape[1]), _ZERO_EXPONENT)
        np.maximum.at(largest, groups.keys, numbers.exponent)
        total = np.zeros(largest.shape)
        np.add.at(total, groups.keys, numbers.scale(largest[groups.keys]))
        return ExtendedNumbers.normalise(total, largest)

    def apply(self, matrix: Matrix, columns: ExtendedNumbers) -> ExtendedNumbers:
        """(rows, B) Multiply columns (columns, B) by a matrix."""
        exponents = 0 if matrix.exponents is None else matrix.exponents[:, None]
        weights = ExtendedNumbers.normalise(matrix.weights[:, None], exponents)
        return self.sum(matrix.rows, weights * columns[matrix.columns.keys])

    def get_ratios(self, numbers: ExtendedNumbers) -> Array:
        """Return numbers of which only the ratios within a column matter."""
        return numbers.scale(numbers.exponent.max(axis=0))

    def get_root(self, numbers: ExtendedNumbers) -> ExtendedNumbers:
        """Return the output of the last layer in absolute size."""
        return numbers
