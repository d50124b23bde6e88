"""Answers given each combination of the values of some terms, by one circuit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.reasoner import Reasoner
from lcorpp.values import Array, Indices

MAX_COMBINATIONS = 2**20
"""Maximum number of combinations of the values of all decisions, or of all probabilistic facts."""

MAX_ROWS = 4096
"""Maximum number of combinations that are evaluated together."""


def iter_answers(
    program: Program, inputs: Mapping[str, Sequence[str]], query: Sequence[str]
) -> Iterator[tuple[Indices, dict[str, Array]]]:
    """Iterate over all combinations of values, in parts.

    Args:
        inputs: term -> its values. query: the terms and joints that are asked.

    Yields:
        (n, inputs) the index of each value; and question -> (n, values) its distribution, NaN where the
        combination is impossible.

    Raises:
        TooLargeError: more than `MAX_COMBINATIONS`, or the program is too large to be compiled.
    """
    sizes = [len(values) for values in inputs.values()]
    count = prod(sizes)
    if count > MAX_COMBINATIONS:
        raise TooLargeError(
            f"{program.file}: {count} combinations of {', '.join(list(inputs)[:3])}, ...; expected at most"
            f" {MAX_COMBINATIONS}"
        )
    circuit = Reasoner(program).compile(list(inputs), query) if query else None
    for begin in range(0, count, MAX_ROWS):
        numbers = np.arange(begin, min(count, begin + MAX_ROWS))
        codes = np.array(np.unravel_index(numbers, sizes), np.intp).T if sizes else np.zeros((1, 0), np.intp)
        if circuit is None:
            yield codes, {}
            continue
        pairs = zip(inputs.items(), codes.T, strict=True)
        columns = {term: [values[code] for code in own.tolist()] for (term, values), own in pairs}
        answers: Any = circuit(columns, undefined="nan")
        yield codes, {name: _make_rows(answer, len(codes)) for name, answer in answers.items()}


def _make_rows(answer: Any, count: int) -> Array:
    """(count, values) The answer of a circuit, which is one distribution for one row without inputs."""
    return np.reshape(getattr(answer, "probabilities", answer), (count, -1))
