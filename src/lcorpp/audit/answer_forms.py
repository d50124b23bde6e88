"""Whether answers depend on earlier ones of the same person: a test of each form of answers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log
from operator import itemgetter

import numpy as np
from scipy.stats import chi2

from lcorpp.audit.answer_rates import AnswerRates
from lcorpp.audit.estimates import FormTest, WrongAnswers
from lcorpp.audit.intervals import compare_log_odds
from lcorpp.audit.logged_people import LoggedPeople
from lcorpp.audit.noisy_copies import NoisyCopies
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.cases import Cases
from lcorpp.trust.forms import AnswerForm, ByClass, ByNumber, Repeated
from lcorpp.values import Array

MIN_ANSWERS = 5.0
"""A copy with fewer answers is not described."""


def list_form_tests(people: LoggedPeople, rates: Sequence[Array]) -> list[FormTest]:
    """Test each form against independent answers by the likelihood ratio.

    The knowledge has no part in it. The rows of each question are free; the noise of each copy moves them
    towards their mean over the values (`ByNumber`), or towards the answer before (`Repeated`). The noise
    rises or falls linearly with the number of the question: one parameter has more power than one a copy.

    Args:
        rates: for each sense (V, L) the stated rates.
    """
    n_observations, tests = people.dialogue.tables.shape[2], list[FormTest]()
    forms: list[AnswerForm] = [ByNumber(), Repeated(n_observations), ByClass()]
    for form in forms:
        answers = form.make_answers(people.dialogue.tables)
        cases = _arrange(people, form, answers)
        noisy = NoisyCopies(people, form, cases, rates)
        directions = _list_directions(form)
        best, rows, noise = max((noisy.fit(own) for own in directions), key=itemgetter(0))
        gain = max(2 * (best - noisy.fit(np.zeros((len(form.groups), 0)))[0]), 0.0)
        degrees = directions[0].shape[1] + form.n_classes - 1
        bic = gain - degrees * log(people.cases.weights.sum())
        if form.n_classes > 1:
            shares = zip(rows[0][0].tolist(), noisy.find_class_rates(rows, noise), strict=True)
            found = tuple(WrongAnswers(c, share, rate, None) for c, (share, rate) in enumerate(shares))
        else:
            own = AnswerRates(answers, rates, cases, len(people.contexts))
            found = tuple(_describe_copies(own, form, people, answers))
        tests.append(FormTest(form.name, gain, degrees, bic, float(chi2.sf(gain, degrees)), found))
    return tests


def _list_directions(form: AnswerForm) -> list[Array]:
    """Return alternative directions (G, P) of the noise of a form's groups."""
    n_groups = len(form.groups)
    if isinstance(form, ByNumber):
        rising = np.linspace(0, 1, n_groups)[:, None]
        return [rising, rising[::-1]]
    return [np.eye(n_groups)[:, 1:]]


def _arrange(people: LoggedPeople, form: AnswerForm, answers: AnswerModel) -> Cases:
    """Return the people with their answers in the cells of a form."""
    shape = people.dialogue.tables.shape
    cases = Cases(len(people.labels), answers.n_answers)
    for context, labels, given in people.answered:
        cases.add(context, labels, form.find_cells(given, shape[0], shape[2]))
    return cases


def _describe_copies(
    rates: AnswerRates, form: AnswerForm, people: LoggedPeople, answers: AnswerModel
) -> Iterator[WrongAnswers]:
    """Yield the rate of wrong answers of each copy, over all questions, with its interval.

    An answer is wrong if it is not the one that the stated model expects most of the person's value. Of
    repeated questions there is one rate, that of answers other than the one before.
    """
    counts, first = rates.count_expected(), 1 + len(people.labels)
    total = sum(counts[rates.tables[table]].sum() for table in range(first, len(rates.tables)))
    is_repeated = isinstance(form, Repeated)
    copies = [[0], list(range(1, form.n_copies))] if is_repeated else [[c] for c in range(form.n_copies)]
    for number, own in enumerate(copies):
        slopes, wrong, n_answers = np.zeros(len(rates.p)), 0.0, 0.0
        for cell in (kind * form.n_copies + c for kind in range(len(people.dialogue.tables)) for c in own):
            for row in rates.list_rows(first + cell):
                value = int(np.flatnonzero(rates.is_of_value[:, row[0]])[0])
                is_again = is_repeated and number > 0
                right = cell % form.n_copies - 1 if is_again else answers.find_expected(cell, value)
                is_wrong = rates.outcome[row] != right
                n, p_wrong = float(counts[row].sum()), float(rates.p[row] @ is_wrong)
                wrong, n_answers = wrong + n * p_wrong, n_answers + n
                slopes[row] += n * rates.p[row] * (is_wrong - p_wrong)
        if n_answers < MIN_ANSWERS:
            continue
        variance = float(slopes @ rates.covariance @ slopes) / n_answers**2
        interval, _ = compare_log_odds(None, wrong / n_answers, variance)
        yield WrongAnswers(number, float(n_answers / total), wrong / n_answers, interval)
