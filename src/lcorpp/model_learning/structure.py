"""What an action does, with few numbers: whether it leaves the state as it is, and which states are alike.

An action with few data has few parameters: states whose observations or rewards the data do not distinguish
share them. Which do is chosen by the Bayesian information criterion (structural expectation-maximisation).

Sources: Friedman, The Bayesian structural EM algorithm, UAI 1998; Schwarz, Annals of Statistics 6, 1978.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import log

import numpy as np

from lcorpp.latent_classes import normalise
from lcorpp.model_learning.baum_welch import Parameters, expect
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.relations import Relation
from lcorpp.model_learning.spaces import Space
from lcorpp.model_learning.ties import Ties
from lcorpp.values import Array, Indices

STAYS, RESTARTS, MOVES = range(3)
"""Effects of an action: the state stays, is drawn from the start again, or has a distribution of its own."""

MIN_SHARE = 0.01
"""Transitions below this probability are no parameters."""

TOLERANCE = 1e-5
"""Iterations end when the log-likelihood increases by less than this share of its size."""

MAX_ITERATIONS = 500
"""Maximum number of iterations."""

TRIED_ITERATIONS = 20
"""Iterations after which an effect is judged."""

MAX_ROUNDS = 10
"""Maximum number of times that groups are chosen."""


@dataclass(frozen=True, eq=False)
class Structure:
    """Which numbers of `Parameters` are the same.

    values: (K,) the shared value of each state; no state changes to one of another value.
    effects: (A,) of each action.
    observation, reward: (A, K) groups; all states and actions of a group have the same row.
    cells: (A, K, O) number of each observation's probability in the row of its group; observations that share
        one are equally probable. Without relations, all are different.
    """

    values: Indices
    effects: Indices
    observation: Indices
    reward: Indices
    cells: Indices

    @classmethod
    def free(cls, space: Space, values: Indices, effects: Indices, n_observations: int) -> Structure:
        """Return the structure with relations, and groups only of the rewards of reports."""
        own = np.arange(len(effects) * len(values)).reshape(len(effects), len(values))
        reports = space.reports[:, values]
        reward = np.where(reports >= 0, own.size + reports, own)
        return cls(values, effects, own, reward, list_cells(own, n_observations)).relate(space.relations)

    def relate(self, relations: Sequence[Relation]) -> Structure:
        """Return the structure with relations."""
        observation, cells = self.observation.copy(), self.cells.copy()
        for relation in relations:
            first = observation.max() + 1
            observation[relation.actions] = first + relation.groups[:, self.values]
            cells[relation.actions] = relation.cells[:, self.values]
        return replace(self, observation=observation, cells=cells)

    @cached_property
    def observation_ties(self) -> Ties:
        """The ties of the observations."""
        return Ties.of(self.observation, self.cells)

    def tie_rewards(self, n_rewards: int) -> Ties:
        """Return the ties of the rewards."""
        if n_rewards not in self._reward_ties:
            self._reward_ties[n_rewards] = Ties.of(self.reward, list_cells(self.reward, n_rewards))
        return self._reward_ties[n_rewards]

    @cached_property
    def _reward_ties(self) -> dict[int, Ties]:
        return {}

    @property
    def numbers(self) -> list[int]:
        """(K,) number of each state among those of its value, from 1."""
        return [int((self.values[:k] == value).sum()) + 1 for k, value in enumerate(self.values)]


def list_cells(groups: Indices, n_observations: int) -> Indices:
    """Return (A, K, O) cells that are all different."""
    return np.broadcast_to(np.arange(n_observations), (*groups.shape, n_observations))


@dataclass(frozen=True, eq=False)
class Model:
    """Parameters with their structure, and the log-likelihood of all episodes."""

    parameters: Parameters
    structure: Structure
    log_likelihood: float

    def score(self, episodes: Episodes) -> float:
        """Return the Bayesian information criterion as a log-likelihood; larger is better."""
        return self.log_likelihood - _penalty(episodes) * count_parameters(self, episodes)


Rows = Callable[[Array], Array]
"""Makes distributions of rows of counts: their shares, or draws from Dirichlet distributions."""


def maximise(counts: Parameters, prior: Parameters, structure: Structure) -> Parameters:
    """Return the parameters of largest posterior density under a structure, given counts."""
    return _estimate(counts, prior, structure, normalise)


def draw_parameters(
    counts: Parameters, prior: Parameters, structure: Structure, rng: np.random.Generator
) -> Parameters:
    """Draw the parameters from their posterior under a structure, given counts."""
    return _estimate(counts, prior, structure, lambda rows: _draw_rows(rows, rng))


def _draw_rows(weights: Array, rng: np.random.Generator) -> Array:
    """Draw rows from Dirichlet distributions; gamma variables of tiny shapes are 0, and then one is 1."""
    rows = weights.reshape(-1, weights.shape[-1])
    drawn = rng.standard_gamma(rows)
    for i in np.flatnonzero(drawn.sum(axis=1) == 0):
        drawn[i, rng.choice(rows.shape[1], p=normalise(rows[i]))] = 1.0
    return normalise(drawn).reshape(weights.shape)


def _estimate(counts: Parameters, prior: Parameters, structure: Structure, rows: Rows) -> Parameters:
    K, total = counts.count, counts.transition + prior.transition
    restarts, tied = structure.effects == RESTARTS, structure.effects != MOVES
    start = rows(counts.start + prior.start + counts.transition[restarts][:, :, :K].sum(axis=(0, 1)))
    transition = rows(total)
    goes_on = rows(np.stack([total[:, :, :K].sum(axis=(1, 2)), total[:, :, K].sum(axis=1)], axis=1))
    transition[tied] = 0.0
    for action in np.flatnonzero(tied):
        kept = start if restarts[action] else np.eye(K)
        transition[action, :, :K], transition[action, :, K] = goes_on[action, 0] * kept, goes_on[action, 1]
    observation = rows(counts.observation + prior.observation)
    ties = structure.observation_ties
    observation[:, :K] = _tie(counts.observation[:, :K], prior.observation[:, :K], ties, rows)
    ties = structure.tie_rewards(counts.reward.shape[2])
    return Parameters(start, transition, observation, _tie(counts.reward, prior.reward, ties, rows))


def _tie(counts: Array, prior: Array, ties: Ties, rows: Rows) -> Array:
    """Return rows (A, K, n) of counts, one for each group; its prior is the mean of the states' priors."""
    return ties.spread(rows(ties.sum(counts) + ties.sum(prior) / ties.members))


