"""The observation model for planning: as stated while that is credible, then a mean over the noises."""

from __future__ import annotations

from lcorpp.latent_classes import sum_log_likelihood
from lcorpp.trust.latent_class_model import LatentClassModel
from lcorpp.trust.sources.weights import SourceWeights
from lcorpp.values import Array


def find_planned_rows(model: LatentClassModel, weights: SourceWeights, max_stated_loss: float) -> Array:
    """Return (R, O) rows to plan for: the stated ones while they are credible, else their mean.

    The stated rows are credible if their log posterior is at most `max_stated_loss` lower than that of the
    estimates, and than that of each fixed noise: a policy for estimates that differ by chance loses what the
    stated policy does not. The mean is that of the estimated rows and of those with a fixed noise, by their
    weights. Estimates with less noise than stated are used alone, as no fixed noise is as low.
    """
    answers = model.answers
    if compute_stated_loss(model) <= max_stated_loss and weights.stated_loss <= max_stated_loss:
        return answers.stated_rows
    is_better = model.noise.degrees[0] < 0
    return model.rows if is_better else weights.compute_mean_rows(model.rows)


def compute_stated_loss(model: LatentClassModel) -> float:
    """Return how much lower the log posterior is with the stated rows than with the estimated ones.

    Of the answers in cases that are not kept, the expected log likelihood counts.
    """
    answers, estimates = model.answers, model.estimates
    logs, weights = model.compute_log_joint(estimates), model.cases.weights
    stated = answers.add_noise(answers.stated_noise)  # what they exclude is improbable
    change = estimates.log_answers - answers.find_log_likelihoods(stated)  # (D, V)
    stated_logs = logs - model.cases.answer_counts @ change
    loss = sum_log_likelihood(logs, weights) - sum_log_likelihood(stated_logs, weights)
    loss += float((estimates.past.answers * change).sum())
    loss += answers.compute_log_prior(estimates.noise, estimates.rows)
    return loss - answers.compute_log_prior(answers.stated_noise)
