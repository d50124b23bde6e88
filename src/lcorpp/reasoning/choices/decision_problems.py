"""Decisions with utilities: the choice of highest expected utility, for programs of DTProbLog."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcorpp.errors import UndefinedError
from lcorpp.files import read_text
from lcorpp.reasoning.choices.combinations import iter_answers
from lcorpp.reasoning.language.parser import MAX_PROGRAM_BYTES, parse_decisions
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.translation.problog_decisions import Utility
from lcorpp.values import Array, Indices


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

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.reasoning import read_decision_problem
        >>> _ = Path("day.pl").write_text("?::walk. utility(walk, 1).")
        >>> read_decision_problem("day.pl").decisions
        {'walk': "decision'(walk)"}
    """
    return parse_decision_problem(read_text(path, MAX_PROGRAM_BYTES), file=str(path))


def choose_decisions(problem: DecisionProblem) -> BestDecisions:
    """Return the decisions of highest expected utility: exact, all combinations are compared.

    Raises:
        TooLargeError: as of `iter_answers`.
        UndefinedError: the evidence is impossible.

    Examples:
        >>> from lcorpp.reasoning import choose_decisions, parse_decision_problem
        >>> text = "0.4::sun. ?::walk. fun :- sun, walk. utility(fun, 5). utility(walk, -1)."
        >>> problem = parse_decision_problem(text)
        >>> best = choose_decisions(problem)
        >>> best.choices, best.utility
        ({'walk': True}, 1.0)
    """
    inputs = dict.fromkeys(problem.decisions.values(), ("false", "true"))
    terms = [each.term for each in problem.utilities]
    parts, found = list[Indices](), list[Array]()
    for codes, answers in iter_answers(problem.program, inputs, terms):
        own = np.zeros(len(codes))
        for utility in problem.utilities:
            index = problem.program.attributes[utility.term].values.index("true")
            own += utility.number * answers[utility.term][:, index]
        parts.append(codes)
        found.append(own)
    taken, utilities = np.concatenate(parts), np.concatenate(found)
    possible = np.flatnonzero(~np.isnan(utilities))
    if not len(possible):
        raise UndefinedError(f"{problem.program.file}: no possible world has the evidence")
    # of equal ones, up to rounding errors, those of fewer decisions come first
    scaled = utilities[possible] / (np.abs(utilities[possible]).max() or 1.0)
    order = possible[np.lexsort((taken[possible].sum(axis=1), -np.round(scaled, 12)))]
    choices = [dict(zip(problem.decisions, map(bool, row), strict=True)) for row in taken[order[:2]].tolist()]
    if len(order) == 1:
        return BestDecisions(choices[0], float(utilities[order[0]]), None, {})
    best, following = utilities[order[:2]].tolist()
    return BestDecisions(choices[0], best, best - following, choices[1])