def fit(
    episodes: Episodes,
    parameters: Parameters,
    structure: Structure,
    pseudo: Parameters,
    iterations: int = MAX_ITERATIONS,
    tolerance: float = TOLERANCE,
) -> Model:
    """Iterate expectation and maximisation from some parameters, under a structure.

    pseudo: pseudo-counts, see `Prior`. tolerance: see `TOLERANCE`.
    """
    last = -np.inf
    for _ in range(iterations):
        found = expect(episodes, parameters, structure.values)
        likelihood = float(found.log_likelihoods.sum())
        parameters = maximise(found.counts, pseudo, structure)
        if likelihood - last < tolerance * abs(likelihood):
            break
        last = likelihood
    return Model(
        parameters, structure, float(expect(episodes, parameters, structure.values).log_likelihoods.sum())
    )


def choose_structure(episodes: Episodes, model: Model, pseudo: Parameters, space: Space) -> Model:
    """Return the model with the effects and groups of the best score, found one after the other.

    Shared values do not change, so that with reports no action draws the state again.
    """
    best, score = model, model.score(episodes)
    effects_tried = (STAYS,) if space.variables else (STAYS, RESTARTS)
    for action in np.argsort(-np.bincount(episodes.actions)):
        for effect in effects_tried:
            if best.structure.effects[action] != MOVES:
                continue
            effects = best.structure.effects.copy()
            effects[action] = effect
            tried = fit(
                episodes, best.parameters, replace(best.structure, effects=effects), pseudo, TRIED_ITERATIONS
            )
            if (own := tried.score(episodes)) > score:
                best, score = tried, own
    for _ in range(MAX_ROUNDS):
        counts = expect(episodes, best.parameters, best.structure.values).counts
        tried = fit(
            episodes, best.parameters, _choose_groups(episodes, counts, best.structure, space), pseudo
        )
        if (own := tried.score(episodes)) <= score + 1e-6:
            break
        best, score = tried, own
    return best


