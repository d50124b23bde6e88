"""Draws of models from their posterior: paths of states and parameters are drawn in turn (Gibbs sampling).

Source: Scott, Bayesian methods for hidden Markov models, Journal of the American Statistical Association 97,
2002.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lcorpp.model_learning.baum_welch import Parameters, Prior, expect
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.spaces import Space
from lcorpp.model_learning.structure import Model, draw_parameters

SWEEPS = 10
"""Draws of paths and parameters between two models that are returned."""


def draw_models(
    episodes: Episodes, space: Space, model: Model, count: int, rng: np.random.Generator
) -> Iterator[Parameters]:
    """Yield `count` draws of the parameters, with the structure of the model, from its estimate on."""
    parameters = model.parameters
    pseudo = Prior.of(episodes).pseudo_counts(parameters.count, space)
    for _ in range(count):
        for _ in range(SWEEPS):
            counts = expect(episodes, parameters, rng).counts
            parameters = draw_parameters(counts, pseudo, model.structure, rng)
        yield parameters
