"""The part of a policy that decisions can use: the alpha vectors that are best at reachable beliefs."""

from __future__ import annotations

from dataclasses import replace
from hashlib import blake2b

import numpy as np
import numpy.typing as npt

from lcorpp.domains import Domain
from lcorpp.planning import AlphaVectors, Policy
from lcorpp.values import Array
from lcorpp.values.probabilities import MIN_BRANCH

MAX_BELIEFS = 500_000
"""Distinct beliefs that are visited, the most probable first."""
DIGITS = 9
"""Decimal digits to which beliefs are equal."""
MIN_COMPARED = 0.03
"""At beliefs that are at least as probable, given the evidence, the values of all actions are kept, not only
that of the policy's: the page compares them."""
SAME_VALUE = 1e-9
"""Vectors whose values differ by less are equally good, in reward units."""
BATCH, CHUNK = 16_384, 512
"""Beliefs that are visited at a time, and those that are compared with all vectors at a time."""


def prune_policy(domain: Domain, policy: Policy, priors: Array) -> Policy:
    """Return the policy with the vectors alone that are best at a reachable belief.

    Beliefs are reached from the priors (N, S) by the policy's actions and any answers to them. A belief has
    two probabilities, given its prior: with the answers of the model's people, and with arbitrary answers,
    all possible ones being equally probable; the beliefs with the largest sums are visited. In a belief that
    is not visited, because there are more than `MAX_BELIEFS`, the action may be another one, whose value the
    vectors still bound from below.
    """
    pomdp, reports = domain.pomdp, domain.planning.reports
    questions = [a for a, name in enumerate(pomdp.actions) if name not in reports]
    used: list[set[int]] = [set() for _ in policy.vector_sets]
    seen = set[bytes]()
    frontier, weights = priors, np.ones((len(priors), 2))
    while len(frontier) and len(seen) < MAX_BELIEFS:
        order = np.argsort(-weights.sum(axis=1), kind="stable")[: MAX_BELIEFS - len(seen)]
        now, later = order[:BATCH], order[BATCH:]
        chosen = now[_find_new(frontier[now], seen)]
        beliefs, own = frontier[chosen], weights[chosen]
        actions = _find_actions(policy, beliefs, used)
        children = [(frontier[later], weights[later])]
        compared = own[:, 0] >= MIN_COMPARED
        for a in questions:
            children.append(_branch(domain, beliefs[actions == a], own[actions == a], a))
            _find_actions(policy, _branch(domain, beliefs[compared], own[compared], a)[0], used)
        frontier, weights = (np.concatenate(part) for part in zip(*children, strict=True))
    parts = [
        AlphaVectors(part.states, part.vectors[sorted(rows)], part.actions[sorted(rows)])
        for part, rows in zip(policy.vector_sets, used, strict=True)
        if rows
    ]
    return replace(policy, vector_sets=tuple(parts), upper_bound=None)


def _find_new(beliefs: Array, seen: set[bytes]) -> list[int]:
    """Return the indices of beliefs that are not seen yet, and mark them."""
    new = []
    for i, rounded in enumerate(np.round(beliefs, DIGITS)):
        key = blake2b(rounded.tobytes(), digest_size=16).digest()
        if key not in seen:
            seen.add(key)
            new.append(i)
    return new


def _find_actions(policy: Policy, beliefs: Array, used: list[set[int]]) -> npt.NDArray[np.intp]:
    """Return the policy's actions (n,) at beliefs (n, S); add the best vectors to those of each set."""
    chunks = [beliefs[begin : begin + CHUNK] for begin in range(0, len(beliefs), CHUNK)]
    return np.concatenate([np.empty(0, np.intp), *(_compare(policy, chunk, used) for chunk in chunks)])


def _compare(policy: Policy, beliefs: Array, used: list[set[int]]) -> npt.NDArray[np.intp]:
    """Return `_find_actions` of a few beliefs."""
    shape = len(policy.vector_sets), len(beliefs)
    tops, actions, covers = np.empty(shape), np.empty(shape, np.intp), np.empty(shape, bool)
    tied = np.zeros(len(beliefs), bool)
    for s, (part, rows) in enumerate(zip(policy.vector_sets, used, strict=True)):
        inside = beliefs[:, part.states]
        covers[s] = np.count_nonzero(inside, axis=1) == np.count_nonzero(beliefs, axis=1)
        values = inside @ part.vectors.T
        best = values.argmax(axis=1)
        tops[s], actions[s] = values.max(axis=1), part.actions[best]
        good = (values >= tops[s][:, None] - SAME_VALUE) & inside.any(axis=1, keepdims=True)
        at, vectors = np.divmod(np.flatnonzero(good), good.shape[1])
        rows.update(np.unique(vectors).tolist())
        tied[at[part.actions[vectors] != actions[s][at]]] = True
        tops[s] += policy.floor * np.maximum(0, beliefs.sum(axis=1) - inside.sum(axis=1))
    tops[:, covers.any(axis=0)] = np.where(covers, tops, -np.inf)[:, covers.any(axis=0)]
    chosen: npt.NDArray[np.intp] = actions[tops.argmax(axis=0), np.arange(len(beliefs))]
    tied |= ((tops >= tops.max(axis=0) - SAME_VALUE) & (actions != chosen)).any(axis=0)
    for i in np.flatnonzero(tied):  # rounding decides, so it must be the same
        chosen[i] = policy.action(beliefs[i])
    return chosen


def _branch(domain: Domain, beliefs: Array, weights: Array, action: int) -> tuple[Array, Array]:
    """Return the beliefs (n, S) after an action and each answer, and their probabilities (n, 2)."""
    pomdp, terminal = domain.pomdp, list(domain.planning.terminal)
    predicted = beliefs @ pomdp.transition[action]
    joint = predicted[:, None, :] * pomdp.observation[action].T  # (n, O, S)
    totals = joint.sum(axis=2)
    possible = totals - joint[:, :, terminal].sum(axis=2) > MIN_BRANCH
    counts = np.maximum(1, possible.sum(axis=1))
    rows, answers = np.nonzero(possible)
    probabilities = np.stack([totals[possible], 1 / counts[rows]], axis=1)
    return joint[rows, answers] / totals[possible][:, None], weights[rows] * probabilities
