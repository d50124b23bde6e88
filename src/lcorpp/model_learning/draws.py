"""Draws of models: from the posterior, or by estimating them from resampled episodes.

Draws from the posterior draw paths of states and parameters in turn (Gibbs sampling). Where a model has free
probabilities for each of many contexts, their prior moves the posterior of all other numbers, and resampling
covers better (bootstrap).

Source: Scott, Bayesian methods for hidden Markov models, Journal of the American Statistical Association 97,
2002; Efron and Tibshirani, An introduction to the bootstrap, 1993.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields

import numpy as np

from lcorpp.model_learning.baum_welch import Parameters, expect
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.structure import Model, draw_parameters, fit

SWEEPS = 10
"""Draws of paths and parameters between two models that are returned."""

MAX_LOSS = 2.0
"""Maximum loss of log-likelihood by the means of draws: by those of several modes it is larger."""

RESAMPLED_TOLERANCE = 1e-7
"""Tolerance of `fit` with resampled episodes, which begins at the estimate of all."""


def draw_models(
    episodes: Episodes, model: Model, pseudo: Parameters, count: int, rng: np.random.Generator
) -> Iterator[Parameters]:
    """Yield `count` draws of the parameters, with the structure of the model, from its estimate on.

    pseudo: the pseudo-counts of the prior.
    """
    parameters = model.parameters
    for _ in range(count):
        for _ in range(SWEEPS):
            counts = expect(episodes, parameters, model.structure.values, rng).counts
            parameters = draw_parameters(counts, pseudo, model.structure, rng)
        yield parameters


def average_models(episodes: Episodes, model: Model, draws: Sequence[Parameters]) -> Model:
    """Return a model with the means of draws from its posterior, by which a policy earns most on average.

    If the draws are of several modes, e.g. as hidden states have changed places, the data are less likely by
    the means than by the estimate (`MAX_LOSS`): the model is then returned as it is.
    """
    mean = Parameters(
        *(np.mean([getattr(own, each.name) for own in draws], axis=0) for each in fields(Parameters))
    )
    own = float(expect(episodes, mean, model.structure.values).log_likelihoods.sum())
    return Model(mean, model.structure, own) if own >= model.log_likelihood - MAX_LOSS else model


def resample_models(
    episodes: Episodes, model: Model, pseudo: Parameters, count: int, rng: np.random.Generator
) -> Iterator[Parameters]:
    """Yield `count` estimates, each from as many episodes that are drawn from these with replacement."""
    for _ in range(count):
        drawn = episodes.select(rng.integers(len(episodes), size=len(episodes)))
        yield fit(drawn, model.parameters, model.structure, pseudo, tolerance=RESAMPLED_TOLERANCE).parameters
