"""Fit the numbers of pr-atoms to records by expectation-maximisation.

Source: Dempster, Laird and Rubin, "Maximum likelihood from incomplete data via the EM algorithm", JRSS B
39(1), 1977; for logic programs with random choices: Sato and Kameya, JAIR 15, 2001.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import zip_longest

import numpy as np

from lcorpp.errors import DataError, ProgramError, UndefinedError, check_type
from lcorpp.fitting.expectation import Expectation
from lcorpp.fitting.maximisation import Objective, Progress, climb, count_cases, draw_start
from lcorpp.fitting.number_model import NumberModel, build_number_model, list_free_numbers
from lcorpp.fitting.records import SoftRecord, group_records
from lcorpp.fitting.rewriting import replace_numbers
from lcorpp.fitting.soft_records import SoftExpectation
from lcorpp.fitting.uncertainty import compute_uncertainty
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Number, Probability
from lcorpp.reasoning.resolve import check_at_least
from lcorpp.values import Array

LOG = logging.getLogger(__name__)

SIGNIFICANT_DIGITS = 6
"""Fitted numbers have this many digits."""

MIN_GAIN = 1e-6
"""A random start is kept only if its log likelihood is larger than that of the others by this much."""

_MAX_PRIOR = 1e100
_MAX_EXCLUDED = 1e-9


@dataclass(frozen=True)
class FittedNumber:
    """The number of a pr-atom.

    statement: the pr-atom with the new number.
    old: the number in the program.
    interval: the 95 % interval; None if the data do not determine the number.
    cases: the expected number of times that the pr-atom applied.

    Examples:
        >>> from lcorpp import parse_plog
        >>> from lcorpp.fitting import fit
        >>> program = parse_plog("toss: {heads, tails}. random(toss). pr(toss = heads) = 1/2.")
        >>> number = fit(program, 7 * [{"toss": "heads"}] + 3 * [{"toss": "tails"}]).numbers[0]
        >>> float(number.value), float(number.old), [round(end, 2) for end in number.interval]
        (0.7, 0.5, [0.38, 0.9])
    """

    statement: Probability
    old: Fraction
    interval: tuple[float, float] | None
    cases: float

    @property
    def value(self) -> Fraction:
        """The new number."""
        assert isinstance(self.statement.number, Number)
        return self.statement.number.value

    def __str__(self) -> str:
        head = str(self.statement).rpartition(" = ")[0]
        interval = "not identifiable"
        if self.interval is not None:
            interval = "95 % interval {:.6g} to {:.6g}".format(*self.interval)
        return (
            f"line {self.statement.at.line}: {head} = {self.statement.number}; {interval};"
            f" was {float(self.old):.6g}; {self.cases:.6g} cases"
        )


@dataclass(frozen=True, repr=False)
class Fit:
    """The result of `fit`.

    program: the program with the new numbers.
    numbers: the fitted numbers in the order of their statements.
    n_records: the number of records.
    log_likelihood: of the records, at the numbers before rounding.
    n_undetermined: the number of independent directions in which the records do not determine the numbers.
    iterations: the number of iterations from the start that was kept.
    converged: whether the numbers did not change any more.
    starts: the number of starts.

    Examples:
        >>> from lcorpp import parse_plog
        >>> from lcorpp.fitting import fit
        >>> text = "toss: {heads, tails}. random(toss). pr(toss = heads) = 1/2."
        >>> result = fit(parse_plog(text), 7 * [{"toss": "heads"}] + 3 * [{"toss": "tails"}])
        >>> result.rewrite(text)
        'toss: {heads, tails}. random(toss). pr(toss = heads) = 0.7.'
    """

    program: Program
    numbers: tuple[FittedNumber, ...]
    n_records: int
    log_likelihood: float
    n_undetermined: int
    iterations: int
    converged: bool
    starts: int

    def rewrite(self, text: str) -> str:
        """Replace the numbers in the text of the program; comments and layout remain.

        Raises:
            ProgramError: the text is not that of the program.
        """
        places = {(x.statement.at.line, x.statement.at.column): x for x in self.numbers}
        if len(places) < len(self.numbers):
            raise ProgramError(
                f"{self.program.file}: the pr-atoms do not come from one text; print the program"
            )
        numbers = {place: str(x.statement.number) for place, x in places.items()}
        return replace_numbers(text, numbers, self.program.file)

    def __repr__(self) -> str:
        unknown = sum(x.interval is None for x in self.numbers)
        return (
            f"<Fit of {self.program.file}: {len(self.numbers)} numbers from {self.n_records} records,"
            f" {unknown} not identifiable>"
        )

    def __str__(self) -> str:
        lines = [
            f"{self.n_records} records, log likelihood {self.log_likelihood:.6f},"
            f" {self.iterations} iterations{'' if self.converged else ' (not converged)'}"
            f"{f', the best of {self.starts} starts' if self.starts > 1 else ''}",
            *map(str, self.numbers),
        ]
        if self.n_undetermined:
            lines.append(
                f"The records leave {self.n_undetermined} degrees of freedom of the numbers open: fix some"
                " numbers, or observe more."
            )
        return "\n".join(lines)


def fit(
    program: Program,
    records: Iterable[Mapping[str, str] | SoftRecord],
    *,
    fixed: Collection[str | int] = (),
    prior: float = 0.0,
    starts: int = 1,
    begin: Program | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Fit:
    """Fit the numbers of pr-atoms to records: maximise their likelihood, or the posterior with a prior.

    The numbers 0 and 1, and those computed from variables,
    are fixed.

    Args:
        records: the observed terms of each record, term -> value; others are hidden. A `SoftRecord` has
            likelihoods of some.
        fixed: attributes and lines of the program whose pr-atoms keep their numbers.
        prior: the pseudo-counts of each case: the program's numbers count as this many records in which the
            pr-atoms apply.
        starts: the number of searches: one from the numbers of the program, others from random ones. The most
            likely result is kept, of equal ones the first.
        begin: the program with the numbers of the first search; its own by default.
        seed: of the random numbers.
        progress: is called with the number of steps of a search so far, and the largest change of a number
            in the last.

    Raises:
        DataError: there are no records, or `prior` is negative or beyond 1e100.
        ProgramError: a name is unknown, no number is free, the program has cr-rules, its rules exclude
            worlds (two values of a term, an empty dynamic range), a world violates a condition of the
            language, or `starts` or `seed` is too small.
        UndefinedError: a record is impossible.
        TooLargeError: the program is too large to be compiled.

    Examples:
        >>> from lcorpp import parse_plog
        >>> from lcorpp.fitting import fit
        >>> program = parse_plog("toss: {heads, tails}. random(toss). pr(toss = heads) = 1/2.")
        >>> print(fit(program, 7 * [{"toss": "heads"}] + 3 * [{"toss": "tails"}]))
        10 records, log likelihood -6.108643, 2 iterations
        line 1: pr(toss=heads) = 0.7; 95 % interval 0.376318 to 0.900232; was 0.5; 10 cases
    """
    check_type(program, Program, "program", ProgramError)
    check_type(prior, (int, float), "prior", DataError)
    if not 0 <= prior <= _MAX_PRIOR:
        raise DataError(f"expected a number of pseudo-counts from 0 to {_MAX_PRIOR:g}, not {prior}")
    check_at_least(starts, 1, "starts")
    check_at_least(seed, 0, "seed")
    free = list_free_numbers(program, fixed)
    grouped = group_records(program, records)
    model = build_number_model(program, free, {name for record in grouped.stated for name in record})
    expectation: Expectation | SoftExpectation
    if grouped.parts.shape[1] == 1:
        expectation = Expectation(model, grouped.stated, grouped.repeats)
    else:
        stated = Expectation(model, grouped.stated, np.ones(len(grouped.stated)))
        expectation = SoftExpectation(stated, grouped.parts, grouped.likelihoods, grouped.repeats)
    objective = Objective(model, expectation, prior)
    check_possible(program, expectation.compute(model.evaluate(model.start)).log_p, grouped.places)
    rng = np.random.default_rng(seed)
    best = climb(objective, model.start if begin is None else _read_start(model, program, begin), progress)
    for _ in range(starts - 1):
        other = climb(objective, draw_start(model, rng), progress)
        best = other if other.objective > best.objective + MIN_GAIN else best
    if not best.converged:
        LOG.warning("%s: the numbers still change after %d iterations", program.file, best.n_steps)
    values = model.evaluate(best.parameters)
    expected = expectation.compute(values)
    cases = count_cases(model, values, expected.counts @ expected.repeats)
    intervals, n_undetermined = compute_uncertainty(objective, best.parameters)
    statements, numbers = list(program.statements), []
    for i, number in enumerate(_round(model, best.parameters)):
        index = model.statements[i]
        atom = statements[index]
        assert isinstance(atom, Probability)
        statements[index] = new = replace(atom, number=Number(number, at=atom.number.at))
        numbers.append(FittedNumber(new, free[index], intervals[i], float(cases[i])))
    return Fit(
        program.with_statements(tuple(statements)),
        tuple(numbers),
        int(grouped.repeats.sum()),
        expected.log_likelihood,
        n_undetermined,
        best.n_steps,
        best.converged,
        starts,
    )


def check_possible(program: Program, log_p: Array, places: Sequence[str]) -> None:
    """Check that the numbers of a program are frequencies, and that each record is possible.

    Args:
        log_p: (n + 2,) of `Expected`, at the numbers of the program. places: of the records, for errors.

    Raises:
        ProgramError: the program's rules exclude worlds.
        UndefinedError: a record is impossible.
    """
    excluded = 1 - np.exp(log_p[-2:]).sum()
    if abs(excluded) > _MAX_EXCLUDED:
        raise ProgramError(
            f"{program.file}: rules exclude worlds of measure {excluded:.6g}, such as worlds in which they"
            " derive two values of a term, or in which a dynamic range is empty, so its numbers are not"
            " frequencies and cannot be fitted"
        )
    impossible = np.flatnonzero(np.isinf(log_p[:-2]))
    if len(impossible):
        raise UndefinedError(
            f"{program.file}: {places[impossible[0]]} is in no possible world of positive measure"
        )


def _read_start(model: NumberModel, program: Program, begin: Program) -> Array:
    """Return the numbers of a program that differs in nothing else.

    Raises:
        ProgramError: it differs in something else, or a number is 0 or 1.
    """
    start, free = model.start.copy(), dict(zip(model.statements, range(len(model.statements)), strict=True))
    for index, (own, other) in enumerate(zip_longest(program.statements, begin.statements)):
        if index in free and isinstance(other, Probability) and isinstance(other.number, Number):
            assert isinstance(own, Probability)
            is_same, start[free[index]] = own.left_side == other.left_side, float(other.number.value)
        else:
            is_same = str(own) == str(other)
        if not is_same:
            raise ProgramError(f"{begin.file}: has {other} where {program.file} has {own}")
    if not ((start > 0) & (start < 1)).all():
        raise ProgramError(f"{begin.file}: a number to begin with is 0 or 1; expected one between them")
    return start


def _round(model: NumberModel, parameters: Array) -> list[Fraction]:
    """Round the numbers; where the sum would exceed 1 or has to equal it, change the largest one."""
    numbers = [Fraction(f"{p:.{SIGNIFICANT_DIGITS}g}") for p in parameters]
    for case in model.cases:
        own = dict(zip(case.parameters.tolist(), map(int, case.multiplicities), strict=True))
        excess = sum((m * numbers[i] for i, m in own.items()), start=-case.bound)
        if case.is_full or excess > 0:
            largest = max(own, key=lambda i: numbers[i])
            numbers[largest] -= excess / own[largest]
    return numbers
