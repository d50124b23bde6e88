"""Lower and upper probabilities: programs whose total choices have several answer sets (credal semantics)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.files import read_text
from lcorpp.reasoning.choices.combinations import iter_answers
from lcorpp.reasoning.language.parser import MAX_PROGRAM_BYTES, parse_credal
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Literal, Query
from lcorpp.reasoning.questions import name_joint
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class CredalProgram:
    """A program with probabilistic facts, whose total choices may have several answer sets or none.

    program: in which the choices are random, with equal probabilities, and answer sets worlds.
    choices: the term of a choice -> its values with their probabilities.
    """

    program: Program
    choices: Mapping[str, Mapping[str, Fraction]]


class ProbabilityBounds(NamedTuple):
    """Bounds of a probability.

    lower: of the total choices all of whose answer sets satisfy the query. upper: of those some of whose do.
    inconsistent: the probability of total choices without answer set, which the bounds leave out.
    """

    lower: float
    upper: float
    inconsistent: float


def parse_credal_program(text: str, *, file: str = "<text>.lp") -> CredalProgram:
    """Parse a program with probabilistic facts and rules of clingo, given as text.

    Raises:
        ParseError: the text does not follow the grammar, or has a construct that is not translated, by name.

    Examples:
        >>> from lcorpp.reasoning import bound_probability, parse_credal_program, parse_query
        >>> birds = parse_credal_program("0.4::bird. {fly} :- bird.")
        >>> bound_probability(birds, parse_query("{fly}", birds.program))
        ProbabilityBounds(lower=0.0, upper=0.4, inconsistent=0.0)
    """
    program, choices = parse_credal(text, file=file)
    return CredalProgram(program, choices)


def read_credal_program(path: str | Path) -> CredalProgram:
    """Read a program with probabilistic facts and rules of clingo.

    Raises:
        FileError: the file cannot be read. ParseError: as `parse_credal_program`.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.reasoning import read_credal_program
        >>> _ = Path("bird.lp").write_text("1/4::bird. {fly} :- bird.")
        >>> read_credal_program("bird.lp").choices["fact'(1,bird)"]["true"]
        Fraction(1, 4)
    """
    return parse_credal_program(read_text(path, MAX_PROGRAM_BYTES), file=str(path))


def bound_probability(program: CredalProgram, query: Query) -> ProbabilityBounds:
    """Compute the lower and upper probability of a conjunction given observed conjunctions.

    Raises:
        ProgramError: the query or an observation is no conjunction of literals, or has interventions.
        TooLargeError: as of `iter_answers`.
        UndefinedError: no answer set has the observations, or there is none at all.

    Source: Cozman and Maua, IJAR 125, 2020, section 4; given observations the bounds are a / (a + b) with a
    of the query and b of its complement, one lower and one upper.

    Examples:
        >>> from lcorpp.reasoning import bound_probability, parse_credal_program, parse_query
        >>> birds = parse_credal_program("0.4::bird. {fly} :- bird. 0.1::fly.")
        >>> bounds = bound_probability(birds, parse_query("{fly}", birds.program))
        >>> round(bounds.lower, 9), round(bounds.upper, 9)
        (0.1, 0.46)
    """
    asked, observed = _list_literals(program, query)
    sure, possible, no_sure, no_possible, mass = np.zeros(5)
    for weights, yes, no, other, is_consistent in _iter_parts(program, asked, observed):
        sure += weights @ (yes & ~no & ~other)
        possible += weights @ yes
        no_sure += weights @ (no & ~yes & ~other)
        no_possible += weights @ no
        mass += weights @ is_consistent
    if possible + no_possible == 0:
        raise UndefinedError(f"{program.program.file}: no answer set has the observations")
    inconsistent = max(0.0, 1.0 - float(mass))
    inconsistent = 0.0 if inconsistent < 1e-12 else inconsistent
    if not observed:
        return ProbabilityBounds(float(sure / mass), float(possible / mass), inconsistent)
    lower = sure / (sure + no_possible) if sure + no_possible else 1.0
    upper = possible / (possible + no_sure) if possible + no_sure else 0.0
    return ProbabilityBounds(float(lower), float(upper), inconsistent)


def _list_literals(program: CredalProgram, query: Query) -> tuple[list[Literal], list[Literal]]:
    """List the literals of the query and those of its observations."""
    asked = query.formula
    if query.interventions or query.expression is not None or len(asked) != 1:
        raise ProgramError(f"{query}: bounds are of one conjunction, such as {{a, not b}}")
    observed = list[Literal]()
    for observation in query.observations:
        if len(observation.formula) != 1:
            raise ProgramError(f"{query}: observations are conjunctions for bounds")
        observed += observation.formula[0]
    return list(asked[0]), observed


def _iter_parts(
    program: CredalProgram, asked: list[Literal], observed: list[Literal]
) -> Iterator[tuple[Array, Any, Any, Any, Any]]:
    """Iterate over the total choices in parts.

    Yields:
        (n,) their probabilities; whether some answer set has the observations and the query, the observations
        without the query, not the observations; and whether there is one.
    """
    terms = {str(literal.term): literal.term for literal in (*asked, *observed)}
    table = _Table(program.program, list(terms))
    has_asked = np.array([all(table.holds(row, literal) for literal in asked) for row in table.rows])
    has_observed = np.array([all(table.holds(row, literal) for literal in observed) for row in table.rows])
    inputs = {term: list(values) for term, values in program.choices.items()}
    numbers = [np.array([float(p) for p in values.values()]) for values in program.choices.values()]
    for codes, answers in iter_answers(program.program, inputs, [name_joint(list(terms.values()))]):
        (joint,) = answers.values()
        weights = np.prod([own[column] for own, column in zip(numbers, codes.T, strict=True)], axis=0)
        found = np.nan_to_num(joint) > 0
        yield (
            np.broadcast_to(weights, len(codes)),
            found[:, has_asked & has_observed].any(axis=1),
            found[:, ~has_asked & has_observed].any(axis=1),
            found[:, ~has_observed].any(axis=1),
            ~np.isnan(joint).any(axis=1),
        )


class _Table:
    """The rows of a joint distribution: the value of each term."""

    def __init__(self, program: Program, terms: list[str]) -> None:
        self._index = {term: k for k, term in enumerate(terms)}
        ranges = [program.attributes[term.partition("(")[0]].values for term in terms]
        codes = np.indices([len(own) for own in ranges]).reshape(len(ranges), -1).T
        self.rows = [tuple(own[code] for own, code in zip(ranges, row, strict=True)) for row in codes]

    def holds(self, row: tuple[str, ...], literal: Literal) -> bool:
        is_equal = row[self._index[str(literal.term)]] == str(literal.value)
        return (is_equal == (literal.relation == "=")) != literal.negated
