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

MODELS = ("number", "repeated", "class")
"""Forms of answers that a domain may state."""

MAX_COPIES = 10
"""Maximum number of degrees of noise: of the first, second, ... question."""


@dataclass(frozen=True)
class StatedAnswers:
    """A form of answers with its parameters.

    With the probability of its noise an answer does not depend on the person's value: it is like that of a
    person of a random value. Otherwise it is as the model states.

    form: names the copies of each question. noise: of each group of copies, or class of people; of a repeated
    question, the probability that it has the answer of before. base_noise: of all questions, before the form.
    shares: of the classes of people.
    """

    form: AnswerForm
    noise: tuple[float, ...]
    base_noise: float = 0.0
    shares: tuple[float, ...] = (1.0,)

    def make_tables(self, tables: Array) -> Array:
        """Return (K', V, O) P(observation | value) of all copies, from those of the questions (K, V, O)."""
        form, mean = self.form, tables.mean(axis=1, keepdims=True)
        base = (1 - self.base_noise) * tables + self.base_noise * mean
        classes = range(form.n_classes)
        own = [self.noise[form.find_group(copy) + c] for copy in range(form.n_copies) for c in classes]
        degrees = np.tile(own, len(tables))[:, None, None]
        rows, ends = (np.repeat(t, form.n_classes, axis=0) for t in (form.expand(base), form.find_ends(base)))
        mixed: Array = (1 - degrees) * rows + degrees * ends
        return mixed


def read_answers(table: TomlTable, n_observations: int) -> StatedAnswers:
    """Read `model` and its parameters.

    Args:
        n_observations: of the planner's model.

    Raises:
        DomainError: a key is missing, unknown or has a wrong value.
    """
    from lcorpp.trust.forms import ByClass, ByNumber, Repeated  # few domains state a form

    model = table.text("model")
    if model not in MODELS:
        raise DomainError(f"{table.location('model')}: {model!r}; {expected_one_of(MODELS)}")
    if model == "number":
        degrees = _read_degrees(table, MAX_COPIES, "the first, second, ... question")
        answers = StatedAnswers(ByNumber(len(degrees)), degrees)
    elif model == "class":
        degrees, share = _read_degrees(table, 2, "the two classes of people"), table.number("share", 0, 1)
        answers = StatedAnswers(ByClass(), degrees, shares=(1 - share, share))
    else:
        repeats = table.number("repeats", 0, 1)
        noise = table.number("noise", 0, 1, 0)
        answers = StatedAnswers(Repeated(n_observations), (0.0, repeats), noise)
    table.reject_unknown_keys()
    return answers


def _read_degrees(table: TomlTable, most: int, what: str) -> tuple[float, ...]:
    """Read `noise`, a list with a degree for each of 2 to `most` copies or classes."""
    degrees, location = table.value("noise"), table.location("noise")
    if not isinstance(degrees, list) or not 2 <= len(degrees) <= most:
        count = "2" if most == 2 else f"2 to {most}"
        raise DomainError(f"{location}: expected a list of {count} numbers, for {what}")
    for degree in degrees:
        if isinstance(degree, bool) or not isinstance(degree, int | float) or not 0 <= degree <= 1:
            raise DomainError(f"{location}: {degree!r}; expected numbers from 0 to 1")
    return tuple(map(float, degrees))
