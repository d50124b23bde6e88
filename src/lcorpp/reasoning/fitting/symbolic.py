"""Fractions that remember how they depend on the numbers of pr-atoms.

The compiler computes with them as with other fractions. So each probability of a decision diagram is a
product of affine functions of the free numbers: the number of a pr-atom, or what it leaves for other values.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

Form = tuple[Fraction, tuple[tuple[int, Fraction], ...]]
"""An affine function: the constant, and (parameter, coefficient) for each parameter that it depends on."""


class Affine(Fraction):
    """The value of an affine function of the parameters at the numbers of the program."""

    __slots__ = ("coefficients", "constant")

    coefficients: Mapping[int, Fraction]
    constant: Fraction

    @classmethod
    def create(cls, value: Fraction, constant: Fraction, coefficients: Mapping[int, Fraction]) -> Affine:
        """Create the function with its value."""
        number = super().__new__(cls, value)
        number.constant, number.coefficients = constant, coefficients
        return number

    @classmethod
    def create_parameter(cls, index: int, value: Fraction) -> Affine:
        """Create the function that is the parameter itself."""
        return cls.create(value, Fraction(0), {index: Fraction(1)})

    @property
    def form(self) -> Form:
        """The function without its value."""
        return self.constant, tuple(sorted(self.coefficients.items()))

    def __add__(self, other):  # type: ignore[no-untyped-def]
        coefficients, constant = dict(self.coefficients), Fraction(other)
        if isinstance(other, Affine):
            constant = other.constant
            for index, coefficient in other.coefficients.items():
                coefficients[index] = coefficients.get(index, Fraction(0)) + coefficient
        return Affine.create(Fraction(self) + Fraction(other), self.constant + constant, coefficients)

    __radd__ = __add__

    def __rsub__(self, other):  # type: ignore[no-untyped-def]
        return other + self._scale(Fraction(-1))

    def __truediv__(self, divisor):  # type: ignore[no-untyped-def]
        return self._scale(1 / Fraction(divisor))

    def __mul__(self, other):  # type: ignore[no-untyped-def]
        return Product.create(self, other)

    __rmul__ = __mul__

    def _scale(self, factor: Fraction) -> Affine:
        coefficients = {index: factor * coefficient for index, coefficient in self.coefficients.items()}
        return Affine.create(Fraction(self) * factor, self.constant * factor, coefficients)


class Product(Fraction):
    """The value of a product of affine functions.

    factors: the functions. scale: the constant factor.
    """

    __slots__ = ("factors", "scale")

    factors: tuple[Affine, ...]
    scale: Fraction

    @classmethod
    def create(cls, left: Fraction, right: Fraction) -> Product:
        """Multiply two numbers."""
        (left_factors, left_scale), (right_factors, right_scale) = split(left), split(right)
        number = super().__new__(cls, Fraction(left) * Fraction(right))
        number.factors, number.scale = left_factors + right_factors, left_scale * right_scale
        return number

    def __mul__(self, other):  # type: ignore[no-untyped-def]
        return Product.create(self, other)

    __rmul__ = __mul__


def split(number: Fraction) -> tuple[tuple[Affine, ...], Fraction]:
    """Split a number into affine functions and a constant factor."""
    if isinstance(number, Affine):
        return (number,), Fraction(1)
    if isinstance(number, Product):
        return number.factors, number.scale
    return (), Fraction(number)
