"""Policies that several planning tests share, made without the solver."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from lcorpp.planning import BatchPolicy, Policy, Pomdp, update
from lcorpp.planning.belief import observation_probabilities
from lcorpp.values import Array


def blind_values(pomdp: Pomdp) -> Array:
    """Return (A, S) the values of repeating one action."""
    S = len(pomdp.states)
    return np.array(
        [
            np.linalg.solve(np.eye(S) - pomdp.discount * pomdp.transition[a], pomdp.reward[a])
            for a in range(len(pomdp.actions))
        ]
    )


def back_up(pomdp: Pomdp, rounds: int, beliefs: Array | None = None) -> Policy:
    """Return point-based backups of the blind vectors, without pruning."""
    points = np.array([pomdp.start, *np.eye(len(pomdp.states))]) if beliefs is None else beliefs
    vectors, actions = list(blind_values(pomdp)), list(range(len(pomdp.actions)))
    for _ in range(rounds):
        table = np.array(vectors)
        for belief in points:
            made = [_backup(pomdp, belief, a, table) for a in range(len(pomdp.actions))]
            best = int(np.argmax([vector @ belief for vector in made]))
            vectors.append(made[best])
            actions.append(best)
    return Policy.of(pomdp, vectors, actions)


def _backup(pomdp: Pomdp, belief: Array, action: int, table: Array) -> Array:
    T, Z = pomdp.transition[action], pomdp.observation[action]
    vector = np.array(pomdp.reward[action])
    for o in range(len(pomdp.observations)):
        best = int((table @ (Z[:, o] * (T.T @ belief))).argmax())
        vector += pomdp.discount * T @ (Z[:, o] * table[best])
    return vector


@st.composite
def policies(draw: st.DrawFn, pomdp: Pomdp) -> Policy:
    """Draw arbitrary vectors, whose values need not be attainable."""
    count = draw(st.integers(1, 4))
    numbers = st.lists(st.integers(-9, 9), min_size=len(pomdp.states), max_size=len(pomdp.states))
    vectors = [draw(numbers) for _ in range(count)]
    actions = [draw(st.integers(0, len(pomdp.actions) - 1)) for _ in range(count)]
    return Policy.of(pomdp, vectors, actions)


def enumerate_reward(pomdp: Pomdp, policy: Policy, steps: int, belief: Array | None = None) -> float:
    """Return a policy's reward in some steps, by enumeration of all histories."""
    at = pomdp.start if belief is None else belief
    if steps == 0:
        return 0.0
    action = int(BatchPolicy(policy).values_and_actions(at[None])[1][0])
    total = float(pomdp.reward[action] @ at)
    for o, chance in enumerate(observation_probabilities(pomdp, at, action)):
        if chance > 0:
            ahead = enumerate_reward(pomdp, policy, steps - 1, update(pomdp, at, action, o))
            total += pomdp.discount * float(chance) * ahead
    return total
