"""Belief update: Bayes' rule over the hidden state."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError, ObservationError, expected_one_of
from lcorpp.planning.pomdp import SUM_TOLERANCE, Pomdp
from lcorpp.values import Array, Belief, Indices, freeze
from lcorpp.values.probabilities import MIN_NORMAL


def update(pomdp: Pomdp, belief: Belief, action: int, observation: int) -> Belief:
    """Return the belief after an action and an observation.

    b'(s') is proportional to P(o | a, s') * sum over s of P(s' | s, a) b(s).

    Args:
        belief: (S,) distribution.
        action, observation: indices.

    Returns:
        (S,) distribution.

    Raises:
        ObservationError: the observation has probability zero; the message names belief, action and
            observation.

    Source: Bayes' rule; Kaelbling, Littman and Cassandra, 1998, section 3.3.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import update
        >>> pomdp = load_domain("intention").pomdp
        >>> action, observation = pomdp.action_index("move_forward"), pomdp.observation_index("pos")
        >>> update(pomdp, pomdp.start, action, observation).round(3).tolist()  # start: 0.5 0.5 0 0 0
        [0.9, 0.1, 0.0, 0.0, 0.0]
    """
    predicted, weights = pomdp.transition.forward(action, belief), np.zeros(len(pomdp.states))
    states, likelihood = pomdp.observation.column(action, observation)
    weights[states] = predicted[states] * likelihood
    total = np.add.reduce(weights)  # the sum, without the checks of `sum()`, which take as long
    if not total >= MIN_NORMAL:
        raise make_impossible_error(pomdp, belief, action, observation)
    weights /= total
    return weights


def update_many(pomdp: Pomdp, beliefs: Array, actions: Indices, observations: Indices) -> Array:
    """Return the beliefs (n, S) after actions (n,) in beliefs (n, S), and observations (n,).

    Raises:
        ObservationError, ModelError: as `update`; the dense table of observations is too large.
    """
    weights = pomdp.transition.forward_many(actions, beliefs)
    weights *= pomdp.observation.dense[actions, :, observations]
    totals = weights.sum(axis=1, keepdims=True)
    impossible = np.flatnonzero(~(totals >= MIN_NORMAL))
    if len(impossible):
        i = int(impossible[0])
        raise make_impossible_error(pomdp, beliefs[i], int(actions[i]), int(observations[i]))
    weights /= totals
    return weights


def make_impossible_error(pomdp: Pomdp, belief: Belief, action: int, observation: int) -> ObservationError:
    """Return the error that an observation is impossible after an action in a belief."""
    probabilities = observation_probabilities(pomdp, belief, action)
    possible = [name for name, p in zip(pomdp.observations, probabilities, strict=True) if p > 0]
    model = f" of the model {pomdp.file}" if pomdp.file else ""
    return ObservationError(
        f"observation {pomdp.observations[observation]!r} is impossible after action"
        f" {pomdp.actions[action]!r} in belief {format_belief(pomdp, belief)}{model};"
        f" {expected_one_of(possible)}"
    )


def observation_probabilities(pomdp: Pomdp, belief: Belief, action: int) -> Array:
    """Return (O,) P(o | b, a): of each observation, for a belief (S,) and the index of an action.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import observation_probabilities
        >>> pomdp = load_domain("intention").pomdp
        >>> observation_probabilities(pomdp, pomdp.start, pomdp.action_index("greet")).round(3).tolist()
        [0.5, 0.5, 0.0]
    """
    return pomdp.observation.forward(action, pomdp.transition.forward(action, belief))


def check_belief(pomdp: Pomdp, belief: npt.ArrayLike) -> Belief:
    """Return a frozen (S,) copy of `belief`.

    Raises:
        ModelError: `belief` is not a distribution over the states.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import check_belief
        >>> check_belief(load_domain("intention").pomdp, [1, 0.5, 0, 0, 0])
        Traceback (most recent call last):
            ...
        lcorpp.errors.ModelError: belief {...} is not a distribution; it sums to 1.5
    """
    try:
        copy = freeze(belief)
    except (TypeError, ValueError):
        raise ModelError(f"a belief is {len(pomdp.states)} numbers, not {belief!r}") from None
    if copy.shape != (len(pomdp.states),):
        raise ModelError(f"a belief over {len(pomdp.states)} states cannot have shape {copy.shape}")
    if not np.isfinite(copy).all() or copy.min() < 0 or abs(copy.sum() - 1) > SUM_TOLERANCE:
        raise ModelError(
            f"belief {format_belief(pomdp, copy)} is not a distribution; it sums to {copy.sum():.10g}"
        )
    return copy


def format_belief(pomdp: Pomdp, belief: Belief, limit: int = 6) -> str:
    """Return the `limit` largest entries of a belief (S,) with their names, for messages."""
    order = np.argsort(-np.asarray(belief), kind="stable")
    support = [int(s) for s in order if belief[s] != 0]
    text = ", ".join(f"{pomdp.states[s]} {belief[s]:.6g}" for s in support[:limit])
    return "{" + text + (", ..." if len(support) > limit else "") + "}"
