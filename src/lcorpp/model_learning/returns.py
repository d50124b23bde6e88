"""The return of a policy that was learnt, with an interval: the policy in models that are drawn.

The policy is a finite-state controller, whose return in a model follows from the probabilities of its nodes
and the hidden states, step by step. What is not followed (beliefs that are reached rarely or late) has a
bound.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.model_learning.baum_welch import Parameters, Prior
from lcorpp.model_learning.learnt_model import LearntModel, make_pomdp
from lcorpp.model_learning.structure import fit
from lcorpp.planning import PolicyGraph, Solution, policy_graph, solve
from lcorpp.values import Array

MAX_NODES, MIN_PROBABILITY = 1000, 1e-6
"""Limits of the controller."""

MAX_STEPS, MIN_WEIGHT = 2000, 1e-6
"""Steps are followed until their discounted probability is less than this."""

MAX_CELLS = 5_000_000
"""Maximum number of models times edges times states that are followed at once."""

CANDIDATES = 15
"""Draws whose policies are compared with that of the estimate."""

NO_PRIOR = 1e-6
"""Factor of the prior for the numbers without it."""

MIN_SHARE = 0.1
"""The smallest share of the variance that is listed."""

MIN_CORRELATION, MIN_DEVIATION = 2.5, 1e-12
"""Correlations below this, in standard errors, are taken as 0, and standard deviations below that, too."""

SECONDS = 10.0
"""Time limit of the solver."""


@dataclass(frozen=True, eq=False)
class LearntReturn:
    """The expected discounted return of the policy of a learnt model, from its start.

    solution: of the learnt model. estimate: in the learnt model.
    drawn: (D,) in each draw. low, high: the 95 % interval, widened by what is not followed.
    unfollowed: bound of the return that is not followed, in the draw where it is largest.
    unseen: actions of the policy without a step in the data, which are taken for certain as stated.
    """

    solution: Solution
    estimate: float
    drawn: Array
    low: float
    high: float
    unfollowed: float
    unseen: tuple[str, ...] = ()

    def __str__(self) -> str:
        stated = f", if {' and '.join(self.unseen)} is as stated" if self.unseen else ""
        return f"{self.estimate:.4g} [{self.low:.4g}, {self.high:.4g}]{stated}"

    def __repr__(self) -> str:
        return f"<LearntReturn: {self}>"


def estimate_return(learnt: LearntModel, *, seconds: float = SECONDS) -> LearntReturn:
    """Solve a learnt model and evaluate its policy in the draws.

    The interval of a model from episodes has the return by the numbers without prior, too: where all is
    determined, as in a maze, the prior adds errors to each draw.

    Args:
        seconds: time limit of the solver.

    Raises:
        ModelError, SolverError: the model cannot be solved.

    Examples:
        >>> from lcorpp.model_learning import Episodes, Step, estimate_return, learn_model
        >>> heads, tails = Step("look", "h", -1), Step("look", "t", -1)
        >>> people = [[heads, Step("say_heads", "none", 5)], [tails, Step("say_heads", "none", -5)],
        ...           [tails, Step("say_tails", "none", 5)], [heads, Step("say_tails", "none", -5)]] * 20
        >>> found = estimate_return(learn_model(Episodes.of(people, [True] * 80), reports="say_{side}"))
        >>> found.low < -1 + 0.95 * 5 <= found.high
        True
    """
    solution = solve(learnt.pomdp, time_limit=seconds)
    further = [_drop_prior(learnt)] if learnt.stated is None else []
    models = _Models.of(learnt, [learnt.model.parameters, *learnt.draws, *further])
    graph = _follow(learnt, solution)
    values, unfollowed, visits = evaluate(graph, models)
    drawn, without = values[1 : 1 + len(learnt.draws)], values[1 + len(learnt.draws) :]
    low, high = np.quantile(drawn, [0.025, 0.975], method="weibull")
    most = float(unfollowed.max())
    left = NO_PRIOR * np.abs(without)  # what the prior that is left may change
    low, high = float(min([low, *(without - left)])), float(max([high, *(without + left)]))
    taken = set(graph.actions[visits > 0].tolist()) - set(learnt.episodes.actions.tolist())
    is_report = learnt.space.is_report
    unseen = tuple(learnt.episodes.action_names[a] for a in sorted(taken) if not is_report[a])
    return LearntReturn(solution, float(values[0]), drawn, low - most, high + most, most, unseen)


def _follow(learnt: LearntModel, solution: Solution) -> PolicyGraph:
    return policy_graph(
        learnt.pomdp,
        solution.policy,
        merge="belief",
        max_nodes=MAX_NODES,
        min_probability=MIN_PROBABILITY,
    )


def _drop_prior(learnt: LearntModel) -> Parameters:
    """Return the numbers that maximise the likelihood alone, given the structure."""
    model = learnt.model
    pseudo = Prior.of(learnt.episodes).pseudo_counts(model.parameters.count, learnt.space)
    tables = (pseudo.start, pseudo.transition, pseudo.observation, pseudo.reward)
    tiny = Parameters(*(NO_PRIOR * table for table in tables))
    return fit(learnt.episodes, model.parameters, model.structure, tiny).parameters


@dataclass(frozen=True, eq=False)
class _Models:
    """D models of A actions, S states and O observations, as tables with the draws first."""

    transition: Array
    observation: Array
    reward: Array
    start: Array
    discount: float

    @classmethod
    def of(cls, learnt: LearntModel, parameters: Sequence[Parameters]) -> _Models:
        pomdps = [
            make_pomdp(learnt.episodes, learnt.states, own, learnt.find_rewards(own), learnt.discount)
            for own in parameters
        ]
        return cls(
            np.array([own.transition.dense for own in pomdps]),
            np.array([own.observation.dense for own in pomdps]),
            np.array([own.reward for own in pomdps]),
            np.array([own.start for own in pomdps]),
            learnt.discount,
        )

    def take(self, places: slice) -> _Models:
        """Return some of the models."""
        tables = self.transition[places], self.observation[places], self.reward[places], self.start[places]
        return _Models(*tables, self.discount)

    @cached_property
    def reward_range(self) -> float:
        """The largest absolute value of a discounted sum of rewards."""
        return float(np.abs(self.reward).max()) / (1 - self.discount)


def evaluate(graph: PolicyGraph, models: _Models) -> tuple[Array, Array, Array]:
    """Return (D,) the return of a controller in each model, and a bound of what it does not follow.

    Also (n,) the discounted visits of the nodes before the decision is over, in all models.
    """
    S = models.start.shape[1]
    size = max(1, MAX_CELLS // (S * max(len(graph.sources), len(graph))))
    parts = [_evaluate(graph, models.take(slice(i, i + size))) for i in range(0, len(models.start), size)]
    values, unfollowed, visits = (list(own) for own in zip(*parts, strict=True))
    return np.concatenate(values), np.concatenate(unfollowed) * models.reward_range, np.sum(visits, axis=0)


def _evaluate(graph: PolicyGraph, models: _Models) -> tuple[Array, Array, Array]:
    order = np.argsort(graph.targets, kind="stable")
    sources, targets, seen = graph.sources[order], graph.targets[order], graph.observations[order]
    first = np.searchsorted(targets, np.unique(targets))
    actions = graph.actions
    likelihood = models.observation[:, actions[sources], :, seen].transpose(1, 0, 2)  # (D, m, S)
    of_action = [(a, np.flatnonzero(actions == a)) for a in np.unique(actions)]
    reward = models.reward[:, actions]
    weights = np.zeros((len(models.start), len(graph), models.start.shape[1]))
    weights[:, 0] = models.start
    values, unfollowed, factor = np.zeros(len(weights)), np.zeros(len(weights)), 1.0
    visits, moved = np.zeros(len(graph)), np.zeros_like(weights)
    for _ in range(MAX_STEPS):
        visits += factor * weights.sum(axis=(0, 2))
        values += factor * (weights * reward).sum(axis=(1, 2))
        for a, nodes in of_action:
            moved[:, nodes] = weights[:, nodes] @ models.transition[:, a]
        moved[:, :, -1] = 0.0  # the decision is over
        factor *= models.discount
        weights = np.zeros_like(weights)
        if len(targets):
            weights[:, np.unique(targets)] = np.add.reduceat(moved[:, sources] * likelihood, first, axis=1)
        lost = np.maximum(moved.sum(axis=(1, 2)) - weights.sum(axis=(1, 2)), 0.0)
        unfollowed += factor * lost
        if factor * weights.sum(axis=(1, 2)).max() < MIN_WEIGHT:
            break
    return values, unfollowed + factor * weights.sum(axis=(1, 2)), visits


def plan_robustly(learnt: LearntModel, quantile: float, *, seconds: float = SECONDS) -> LearntModel:
    """Return a learnt model that plans by the numbers whose policy has the largest quantile of returns.

    Candidates are the estimate and some draws; each policy is evaluated in all draws. With a small quantile
    the policy earns enough where the numbers are worse than estimated.

    Args:
        quantile: from above 0 to below 1.
        seconds: time limit of the solver, for all candidates.

    Raises:
        ModelError, SolverError: the quantile is out of range, or a model cannot be solved.

    Examples:
        >>> from lcorpp.model_learning import Episodes, Step, learn_model, plan_robustly
        >>> heads, tails = Step("look", "h", -1), Step("look", "t", -1)
        >>> people = [[heads, Step("say_heads", "none", 5)], [tails, Step("say_heads", "none", -5)],
        ...           [tails, Step("say_tails", "none", 5)], [heads, Step("say_tails", "none", -5)]] * 3
        >>> learnt = learn_model(Episodes.of(people, [True] * 12), reports="say_{side}")
        >>> plan_robustly(learnt, 0.1).states
        ('heads', 'tails')
    """
    if not 0 < quantile < 1:
        raise ModelError(f"the quantile is {quantile}; expected a number between 0 and 1")
    models = _Models.of(learnt, learnt.draws)
    candidates = [learnt, *(replace(learnt, planned=own) for own in learnt.draws[:CANDIDATES])]
    scores = []
    for own in candidates:
        solution = solve(own.pomdp, time_limit=seconds / len(candidates))
        values, unfollowed, _ = evaluate(_follow(own, solution), models)
        scores.append(float(np.quantile(values - unfollowed, quantile)))
    return candidates[int(np.argmax(scores))]


def find_causes(learnt: LearntModel, drawn: Array) -> list[tuple[str, float]]:
    """Return what the spread of the returns depends on, and the share of its variance, the largest first.

    Each is the start, or the observations, transitions or rewards of an action. In half of the draws the
    numbers are weighed by their correlation with the return, and the share is the squared correlation of the
    weighed sum with the return in the other half; of both halves the mean.

    Args:
        drawn: (D,) returns in the draws.
    """
    halves = np.arange(len(drawn)) % 2 == 0
    shares = []
    for what, numbers in _list_numbers(learnt):
        varying = numbers[:, numbers.std(axis=0) > MIN_DEVIATION]
        share = (_predict(varying, drawn, halves) + _predict(varying, drawn, ~halves)) / 2
        shares.append((what, share))
    return sorted([pair for pair in shares if pair[1] >= MIN_SHARE], key=lambda pair: -pair[1])


def _predict(numbers: Array, drawn: Array, chosen: npt.NDArray[np.bool_]) -> float:
    """Return the squared correlation in the other draws of a sum that is weighed in the chosen ones."""
    weights = _correlate(numbers[chosen], drawn[chosen])
    weights[np.abs(weights) < MIN_CORRELATION / np.sqrt(chosen.sum())] = 0.0
    deviations = np.maximum(numbers[chosen].std(axis=0), MIN_DEVIATION)
    total = (numbers[~chosen] / deviations) @ weights
    correlation = float(_correlate(total[:, None], drawn[~chosen])[0])
    return max(correlation, 0.0) ** 2


def _correlate(columns: Array, values: Array) -> Array:
    """Return (n,) the correlations of columns (D, n) with values (D,); 0 where either does not vary."""
    own, other = columns - columns.mean(axis=0), values - values.mean()
    scale = own.std(axis=0) * other.std()
    found: Array = np.where(scale > 0, own.T @ other / len(values) / np.where(scale > 0, scale, 1.0), 0.0)
    return found


def _list_numbers(learnt: LearntModel) -> Iterator[tuple[str, Array]]:
    """Yield names of groups of numbers, and (D, n) their values in the draws."""
    draws, n = learnt.draws, len(learnt.draws)
    yield "start", np.array([own.start for own in draws])
    for a, action in enumerate(learnt.episodes.action_names):
        yield f"observations of {action}", np.array([own.observation[a, :-1] for own in draws]).reshape(n, -1)
        yield f"transitions of {action}", np.array([own.transition[a] for own in draws]).reshape(n, -1)
        yield f"rewards of {action}", np.array([learnt.find_rewards(own)[a] for own in draws]).reshape(n, -1)
