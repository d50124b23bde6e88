"""A reasoner of the user's own code, in place of that of the domain's program."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.errors import DomainError, LcorppError, UndefinedError, expected_one_of
from lcorpp.reasoning import Program
from lcorpp.user_code import UserFunction
from lcorpp.values import Array, Distribution, Label, SharedValue, format_value

SenseRates = Mapping[str, Mapping[str, Mapping[str, float]]]
"""Attribute of a sense -> class -> label -> P(label | class)."""

SUM_TOLERANCE = 1e-6
"""Maximum difference of the sum of an own reasoner's probabilities from 1; they are then scaled to 1."""


class OwnReasoners:
    """The user's ``NAME(program, rates)`` in a file: returns the reasoner of a robot.

    `program` is the domain's with the rules of the robot's classifiers, `rates` are those of its senses:
    their smoothed confusion matrices, see `SenseRates`. The object that NAME returns has a method
    ``posterior(shared, evidence)``: of the shared attribute, or the tuple of several, given attribute ->
    value, or -> `Likelihood` of its values (soft evidence). It returns value -> probability as a mapping or
    a `Distribution`, and raises `UndefinedError` if the evidence is impossible.

    Raises:
        DomainError: the file cannot be loaded, or has no such function.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._function = UserFunction(path, name, DomainError)

    def __repr__(self) -> str:
        return self.source

    @property
    def source(self) -> str:
        """``FILE.py:NAME``, with the path of the file."""
        return f"{self._function.path}:{self._function.name}"

    def __call__(
        self,
        program: Program,
        rates: SenseRates,
        shared: str | tuple[str, ...],
        values: Sequence[SharedValue],
        label_rates: Mapping[str, tuple[tuple[str, ...], Array]],
    ) -> OwnReasoner:
        """Return the reasoner of a robot.

        Args:
            shared: `Domain.shared`. values: `Domain.values`.
            label_rates: attribute of a sense -> its labels, and (V, L) P(label | shared value); for senses of
                shared variables.

        Raises:
            DomainError: the function fails or returns an object without `posterior`.
        """
        reasoner = self._function(program, rates)
        with self._function.locate_failures(self._function.name):
            has_method = callable(getattr(reasoner, "posterior", None))
        if isinstance(reasoner, type) or not has_method:
            what = f"the class {reasoner.__name__}" if isinstance(reasoner, type) else reprlib.repr(reasoner)
            raise DomainError(
                f"{self._function.location}: {self._function.name}() returned {what}; expected an object with"
                " the method posterior(shared, evidence)"
            )
        made_of = (self, program, rates, shared, values, label_rates)
        return OwnReasoner(self._function, reasoner, made_of)


class OwnReasoner:
    """The user's reasoner; its answers are checked, and errors name the user's file and line."""

    def __init__(self, function: UserFunction, reasoner: Any, made_of: tuple[Any, ...]) -> None:
        """made_of: the `OwnReasoners`, and the arguments of its call."""
        self._function, self._reasoner, self._made_of = function, reasoner, made_of
        *_, self._shared, self._values, self._label_rates = made_of

    def __reduce__(self) -> tuple[Any, ...]:
        return _make_again, self._made_of  # another process makes it again: the user's may have no pickle

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution:
        """Return the marginal of the shared variables; see `lcorpp.protocols.Reasoner`.

        Without evidence, it also returns that of the labels of a shared variable's sense, by their rates.

        Raises:
            DomainError: another attribute, or the user's method fails or returns something else.
            UndefinedError: the evidence is impossible.
        """
        wanted = attribute if isinstance(attribute, str) else tuple(attribute)
        if isinstance(wanted, str) and wanted in self._label_rates and not evidence:
            labels, rates = self._label_rates[wanted]
            return Distribution(labels, self._infer({}).probabilities @ rates)
        if wanted != self._shared:
            raise DomainError(
                f"{self._function.location}: a reasoner of one's own answers about"
                f" {format_value(self._shared)} alone, not {format_value(wanted)}"
            )
        return self._infer(evidence)

    def _infer(self, evidence: Mapping[str, Label]) -> Distribution:
        what = "posterior()"
        try:
            with self._function.locate_failures(what):
                answer = self._reasoner.posterior(self._shared, dict(evidence))
                try:
                    return read_marginal(answer, self._values)
                except ValueError as error:
                    problem = f"{reprlib.repr(answer)}; {error}"
        except LcorppError as error:
            if isinstance(error.__cause__, UndefinedError):
                raise error.__cause__ from None
            raise
        where = self._function.file.locate(self._reasoner.posterior, self._function.location)
        raise DomainError(f"{where}: {what} returned {problem}")


def _make_again(own: OwnReasoners, *arguments: Any) -> OwnReasoner:
    return own(*arguments)


def read_marginal(answer: object, values: Sequence[SharedValue]) -> Distribution:
    """Return what a user's reasoner returned as a distribution of `values` in their order.

    Args:
        answer: a `Distribution`, or value -> probability.

    Raises:
        ValueError: it is something else, lacks a value, or its numbers are no probabilities.
    """
    if isinstance(answer, Distribution):
        if answer.values == tuple(values):
            return answer
        answer = dict(answer)
    if not isinstance(answer, Mapping):
        raise ValueError("expected value -> probability")
    known = set(values)
    for value in answer:
        if value not in known:
            raise ValueError(f"{value!r} is no value; {expected_one_of([format_value(v) for v in values])}")
    for value in values:
        if value not in answer:
            raise ValueError(f"{format_value(value)} is missing; expected a probability of each value")
    try:
        numbers = [float(answer[value]) for value in values]
    except (TypeError, ValueError):
        raise ValueError("expected numbers as probabilities") from None
    if not all(-SUM_TOLERANCE <= number <= 1 + SUM_TOLERANCE for number in numbers):
        raise ValueError("expected probabilities from 0 to 1 with the sum 1")
    total = math.fsum(numbers)
    if abs(total - 1) > SUM_TOLERANCE:
        raise ValueError(f"expected probabilities from 0 to 1 with the sum 1; the sum is {total:g}")
    probabilities = np.clip(numbers, 0, None)
    return Distribution(tuple(values), probabilities / probabilities.sum())
