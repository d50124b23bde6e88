"""Problems of a given number of steps, solved around a start belief: SARSOP in layers.

Source: Kurniawati, Hsu and Lee, RSS 2008; the steps are a part of the state that is always seen (Ong, Png,
Hsu and Lee, Planning under uncertainty for robotic tasks with mixed observability, IJRR 2010).
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop import solve
from lcorpp.planning.solution import Progress
from lcorpp.planning.solvers.arguments import checked_count, checked_discount, checked_limits, checked_starts
from lcorpp.planning.solvers.finite_horizon.solution import FiniteSolution, finite_policy
from lcorpp.planning.solvers.finite_horizon.time_expanded import LayerBound, Layers, layered
from lcorpp.values import Array


def solve_finite(
    pomdp: Pomdp,
    horizon: int,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
    discount: float | None = None,
) -> FiniteSolution:
    """Find what to do in a number of steps, from a start belief.

    The bounds are those of SARSOP; of the beliefs that optimal policies do not reach only as much is known as
    the policies' upper bounds tell. `solvers.exact.finite_horizon` serves all beliefs alike. At the
    time limit, or at an interrupt from the keyboard, it returns the best so far.

    Args:
        pomdp: the problem.
        horizon: the number of steps, from 1.
        start: (S,) belief with all steps to go, or (N, S) several; the model's own when None.
        precision: stop when upper - lower is at most this, in reward units, at every start belief.
        time_limit: wall-clock seconds.
        callback: called after each trial.
        discount: 0 < discount <= 1, with 1 for the plain sum of the rewards; the model's own when None.

    Returns:
        The policy for every number of steps to go, both bounds, the seconds used and why the search stopped.

    Raises:
        ModelError: `start` is not a distribution over the states, a number is out of range, or the steps are
            too many for memory.
    """
    checked_limits(precision, time_limit)
    horizon = checked_count("horizon", horizon, 1)
    factor = checked_discount(pomdp, discount)
    began, starts = monotonic(), checked_starts(pomdp, start)
    layers = layered(pomdp, horizon, factor)
    found = solve(
        layers.pomdp,
        [layers.belief(belief, 0) for belief in starts],
        precision=precision,
        time_limit=max(time_limit - (monotonic() - began), 1e-3 * time_limit),
        callback=callback,
    )
    return FiniteSolution(
        policies=_policies(pomdp, layers, found.policy, factor),
        lower=found.lower,
        upper=found.upper,
        seconds=monotonic() - began,
        reason=found.reason,
        history=found.history,
    )


def _policies(pomdp: Pomdp, layers: Layers, found: Policy, discount: float) -> tuple[Policy, ...]:
    """The policy of each layer, the last one first."""
    S, everywhere = layers.states, np.arange(layers.states)
    blind, policies = np.zeros((len(pomdp.actions), S)), []
    pieces = _by_layer(layers, found)
    for layer in reversed(range(layers.horizon)):
        blind = pomdp.reward + discount * np.array(
            [pomdp.transition.backward(a, row) for a, row in enumerate(blind)]
        )
        weight = float(layers.weights[layer])
        own = [
            AlphaVectors(piece.states - layer * S, piece.vectors / weight, piece.actions)
            for piece in pieces[layer]
        ]
        # with those that do one thing all the time there is something to do at beliefs that were not met
        whole = [piece for piece in own if len(piece.states) == S]
        vectors = np.concatenate([blind, *(piece.vectors for piece in whole)])
        actions = np.concatenate([np.arange(len(blind)), *(piece.actions for piece in whole)])
        parts = [piece for piece in own if len(piece.states) < S]
        above = LayerBound(layers, layer, found.upper_bound) if found.upper_bound is not None else None
        kept = [*parts, AlphaVectors(everywhere, *_not_dominated(vectors, actions))]
        policies.append(finite_policy(pomdp, kept, layers.horizon - layer, discount, above))
    return tuple(policies)


def _by_layer(layers: Layers, policy: Policy) -> list[list[AlphaVectors]]:
    """The pieces of each layer; one over all layers was made for the first, whose states nothing leads to."""
    S, found = layers.states, [list[AlphaVectors]() for _ in range(layers.horizon)]
    for piece in policy.vector_sets:
        layer = int(piece.states[0]) // S
        within = piece.states < (layer + 1) * S
        if layer < layers.horizon:
            found[layer].append(AlphaVectors(piece.states[within], piece.vectors[:, within], piece.actions))
    return found


def _not_dominated(vectors: Array, actions: npt.NDArray[np.intp]) -> tuple[Array, npt.NDArray[np.intp]]:
    """The vectors that none after them equals or exceeds everywhere."""
    kept = [k for k, vector in enumerate(vectors) if not (vectors[k + 1 :] >= vector).all(axis=1).any()]
    return vectors[kept], actions[kept]