def _choose_groups(episodes: Episodes, counts: Parameters, structure: Structure, space: Space) -> Structure:
    K, penalty = counts.count, _penalty(episodes)
    offsets = np.arange(len(counts.reward))[:, None] * K
    observation, reward = (
        offsets + np.array([tie_rows(own[:K], penalty) for own in table])
        for table in (counts.observation, counts.reward)
    )
    if space.variables:
        reports = space.reports[:, structure.values]
        tied = reward.size + _tie_reports(counts.reward, reports, penalty)
        reward = np.where(space.is_report[:, None], tied, reward)
    plain = replace(
        structure,
        observation=observation,
        reward=reward,
        cells=list_cells(observation, counts.observation.shape[2]),
    )
    kept = [own for own in space.relations if _is_better(counts.observation[:, :K], plain, own, penalty)]
    return plain.relate(kept)


def _is_better(counts: Array, plain: Structure, relation: Relation, penalty: float) -> bool:
    """Whether a relation describes counts (A, K, O) of its actions better than the groups of a structure."""
    scores = []
    for own in (plain, plain.relate([relation])):
        ties = Ties.of(own.observation[relation.actions], own.cells[relation.actions])
        sums = ties.sum(counts[relation.actions])
        shared = np.maximum(ties.sizes / ties.members, 1.0)  # observations of a cell
        score = sum(_information(row) for row in sums) - float((sums * np.log(shared)).sum())
        scores.append(score - penalty * sum(_count_free(row) for row in sums))
    return scores[1] > scores[0]


def _tie_reports(counts: Array, reports: Indices, penalty: float) -> Indices:
    """Return (A, K) groups of the rewards of reports, counts (A, K, V).

    They depend on which variables are right, `reports` (A, K); and on the report, if the data distinguish it.
    """
    groups, actions = reports.copy(), np.flatnonzero(reports[:, 0] >= 0)
    size = int(reports.max()) + 1
    for bits in range(size):
        rows = np.array([counts[action][reports[action] == bits].sum(axis=0) for action in actions])
        total = rows.sum(axis=0)
        gain = sum(_information(row) for row in rows) - _information(total)
        further = sum(_count_free(row) for row in rows) - _count_free(total)
        if gain > penalty * further + 1e-9:
            alone = np.arange(1, len(reports) + 1)[:, None] * size + bits
            groups = np.where(reports == bits, alone, groups)
    return groups


def _count_free(row: Array) -> int:
    """Return the number of free parameters of a row of counts."""
    return max(int((row > 0.5).sum()) - 1, 0)


def tie_rows(counts: Array, penalty: float) -> Indices:
    """Return the group of each row of counts (K, O): rows are merged that cost less than their parameters.

    penalty: of a parameter.
    """
    rows, groups = list(counts), [[k] for k in range(len(counts))]
    size = _count_free(counts.sum(axis=0))
    while len(rows) > 1:
        cost, i, j = min(
            (_information(rows[i]) + _information(rows[j]) - _information(rows[i] + rows[j]), i, j)
            for i in range(len(rows))
            for j in range(i + 1, len(rows))
        )
        if cost > penalty * size + 1e-9:
            break
        rows[i], groups[i] = rows[i] + rows[j], groups[i] + groups[j]
        del rows[j], groups[j]
    found = np.zeros(len(counts), dtype=np.intp)
    for g, own in enumerate(groups):
        found[own] = g
    return found


def count_parameters(model: Model, episodes: Episodes) -> int:
    """Return the number of free parameters."""
    parameters, structure = model.parameters, model.structure
    K, total = parameters.count, parameters.count - 1
    for rows, effect in zip(parameters.transition, structure.effects, strict=True):
        if effect == MOVES:
            total += int((np.maximum((rows > MIN_SHARE).sum(axis=1), 1) - 1).sum())
        else:
            total += int(MIN_SHARE < rows[:, K].max() < 1 - MIN_SHARE)
    for ties, found in (
        (structure.observation_ties, episodes.observations),
        (structure.tie_rewards(len(episodes.reward_values)), episodes.rewards),
    ):
        seen = np.zeros((len(ties.places), len(ties.flat) // ties.places.size))
        seen[episodes.actions, found] = 1
        total += sum(_count_free(row) for row in ties.sum(np.repeat(seen[:, None], K, axis=1)))
    return total


def _penalty(episodes: Episodes) -> float:
    return 0.5 * log(len(episodes.actions) + 1)


def _information(row: Array) -> float:
    """Return the maximum of sum n log p."""
    total, positive = row.sum(), row[row > 0]
    return float((positive * np.log(positive / total)).sum()) if total > 0 else 0.0
