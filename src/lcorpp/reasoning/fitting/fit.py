"""Fit the numbers of pr-atoms to records by expectation-maximisation.

Source: Dempster, Laird and Rubin, "Maximum likelihood from incomplete data via the EM algorithm", JRSS B
39(1), 1977; for logic programs with random choices: Sato and Kameya, JAIR 15, 2001.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from lcorpp.errors import DataError, ProgramError, UndefinedError, check_type, expected_one_of
from lcorpp.reasoning.fitting.expectation import Expectation
from lcorpp.reasoning.fitting.maximisation import (
    compute_prior_counts,
    count_cases,
    group_parameters,
    maximise,
)
from lcorpp.reasoning.fitting.number_model import (
    NumberModel,
    build_number_model,
    list_free_statements,
)
from lcorpp.reasoning.fitting.rewriting import replace_numbers
from lcorpp.reasoning.fitting.uncertainty import compute_uncertainty
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Number, Probability
from lcorpp.reasoning.resolve import name_value, resolve_evidence
from lcorpp.values import Array

LOG = logging.getLogger(__name__)

MAX_ITERATIONS = 10_000
"""Expectation-maximisation ends after this many iterations."""

TOLERANCE = 1e-9
"""It ends when no number changes by more than this."""

SIGNIFICANT_DIGITS = 6
"""Fitted numbers have this many digits."""

_MAX_MASS_ERROR = 1e-9


@dataclass(frozen=True)
class FittedNumber:
    """The number of a pr-atom.

    statement: the pr-atom with the new number.
    old: the number in the program.
    interval: the 95 % interval; None if the data do not determine the number.
    cases: the expected number of times that the pr-atom applied.
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
    iterations: the number of iterations.
    converged: whether the numbers did not change any more.
    """

    program: Program
    numbers: tuple[FittedNumber, ...]
    n_records: int
    log_likelihood: float
    n_undetermined: int
    iterations: int
    converged: bool

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
            f" {self.iterations} iterations{'' if self.converged else ' (not converged)'}",
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
    records: Iterable[Mapping[str, str]],
    *,
    fixed: Collection[str | int] = (),
    prior: float = 0.0,
) -> Fit:
    """Fit the numbers of pr-atoms to records: maximise their likelihood, or the posterior with a prior.

    The search begins at the numbers of the program. The numbers 0 and 1, and those computed from variables,
    are fixed.

    Args:
        records: the observed terms of each record, term -> value; others are hidden.
        fixed: attributes and lines of the program whose pr-atoms keep their numbers.
        prior: the pseudo-counts of each case: the program's numbers count as this many records in which the
            pr-atoms apply.

    Raises:
        DataError: there are no records, or `prior` is negative.
        ProgramError: a name is unknown, no number is free, the program has cr-rules, constraints or
            observations exclude worlds of it, or a world violates a condition of the language.
        UndefinedError: a record is impossible.
        TooLargeError: the program is too large to be compiled.
    """
    check_type(program, Program, "program", ProgramError)
    check_type(prior, (int, float), "prior", DataError)
    if not prior >= 0 or not np.isfinite(prior):
        raise DataError(f"expected a number of pseudo-counts that is at least 0, not {prior}")
    if program.has_cr_rules:
        raise ProgramError(f"{program.file}: the numbers of a program with cr-rules cannot be fitted")
    free = list_free_statements(program, _resolve_fixed(program, fixed))
    if not free:
        raise ProgramError(f"{program.file}: no pr-atom has a number that is free; see `fixed`")
    distinct, first, repeats = _group_records(program, records)
    model = build_number_model(program, free, {name: None for record in distinct for name in record})
    groups = group_parameters(program, model)
    _check_mass(program, model)
    expectation, prior_counts = Expectation(model, distinct), compute_prior_counts(model, prior)
    parameters, converged, iterations = model.start, False, 0
    while not converged and iterations < MAX_ITERATIONS:
        log_p, counts = expectation.compute(parameters)
        if not iterations and not np.isfinite(log_p).all():
            row = first[int(np.flatnonzero(~np.isfinite(log_p))[0])]
            raise UndefinedError(f"{program.file}: record {row} is in no possible world of positive measure")
        following = maximise(model, groups, parameters, counts @ repeats + prior_counts)
        converged = bool(np.abs(following - parameters).max() < TOLERANCE)
        parameters, iterations = following, iterations + 1
    if not converged:
        LOG.warning("%s: the numbers still change after %d iterations", program.file, iterations)
    log_p, counts = expectation.compute(parameters)
    cases = count_cases(model, groups, parameters, counts @ repeats)
    uncertainty = compute_uncertainty(model, expectation, repeats, prior_counts, parameters, cases)
    statements = list(program.statements)
    numbers = []
    rounded = _round(model, parameters)
    for i, index in enumerate(free):
        old = statements[index]
        assert isinstance(old, Probability)
        assert isinstance(old.number, Number)
        statements[index] = new = replace(old, number=Number(rounded[i], at=old.number.at))
        numbers.append(FittedNumber(new, old.number.value, uncertainty.intervals[i], float(cases[i])))
    return Fit(
        Program(program.file, tuple(statements), program.semantics),
        tuple(numbers),
        int(repeats.sum()),
        float(log_p @ repeats),
        uncertainty.n_undetermined,
        iterations,
        converged,
    )


def _resolve_fixed(program: Program, fixed: Collection[str | int]) -> set[int]:
    """Return the indexes of the pr-atoms of attributes, and of those at lines."""
    if isinstance(fixed, str):
        raise ProgramError(f"expected a list of attributes and lines, not {fixed!r}")
    atoms = [(i, s) for i, s in enumerate(program.statements) if isinstance(s, Probability)]
    indexes: set[int] = set()
    for selector in fixed:
        own = {i for i, atom in atoms if selector in (atom.term.name, atom.at.line)}
        if not own:
            names = list(dict.fromkeys(atom.term.name for _, atom in atoms))
            raise ProgramError(
                f"{program.file}: {selector!r} is neither an attribute with pr-atoms nor the line of one;"
                f" {expected_one_of(names)}"
            )
        indexes |= own
    return indexes


def _group_records(
    program: Program, records: Iterable[Mapping[str, str]]
) -> tuple[list[dict[str, str]], list[int], Array]:
    """Return the distinct records with canonical names, the number of the first of each, and their counts."""
    numbers: dict[frozenset[tuple[str, Any]], tuple[int, int]] = {}  # record -> (first, count)
    distinct: list[dict[str, str]] = []
    resolved: dict[tuple[str, Any], tuple[str, str]] = {}  # a term and its value -> with canonical names
    for row, record in enumerate(records, start=1):
        check_type(record, Mapping, f"record {row}", ProgramError)
        try:
            key: frozenset[tuple[str, Any]] = frozenset(
                [(name, name_value(value)) for name, value in record.items()]
            )
        except TypeError:  # an unhashable value
            raise ProgramError(
                f"record {row}: expected a mapping from terms to values, not {record!r}"
            ) from None
        first, count = numbers.get(key, (row, 0))
        numbers[key] = first, count + 1
        if count:
            continue
        try:
            for item in key - resolved.keys():
                (resolved[item],) = resolve_evidence(program, {item[0]: item[1]}).items()
            facts = dict([resolved[item] for item in key])
            if len(facts) < len(key):  # two names of a term
                facts = resolve_evidence(program, record)
        except ProgramError as error:
            raise ProgramError(f"record {row}: {error}") from None
        distinct.append(facts)
    if not numbers:
        raise DataError("there are no records")
    counts = np.array([float(count) for _, count in numbers.values()])
    return distinct, [first for first, _ in numbers.values()], counts


def _check_mass(program: Program, model: NumberModel) -> None:
    """Check that the measures of the worlds sum to 1.

    Otherwise the likelihood of a record also depends on the worlds that the program excludes.
    """
    (log_mass,), _ = Expectation(model, [{}]).compute(model.start)
    if not abs(np.exp(log_mass) - 1) < _MAX_MASS_ERROR:
        raise ProgramError(
            f"{program.file}: constraints, observations or rules exclude worlds of measure"
            f" {1 - np.exp(log_mass):.6g}, so its numbers are not frequencies in records and cannot be"
            " fitted; observations belong into the records"
        )


def _round(model: NumberModel, parameters: Array) -> list[Fraction]:
    """Round the numbers; where the sum would exceed 1 or has to equal it, change the largest one."""
    numbers = [Fraction(f"{p:.{SIGNIFICANT_DIGITS}g}") for p in parameters]
    for case in model.cases:
        excess = sum((m * numbers[i] for i, m in case.multiplicities), start=-case.bound)
        if case.is_full or excess > 0:
            largest, multiplicity = max(case.multiplicities, key=lambda item: numbers[item[0]])
            numbers[largest] -= excess / multiplicity
    return numbers
