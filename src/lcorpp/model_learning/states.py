"""Candidates with more and more hidden states: a state is split, or the whole model is doubled.

Source: Siddiqi, Gordon and Moore, Fast state discovery for HMM model selection and learning, AISTATS 2007.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from lcorpp.latent_classes import normalise
from lcorpp.model_learning.baum_welch import Parameters, Prior
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.spaces import Space
from lcorpp.model_learning.structure import MOVES, STAYS, Model, Structure, choose_structure, fit
from lcorpp.values import Array

SPLIT_ITERATIONS = 12
"""Iterations of each split that is tried."""

LAST_ITERATIONS, LAST_TOLERANCE = 2000, 1e-8
"""Limits of `fit` for the chosen model: probabilities near 0 converge slowly."""

TRIES = 3
"""Random directions in which each state is split."""

PATIENCE = 3
"""Further numbers of states that are tried without a better score."""


def learn(
    episodes: Episodes,
    space: Space,
    max_states: int,
    rng: np.random.Generator,
    progress: Callable[[float, int], None] = lambda _share, _states: None,
) -> Model:
    """Return the model of the best score among all numbers of states.

    max_states: at least the number of shared values. progress: takes the completed share of the largest
    possible work, and the number of states of the model that was scored.
    """
    prior = Prior.of(episodes)
    best, score = None, -np.inf
    for effect in (STAYS, MOVES):
        since = 0
        for model in grow(episodes, space, effect, max_states, prior, rng):
            grown = [model]
            if effect == MOVES and not space.variables and 2 * model.parameters.count <= max_states:
                doubled = [_fit_doubled(episodes, space, model, prior, rng) for _ in range(TRIES)]
                grown.append(max(doubled, key=lambda own: own.log_likelihood))
            since += 1
            for own in grown:
                chosen = choose_structure(
                    episodes, own, prior.pseudo_counts(own.parameters.count, space), space
                )
                share = (own.parameters.count - len(space) + 1) / (max_states - len(space) + 1)
                progress(0.5 * (min(share, 1) + (effect == MOVES)), own.parameters.count)
                if chosen.score(episodes) > score:
                    best, score, since = chosen, chosen.score(episodes), 0
            if since > PATIENCE:
                break
    assert best is not None
    pseudo = prior.pseudo_counts(best.parameters.count, space)
    return fit(episodes, best.parameters, best.structure, pseudo, LAST_ITERATIONS, LAST_TOLERANCE)


def grow(
    episodes: Episodes, space: Space, effect: int, max_states: int, prior: Prior, rng: np.random.Generator
) -> Iterator[Model]:
    """Yield models of more and more states; each time the split of the best likelihood.

    With reports, the further states of a value are reached by actions that change the state, or not at all.
    """
    effects, n_observations = np.full(len(episodes.action_names), effect), len(episodes.observation_names)
    parameters, values = begin(space, prior), np.arange(len(space))
    pseudo = prior.pseudo_counts(len(space), space)
    model = fit(episodes, parameters, Structure.free(space, values, effects, n_observations), pseudo)
    yield model
    if space.variables and effect == STAYS:
        return
    while (count := model.parameters.count) < max_states:
        pseudo, tried = prior.pseudo_counts(count + 1, space), list[Model]()
        for state in range(count):
            values = np.append(model.structure.values, model.structure.values[state])
            structure = Structure.free(space, values, effects, n_observations)
            for _ in range(TRIES):
                split = split_state(model.parameters, state, rng, may_start=not space.variables)
                tried.append(fit(episodes, split, structure, pseudo, SPLIT_ITERATIONS))
        chosen = max(tried, key=lambda own: own.log_likelihood)
        model = fit(episodes, chosen.parameters, chosen.structure, pseudo)
        yield model


def begin(space: Space, prior: Prior) -> Parameters:
    """Return parameters of the shared values: all alike, but reports that are right earn more."""
    pseudo = prior.pseudo_counts(len(space), space)
    reward = pseudo.reward.copy()
    ranks = np.linspace(-1, 1, reward.shape[2]) if reward.shape[2] > 1 else np.zeros(1)
    right = np.array([[bin(max(bits, 0)).count("1") for bits in row] for row in space.reports])
    share = right / max(len(space.variables), 1) - 0.5
    share[~space.is_report] = 0.0
    reward *= np.exp(2 * share[:, :, None] * ranks)
    return Parameters(
        pseudo.start, *(normalise(own) for own in (pseudo.transition, pseudo.observation, reward))
    )


def split_state(
    parameters: Parameters, state: int, rng: np.random.Generator, *, may_start: bool = True
) -> Parameters:
    """Return parameters in which a state is two, whose observations and rewards differ by chance.

    may_start: whether an episode may start in the new one, too.
    """
    K = parameters.count
    states, columns = np.append(np.arange(K), state), np.append(np.arange(K), [state, K])
    start = parameters.start[states].copy()
    start[[state, K]] *= [0.5, 0.5] if may_start else [1, 0]
    transition = parameters.transition[:, states][:, :, columns].copy()
    transition[:, :, [state, K]] *= 0.5
    old = parameters.transition[:, state, state]  # the two halves stay what they are
    for one, other in ((state, K), (K, state)):
        transition[:, one, one], transition[:, one, other] = 0.9 * old, 0.1 * old
    observation, reward = parameters.observation[:, columns].copy(), parameters.reward[:, states].copy()
    for own in (state, K):
        observation[:, own] = _perturb(observation[:, own], rng)
        reward[:, own] = _perturb(reward[:, own], rng)
    return Parameters(start, transition, observation, reward)


def _fit_doubled(
    episodes: Episodes, space: Space, model: Model, prior: Prior, rng: np.random.Generator
) -> Model:
    values, n_observations = np.tile(model.structure.values, 2), len(episodes.observation_names)
    structure = Structure.free(space, values, model.structure.effects, n_observations)
    pseudo = prior.pseudo_counts(len(values), space)
    return fit(episodes, double(model.parameters, rng), structure, pseudo)


def double(parameters: Parameters, rng: np.random.Generator) -> Parameters:
    """Return parameters with each state twice: a hidden value that does not change is added."""
    K = parameters.count
    states = np.tile(np.arange(K), 2)
    transition = np.zeros((len(parameters.transition), 2 * K, 2 * K + 1))
    transition[:, :K, :K] = transition[:, K:, K:-1] = parameters.transition[:, :, :K]
    transition[:, :, -1] = parameters.transition[:, states, K]
    observation = parameters.observation[:, np.append(states, K)].copy()
    reward = parameters.reward[:, states].copy()
    for own in range(2 * K):
        observation[:, own] = _perturb(observation[:, own], rng)
        reward[:, own] = _perturb(reward[:, own], rng)
    return Parameters(parameters.start[states] / 2, transition, observation, reward)


def _perturb(rows: Array, rng: np.random.Generator) -> Array:
    """Return rows (A, n) that differ from these by chance."""
    return 0.6 * rows + 0.4 * normalise(rows * rng.dirichlet(np.ones(rows.shape[1]), size=len(rows)))
