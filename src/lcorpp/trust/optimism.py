"""The observation model for planning: as stated while that is credible, then optimistic."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lcorpp.latent_classes import sum_log_likelihood
from lcorpp.trust.latent_class_model import LatentClassModel
from lcorpp.values import Array

STATED_SHARES = (1.0, 0.75, 0.5, 0.35, 0.2, 0.1)
"""Shares of the stated rows that are tried."""


def find_planned_rows(model: LatentClassModel, max_loss: float, max_stated_loss: float) -> Array:
    """Return (R, O) rows to plan for: the stated ones while they are credible, else optimistic ones.

    The stated rows are credible, all together, if their log posterior is at most `max_stated_loss` lower than
    that of the estimates: a policy for estimates that differ by chance loses what the stated policy does not.

    Optimistic are the rows of each question as near to the stated ones as is credible: mixtures of estimated
    and stated rows whose log posterior is at most `max_loss` lower, while the other questions have the
    estimated rows. An estimate with too much noise would last otherwise: the robot asks something else, and
    the estimate is never corrected. Rows that are better than stated stay.

    Of the answers in cases that are not kept, the expected log likelihood counts.

    Source of the principle: Lai and Robbins, "Asymptotically efficient adaptive allocation rules", Advances
    in Applied Mathematics 6, 1985 (upper confidence bounds).
    """
    answers, rows = model.answers, model.rows.copy()
    logs = model.compute_log_joint(model.estimates)
    counts, weights = model.cases.answer_counts, model.cases.weights
    likelihood = sum_log_likelihood(logs, weights)
    estimated_logs = model.estimates.log_answers
    questions = answers.list_questions(model.noise)

    def measure_loss(other: Array, changed: Sequence[tuple[npt.NDArray[np.bool_], Array]]) -> float:
        """Return how much lower the log posterior is with other rows, of the changed questions."""
        change = answers.find_log_likelihoods(other) - estimated_logs  # (D, V)
        gain = sum_log_likelihood(logs + counts @ change, weights) - likelihood
        gain += float((model.estimates.past.answers * change).sum())
        with np.errstate(divide="ignore"):  # stated rows may exclude what the estimated ones do not
            for own, prior in changed:
                possible = prior > 0
                gain += float(prior[possible] @ np.log(other[own][possible] / model.rows[own][possible]))
        return -gain

    if measure_loss(answers.stated_rows, questions) <= max_stated_loss:
        return answers.stated_rows
    for question in questions:
        own, _ = question
        estimated, stated = model.rows[own], answers.stated_rows[own]
        if np.ptp(stated, axis=0).sum() <= np.ptp(estimated, axis=0).sum():
            continue
        for share in STATED_SHARES:
            mixed = model.rows.copy()
            mixed[own] = (1 - share) * estimated + share * stated
            if measure_loss(mixed, [question]) <= max_loss:
                rows[own] = mixed[own]
                break
    return rows
