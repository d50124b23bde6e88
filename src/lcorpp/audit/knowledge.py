"""Fits of some numbers of the knowledge to people's answers, the others as stated."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg import null_space

from lcorpp.audit.answer_rates import AnswerRates, invert
from lcorpp.fitting.expectation import Expectation, Expected
from lcorpp.fitting.maximisation import Objective, climb, draw_start
from lcorpp.fitting.number_model import NumberModel, build_number_model
from lcorpp.fitting.numbers import check_possible
from lcorpp.fitting.soft_records import SoftExpectation
from lcorpp.fitting.uncertainty import MIN_FORM
from lcorpp.latent_classes import normalise_logs
from lcorpp.reasoning import Program
from lcorpp.reasoning.language.syntax import Body, Number, Probability, Selection, Statement, Term
from lcorpp.values import Array

PRIOR_PEOPLE = 1.0
"""Weight of the stated numbers of each case, in people: enough to keep estimates off 0 and 1."""

COMPARISON_TOLERANCE, FINAL_TOLERANCE = 1e-4, 1e-7
"""Searches from several starts are compared when no number changes by more than the first in a step; the best
continues until none changes by more than the second."""

INTERIOR_SHARE = 0.02
"""Where stated numbers are 0, or leave nothing, a search begins this far on the way to equal shares."""

EXCLUDED_SHARE = 1e-3
"""If the stated numbers exclude people, those that are 0, or leave nothing, are taken this far on the way."""


MIN_WEIGHT = 1e-6
"""Weights of a likelihood ratio below this share of the largest are of directions without freedom."""


@dataclass(frozen=True, eq=False)
class NumbersFit:
    """The most probable numbers of some pr-atoms, with the others as stated.

    statements: their indexes in the program. stated, estimates: (k,). covariance: (k, k), the uncertainty of
    senses and answers included. known_covariance: (k, k) if the rates of senses and answers were known, the
    inverse of the information. prior_variance: (k,) without data.
    log_likelihood: of the people's facts, labels and answers.
    """

    statements: tuple[int, ...]
    stated: Array
    estimates: Array
    covariance: Array
    known_covariance: Array
    prior_variance: Array
    log_likelihood: float


class KnowledgeFits:
    """Fits of numbers to the cases of `AnswerRates`.

    The shared value is hidden; what is known of it is the likelihood of labels and answers, under the rates
    estimated without the knowledge. Their uncertainty is added to that of the numbers (two-step estimation).

    Source: Murphy and Topel, "Estimation and inference in two-step econometric models", Journal of Business
    and Economic Statistics 3(4), 1985.

    Args:
        free: index of a statement -> its number.
        records: canonical term -> value, for each context and value of the shared variables.
        parts: (n, V) the record of each case and value.
        given: whether the facts of each case are given, so that the likelihood conditions on the facts.
    """

    def __init__(
        self,
        program: Program,
        free: Mapping[int, Fraction],
        records: Sequence[Mapping[str, str]],
        parts: npt.NDArray[np.intp],
        rates: AnswerRates,
        *,
        given: bool = False,
    ) -> None:
        self.free, self._program, self._records = free, program, records
        self._parts, self._rates, self._given = parts, rates, given
        self._fits: dict[tuple[int, ...], NumbersFit] = {}
        self._full = [
            tuple(self._compiled.statements[k] for k in case.parameters)
            for case in self._compiled.cases
            if case.is_full
        ]

    @cached_property
    def _compiled(self) -> NumberModel:
        """The program with all numbers as parameters; no outcome is left out because its number is 0."""
        observed = {name for record in self._records for name in record}
        statements, inside = list(self._program.statements), dict(self.free)
        certain, sums = set[object](), dict[object, Fraction]()
        ranges = {s.term.name for s in statements if isinstance(s, Selection) and s.range}
        for i, number in self.free.items():
            case = _get_case(statements[i])
            sums[case] = sums.get(case, Fraction()) + number
            if number == 0 or (sums[case] == 1 and case[0].name not in ranges):
                certain.add(case)
        for i, number in self.free.items():
            atom = statements[i]
            assert isinstance(atom, Probability)
            if _get_case(atom) in certain:
                equal = Fraction(1, len(self._program.attributes[atom.term.name].values))
                inside[i] = number + Fraction(INTERIOR_SHARE) * (equal - number)
                statements[i] = replace(atom, number=Number(inside[i]))
        program = self._program.with_statements(tuple(statements))
        model = build_number_model(program, inside, observed)
        return replace(model, start=np.array(list(map(float, self.free.values()))))

    @cached_property
    def _model(self) -> NumberModel:
        """The compiled program; numbers of cases that exclude people are changed, see `EXCLUDED_SHARE`."""
        if not self.is_excluded.any():
            return self._compiled
        model = replace(self._compiled, start=_find_interior_start(self._compiled, EXCLUDED_SHARE))
        are_possible = ~self._find_excluded(model)
        for case in model.cases:
            start = model.start.copy()
            start[case.parameters] = self._compiled.start[case.parameters]
            if not self._find_excluded(replace(model, start=start))[are_possible].any():
                model = replace(model, start=start)
        return model

    @cached_property
    def excluding(self) -> frozenset[int]:
        """The statements of the numbers by which people are excluded."""
        changed = self._model.start != self._compiled.start
        return frozenset(i for i, own in zip(self._model.statements, changed, strict=True) if own)

    @cached_property
    def is_excluded(self) -> npt.NDArray[np.bool_]:
        """(n,) whether what is known of the case has the probability 0 by the stated numbers."""
        return self._find_excluded(self._compiled)

    def _find_excluded(self, model: NumberModel) -> npt.NDArray[np.bool_]:
        log_p = self._expectation.compute(model.evaluate(model.start)).log_p[:-2]
        return np.asarray(np.isinf(log_p), dtype=bool)

    @cached_property
    def _expectation(self) -> SoftExpectation:
        stated = Expectation(self._compiled, self._records, np.ones(len(self._records)))
        likelihoods, weights = self._rates.likelihoods, self._rates.weights
        return SoftExpectation(stated, self._parts, likelihoods, weights, given=self._given)

    def complete(self, statements: Iterable[int]) -> tuple[int, ...]:
        """Add the numbers that have to change, too, as the numbers of a case sum to 1."""
        own = set(statements)
        while added := {i for case in self._full if own.intersection(case) for i in case} - own:
            own |= added
        return tuple(sorted(own))

    def compute_stated(self) -> float:
        """Compute the log likelihood of the stated numbers, see `EXCLUDED_SHARE`.

        Raises:
            ProgramError: they are not frequencies, as rules exclude worlds.
            UndefinedError: what is known of a person is impossible, whatever the numbers.
        """
        expected = self._expectation.compute(self._model.evaluate(self._model.start))
        first = [self._records[place] for place in self._parts[:, 0]]
        places = [", ".join(f"{name}={value}" for name, value in record.items()) for record in first]
        check_possible(self._program, expected.log_p, [f"a person with the facts of {p}" for p in places])
        return expected.log_likelihood

    def compute_contexts(self, changed: NumbersFit | None = None) -> Array:
        """Compute (X, V) p(value | context) by changed numbers, or as stated, see `EXCLUDED_SHARE`."""
        numbers = self._model.start.copy()
        if changed is not None:
            numbers[np.isin(self._model.statements, changed.statements)] = changed.estimates
        stated = Expectation(self._compiled, self._records, np.ones(len(self._records)))
        logs = stated.compute(self._model.evaluate(numbers)).log_p[:-2]
        return normalise_logs(logs.reshape(-1, self._parts.shape[1]))

    def write_program(self, changed: NumbersFit) -> Program:
        """Return the program with the estimates of a fit; those of a case without a rest sum exactly."""
        numbers = dict(zip(changed.statements, map(Fraction, changed.estimates.tolist()), strict=True))
        for case in self._compiled.cases:
            own = [self._compiled.statements[k] for k in case.parameters]
            if case.is_full and numbers.keys() >= set(own):
                counts = map(int, case.multiplicities)
                total = sum(count * numbers[i] for count, i in zip(counts, own, strict=True))
                numbers |= {i: numbers[i] * case.bound / total for i in own}
        statements = list(self._program.statements)
        for i, number in numbers.items():
            atom = statements[i]
            assert isinstance(atom, Probability)
            statements[i] = replace(atom, number=Number(number))
        return self._program.with_statements(tuple(statements))

    def find_undetermined(self, null: float) -> tuple[int, list[int]]:
        """Find combinations of numbers that are not determined if all numbers are free together.

        Args:
            null: directions with scores smaller than the largest by this factor are not determined.

        Returns:
            The number of such directions, and the statements of the numbers that vary along them.
        """
        model = self._model
        values = model.evaluate(_find_interior_start(model))
        scores = self._compute_scores(self._expectation.compute(values), values)
        basis = self._find_basis(np.arange(len(model.start)))
        _, sizes, rows = np.linalg.svd(scores @ basis * np.sqrt(self._rates.weights)[:, None])
        rank = int((sizes > null * sizes.max(initial=0.0)).sum())
        moves = np.abs(basis @ rows[rank:].T).max(axis=1, initial=0.0)
        return len(rows) - rank, [
            i for i, move in zip(model.statements, moves, strict=True) if move > np.sqrt(null)
        ]

    def fit(
        self, statements: Collection[int], starts: int = 1, *, near: NumbersFit | None = None
    ) -> NumbersFit:
        """Fit the numbers of these statements; the best fit so far is cached.

        Args:
            starts: number of searches, all but the first from random numbers; without effect if it is cached.
            near: a fit of other numbers; the first search begins at its estimates, not at the stated numbers.
        """
        key = tuple(sorted(statements))
        if key not in self._fits or near is not None:
            found = self._fit(key, starts, near)
            self._fits[key] = max(self._fits.get(key, found), found, key=lambda fit: fit.log_likelihood)
        return self._fits[key]

    def _fit(self, statements: tuple[int, ...], starts: int, near: NumbersFit | None) -> NumbersFit:
        model = self._model.restrict(statements)
        model = replace(model, start=_find_interior_start(model))
        objective = Objective(model, self._expectation, PRIOR_PEOPLE)
        rng = np.random.default_rng(0)
        start = model.start if near is None else _copy_estimates(model, near, statements)
        if starts > 1:
            points = [start, *[draw_start(model, rng) for _ in range(starts - 1)]]
            ends = [climb(objective, point, tolerance=COMPARISON_TOLERANCE) for point in points]
            start = max(ends, key=lambda end: end.objective).parameters
        best = climb(objective, start, tolerance=FINAL_TOLERANCE).parameters
        values = model.evaluate(best)
        expected = self._expectation.compute(values)
        places = np.flatnonzero(np.isin(model.statements, statements))
        covariance, known_covariance, prior_covariance = self._find_covariances(
            places, objective.prior, expected, values
        )
        return NumbersFit(
            statements,
            self._compiled.start[places],
            best[places],
            covariance,
            known_covariance,
            np.diag(prior_covariance),
            expected.log_likelihood,
        )

    def _compute_scores(self, expected: Expected, values: Array) -> Array:
        """Compute (n, p) the derivatives of each case's log likelihood by all numbers."""
        forms = self._model.coefficients / np.maximum(values, MIN_FORM)[:, None]  # of the logarithms
        rejected = expected.counts[:, -1] * (expected.repeats[-1] / self._rates.weights.sum())
        scores: Array = (expected.counts[:, :-2].T + rejected) @ forms
        return scores

    def _find_covariances(
        self, places: npt.NDArray[np.intp], prior_counts: Array, expected: Expected, values: Array
    ) -> tuple[Array, Array, Array]:
        """Return the covariance of some numbers, that with known rates, and that by pseudo-counts alone."""
        rates = self._rates
        scores = self._compute_scores(expected, values)[:, places]
        forms = self._model.coefficients[:, places] / np.maximum(values, MIN_FORM)[:, None]
        weighted = scores * rates.weights[:, None]
        prior = (forms * prior_counts[:, None]).T @ forms
        # the scores that the numbers get through the estimated rates
        nuisance = rates.is_nuisance
        cross = weighted.T @ rates.compute_scores(self._expectation.compute_shares(values))[:, nuisance]
        corrected = scores - rates.scores @ rates.covariance[:, nuisance] @ cross.T
        basis = self._find_basis(places)
        bread = basis @ invert(basis.T @ (weighted.T @ scores + prior) @ basis) @ basis.T
        meat = (corrected * rates.weights[:, None]).T @ corrected + prior
        return bread @ meat @ bread, bread, basis @ invert(basis.T @ prior @ basis) @ basis.T

    def _find_basis(self, places: npt.NDArray[np.intp]) -> Array:
        """Return a basis (k, d) of the directions of k numbers that keep the sums of cases without a rest."""
        full = [case.rest for case in self._model.cases if case.is_full]
        sums = self._model.coefficients[full][:, places]
        basis: Array = null_space(sums[sums.any(axis=1)])
        return basis


