"""The observation model for planning: optimistic where the answers permit it."""

from __future__ import annotations

import numpy as np

from lcorpp.latent_classes import sum_log_likelihood
from lcorpp.trust.latent_class_model import LatentClassModel
from lcorpp.values import Array

STATED_SHARES = (1.0, 0.75, 0.5, 0.35, 0.2, 0.1)
"""Shares of the stated rows that are tried."""


def find_optimistic_rows(model: LatentClassModel, max_loss: float) -> Array:
    """Return (R, O) rows: those of each question as near to the stated ones as is credible.

    Credible are mixtures of estimated and stated rows whose log posterior is at most `max_loss` lower, while
    the other questions have the estimated rows. Of the answers in cases that are not kept, the expected log
    likelihood counts. An estimate with too much noise would last otherwise: the robot asks something else,
    and the estimate is never corrected. Rows that are better than stated stay.

    Source of the principle: Lai and Robbins, "Asymptotically efficient adaptive allocation rules", Advances
    in Applied Mathematics 6, 1985 (upper confidence bounds).
    """
    answers, rows = model.answers, model.rows.copy()
    logs = model.compute_log_joint(model.estimates)
    counts, weights = model.cases.answer_counts, model.cases.weights
    likelihood = sum_log_likelihood(logs, weights)
    estimated_logs = model.estimates.log_answers
    for own, prior in answers.list_questions(model.noise):
        estimated, stated = model.rows[own], answers.stated_rows[own]
        if np.ptp(stated, axis=0).sum() <= np.ptp(estimated, axis=0).sum():
            continue
        for share in STATED_SHARES:
            mixed = model.rows.copy()
            mixed[own] = (1 - share) * estimated + share * stated
            change = answers.find_log_likelihoods(mixed) - estimated_logs  # (D, V)
            gain = sum_log_likelihood(logs + counts @ change, weights) - likelihood
            gain += float((model.estimates.past.answers * change).sum())
            possible = prior > 0
            with np.errstate(divide="ignore"):  # stated rows may exclude what the estimated ones do not
                gain += float(prior[possible] @ np.log(mixed[own][possible] / estimated[possible]))
            if gain >= -max_loss:
                rows[own] = mixed[own]
                break
    return rows
