"""Where both bounds start: blind policies below, the fast informed bound above.

Sources: Hauskrecht, Value-function approximations for POMDPs, JAIR 2000 (blind policies, MDP, fast informed
bound); Kurniawati, Hsu and Lee, RSS 2008, section III-B.
"""

from __future__ import annotations

from time import monotonic

import numpy as np

from lcorpp.planning.sarsop.dynamics import Dynamics
from lcorpp.values import Array

_MDP_ROUNDS = 1000
"""Policy iteration ends after a handful of rounds, unless rounding makes it cycle between equals."""


def blind_policies(dynamics: Dynamics) -> Array:
    """(A, S) alpha vectors of doing one action for ever: achievable, so a lower bound."""
    alphas = [
        dynamics.discounted_sum(np.full(dynamics.states, a), dynamics.reward[a])
        for a in range(dynamics.actions)
    ]
    return np.array(alphas)


def mdp_bound(dynamics: Dynamics) -> Array:
    """(A, S) Q values above those of the fully observed problem.

    Policy iteration comes close to the truth from below; its Bellman residual, summed to infinity, lifts it
    above the truth whatever the rounding, and one more sweep from there only lowers it.
    """
    gamma, states = dynamics.discount, np.arange(dynamics.states)
    choice = dynamics.reward.argmax(axis=0)
    for _ in range(_MDP_ROUNDS):
        value = dynamics.discounted_sum(choice, dynamics.reward[choice, states])
        Q = _mdp_sweep(dynamics, value)
        better = Q.argmax(axis=0)
        gain = Q.max(axis=0) - Q[choice, states]
        if gain.max() <= 1e-12 * max(1.0, float(np.abs(value).max())):
            break
        choice = np.where(gain > 0, better, choice)
    residual = max(0.0, float((Q.max(axis=0) - value).max()))
    above = value + residual / (1 - gamma)
    # no policy earns more than the largest reward at every step
    return _mdp_sweep(dynamics, np.minimum(above, dynamics.reward.max() / (1 - gamma)))


def fast_informed_bound(dynamics: Dynamics, Q: Array, *, tolerance: float, deadline: float) -> Array:
    """(A, S) the fast informed bound, iterated downwards from Q values (A, S) that are above the truth.

    Q(a, s) <- R(a, s) + gamma sum over o of max over a' of sum over s' of P(s', o | s, a) Q(a', s').
    Every sweep is a bound, so it may stop anywhere: here when no entry falls by more than `tolerance`, or at
    `deadline` on the monotonic clock.
    """
    A, S, obs = dynamics.actions, dynamics.states, dynamics.observations
    while monotonic() < deadline:
        lowered = np.empty_like(Q)
        for a in range(A):
            # (S', O, A'): what is seen weighs each next action's value
            weighed = dynamics.observing[a].T[:, :, None] * Q.T[:, None, :]
            reached = dynamics.back(a, weighed.reshape(S, obs * A)).reshape(S, obs, A)
            lowered[a] = dynamics.reward[a] + dynamics.discount * reached.max(axis=2).sum(axis=1)
        np.minimum(lowered, Q, out=lowered)
        change = float((Q - lowered).max())
        Q = lowered
        if change <= tolerance:
            break
    return Q


def _mdp_sweep(dynamics: Dynamics, value: Array) -> Array:
    """(A, S) R + gamma T V for a value (S,)."""
    return dynamics.reward + dynamics.discount * np.array(
        [dynamics.back(a, value) for a in range(dynamics.actions)]
    )
