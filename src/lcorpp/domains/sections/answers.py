"""The `[planning.answers]` section of a domain: how answers depend on earlier questions and answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.values import Array

if TYPE_CHECKING:
    from lcorpp.trust.forms import AnswerForm

MODELS = ("number", "repeated")
"""Forms of answers that a domain may state."""

MAX_COPIES = 10
"""Maximum number of degrees of noise: of the first, second, ... question."""


@dataclass(frozen=True)
class StatedAnswers:
    """A form of answers with its parameters.

    With the probability of its noise an answer does not depend on the person's value: it is like that of a
    person of a random value. Otherwise it is as the model states.

    form: names the copies of each question. noise: of each group of copies; of a repeated question, the
    probability that it has the answer of before. base_noise: of all questions, before the form.
    """

    form: AnswerForm
    noise: tuple[float, ...]
    base_noise: float = 0.0

    def make_tables(self, tables: Array) -> Array:
        """Return (K', V, O) P(observation | value) of all copies, from those of the questions (K, V, O)."""
        form, mean = self.form, tables.mean(axis=1, keepdims=True)
        base = (1 - self.base_noise) * tables + self.base_noise * mean
        own = np.array([self.noise[form.find_group(copy)] for copy in range(form.n_copies)])
        degrees = np.tile(own, len(tables))[:, None, None]
        mixed: Array = (1 - degrees) * form.expand(base) + degrees * form.find_ends(base)
        return mixed


def read_answers(table: TomlTable, n_observations: int) -> StatedAnswers:
    """Read `model` and its parameters.

    Args:
        n_observations: of the planner's model.

    Raises:
        DomainError: a key is missing, unknown or has a wrong value.
    """
    from lcorpp.trust.forms import ByNumber, Repeated  # few domains state a form

    model = table.text("model")
    if model not in MODELS:
        raise DomainError(f"{table.location('model')}: {model!r}; {expected_one_of(MODELS)}")
    if model == "number":
        degrees = _read_degrees(table)
        answers = StatedAnswers(ByNumber(len(degrees)), degrees)
    else:
        repeats = table.number("repeats", 0, 1)
        noise = table.number("noise", 0, 1, 0)
        answers = StatedAnswers(Repeated(n_observations), (0.0, repeats), noise)
    table.reject_unknown_keys()
    return answers


def _read_degrees(table: TomlTable) -> tuple[float, ...]:
    """Read `noise`, a list with the degree of the first, second, ... question."""
    degrees, location = table.value("noise"), table.location("noise")
    if not isinstance(degrees, list) or not 2 <= len(degrees) <= MAX_COPIES:
        raise DomainError(
            f"{location}: expected a list of 2 to {MAX_COPIES} numbers, for the first, second, ... question"
        )
    for degree in degrees:
        if isinstance(degree, bool) or not isinstance(degree, int | float) or not 0 <= degree <= 1:
            raise DomainError(f"{location}: {degree!r}; expected numbers from 0 to 1")
    return tuple(map(float, degrees))