def find_ratio_weights(fit: NumbersFit, known: Collection[int]) -> Array:
    """Return the weights of the chi-squared variables whose sum a likelihood ratio with estimated rates is.

    It compares the fit with one of the stated numbers, apart from the `known` ones. The weights are 1
    in directions for which the rates of senses and answers do not matter.

    Source: Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses", Econometrica 57,
    1989, theorem 3.3; here the information and the covariance differ as in Murphy and Topel.
    """
    places = [k for k, i in enumerate(fit.statements) if i not in known]
    block = np.ix_(places, places)
    weights = np.linalg.eigvals(invert(fit.known_covariance[block]) @ fit.covariance[block]).real
    positive: Array = weights[weights > MIN_WEIGHT * weights.max()]
    return positive


def _get_case(atom: Statement) -> tuple[Term, Body]:
    """Return what the pr-atoms that apply together have in common."""
    assert isinstance(atom, Probability)
    return atom.term, atom.body


def _copy_estimates(model: NumberModel, fit: NumbersFit, statements: Collection[int]) -> Array:
    """Return the start of the model with the fit's estimates for some statements, reduced to sums below 1."""
    start = model.start.copy()
    is_copied = np.isin(fit.statements, list(statements))
    start[np.isin(model.statements, np.array(fit.statements)[is_copied])] = fit.estimates[is_copied]
    for case in model.cases:
        limit = float(case.bound) * (1.0 if case.is_full else 1 - INTERIOR_SHARE)
        start[case.parameters] *= min(1.0, limit / float(case.multiplicities @ start[case.parameters]))
    return start


def _find_interior_start(model: NumberModel, share: float = INTERIOR_SHARE) -> Array:
    """Return the stated numbers; the free ones a little different if one is about 0, as no search leaves 0.

    Args:
        share: how far on the way to equal shares.
    """
    values, start = model.evaluate(model.start), model.start.copy()
    for case in model.cases:
        own = start[case.parameters]
        if own.min() < EXCLUDED_SHARE or (values[case.rest] < EXCLUDED_SHARE and not case.is_full):
            equal = float(case.bound) / (case.multiplicities * (len(own) + (not case.is_full)))
            start[case.parameters] = own + share * (equal - own)
    return start
