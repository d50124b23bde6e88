"""Decisions with utilities: the choice of highest expected utility, for programs of DTProbLog."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.errors import TooLargeError, UndefinedError
from lcorpp.files import read_text
from lcorpp.reasoning.language.parser import MAX_PROGRAM_BYTES, parse_decisions
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.translation.problog_decisions import Utility
from lcorpp.reasoning.reasoner import Reasoner
from lcorpp.values import Array

MAX_DECISIONS = 20
"""Maximum number of decisions: all their combinations are compared."""

MAX_ROWS = 4096
"""Maximum number of combinations that are evaluated together."""


@dataclass(frozen=True, eq=False)
class DecisionProblem:
    """A program with decisions and utilities.

    program: in which decisions are random, with equal probabilities.
    decisions: a decision as it is written -> its term in the program.
    utilities: a literal, and what is earned where it is true; they add up.
    """

    program: Program
    decisions: Mapping[str, str]
    utilities: tuple[Utility, ...]


@dataclass(frozen=True, eq=False)
class BestDecisions:
    """The decisions of highest expected utility.

    choices: decision -> whether it is taken. utility: expected, given the program's evidence.
    difference: to the expected utility of the next best combination; None without decisions.
    next_choices: of that combination. Of equal ones, those of fewer decisions come first.
    """

    choices: Mapping[str, bool]
    utility: float
    difference: float | None
    next_choices: Mapping[str, bool]


def parse_decision_problem(text: str, *, file: str = "<text>.pl") -> DecisionProblem:
    """Parse a program of DTProbLog given as text: with `?::a` or `decision(a)`, and `utility(a, 3)`.

    Raises:
        ParseError: the text does not follow the grammar, or has a construct that is not translated, by name.

    Examples:
        >>> from lcorpp.reasoning import choose_decisions, parse_decision_problem
        >>> problem = parse_decision_problem('''
        ... 0.3::rain. ?::umbrella. wet :- rain, \\\\+umbrella.
        ... utility(umbrella, -2). utility(wet, -10).
        ... ''')
        >>> best = choose_decisions(problem)
        >>> best.choices, best.utility, round(best.difference, 9)
        ({'umbrella': True}, -2.0, 1.0)
    """
    program, decisions, utilities = parse_decisions(text, file=file)
    return DecisionProblem(program, decisions, utilities)


def read_decision_problem(path: str | Path) -> DecisionProblem:
    """Read a program of DTProbLog.

    Raises:
        FileError: the file cannot be read. ParseError: as `parse_decision_problem`.
    """
    return parse_decision_problem(read_text(path, MAX_PROGRAM_BYTES), file=str(path))


def choose_decisions(problem: DecisionProblem) -> BestDecisions:
    """Return the decisions of highest expected utility: exact, by a circuit over all combinations.

    Raises:
        TooLargeError: more than `MAX_DECISIONS` decisions, or the program is too large to be compiled.
        UndefinedError: the evidence is impossible.
    """
    names, n = list(problem.decisions), len(problem.decisions)
    if n > MAX_DECISIONS:
        raise TooLargeError(f"{problem.program.file}: {n} decisions; expected at most {MAX_DECISIONS}")
    utilities = np.concatenate(list(_iter_utilities(problem)))
    possible = np.flatnonzero(~np.isnan(utilities))
    if not len(possible):
        raise UndefinedError(f"{problem.program.file}: no possible world has the evidence")
    order = possible[np.argsort(-utilities[possible], kind="stable")]
    found = [dict(zip(names, _list_bits(int(code), n), strict=True)) for code in order[:2]]
    if len(order) == 1:
        return BestDecisions(found[0], float(utilities[order[0]]), None, {})
    best, following = (float(utilities[code]) for code in order[:2])
    return BestDecisions(found[0], best, best - following, found[1])


def _iter_utilities(problem: DecisionProblem) -> Iterator[Array]:
    """Iterate over the expected utilities (n,) of all combinations in parts, NaN for impossible ones."""
    terms, n = list(problem.decisions.values()), 2 ** len(problem.decisions)
    if not problem.utilities:
        yield np.zeros(n)
        return
    # of equal combinations those of fewer decisions come first, as a sort of their codes is stable
    circuit = Reasoner(problem.program).compile(terms, [each.term for each in problem.utilities])
    numbers = np.array([each.number for each in problem.utilities])
    for begin in range(0, n, MAX_ROWS):
        codes = range(begin, min(n, begin + MAX_ROWS))
        columns = _make_columns(terms, codes)
        answers: Any = circuit(columns, undefined="nan")
        own = np.zeros(len(codes))
        for utility, number in zip(problem.utilities, numbers, strict=True):
            values = problem.program.attributes[utility.term].values
            own += number * np.reshape(answers[utility.term], (len(codes), -1))[:, values.index("true")]
        yield own


def _make_columns(terms: Sequence[str], codes: Sequence[int]) -> dict[str, list[str]]:
    rows = [_list_bits(code, len(terms)) for code in codes]
    return {term: ["true" if row[k] else "false" for row in rows] for k, term in enumerate(terms)}


def _list_bits(code: int, count: int) -> list[bool]:
    return [bool(code >> k & 1) for k in range(count)]
