"""The recogniser in the loop: a policy acts on what is heard in cases of the test."""

from __future__ import annotations

import numpy as np

from lcorpp.hearing.answers import SaidModel
from lcorpp.hearing.rates import HeardCases
from lcorpp.planning import Planner
from lcorpp.values import Indices, Interval

MAX_STEPS = 100
"""Maximum number of actions of a trial."""


def simulate_loop(
    planner: Planner, said: SaidModel, cases: HeardCases, trials: int, rng: np.random.Generator
) -> Interval:
    """Return the discounted reward of a policy whose observations are those of the recogniser.

    The hidden state moves by the model. What is said is drawn by the assumption, the noise by its share, and
    then one of the cases in which the recogniser heard this. Rows that the model keeps as stated, such as
    reports, have the stated observations.

    Args:
        planner: the policy and its model, whose observations are those of the cases.
        cases: of the test.
        trials: number of trials from the model's initial belief.
    """
    pool: dict[tuple[int, int], Indices] = {}
    for kind in range(len(cases.kinds)):
        for noise in range(len(cases.noises)):
            chosen = (cases.said == kind) & (cases.noise == noise)
            pool[kind, noise] = cases.heard[chosen]
    returns = [_run_trial(planner, said, cases, pool, rng) for _ in range(trials)]
    return Interval.from_sample(np.array(returns))


def _run_trial(
    planner: Planner,
    said: SaidModel,
    cases: HeardCases,
    pool: dict[tuple[int, int], Indices],
    rng: np.random.Generator,
) -> float:
    pomdp = planner.pomdp
    belief, total, factor = pomdp.start, 0.0, 1.0
    state = int(rng.choice(len(pomdp.states), p=pomdp.start))
    for _ in range(MAX_STEPS):
        action = planner.action(belief)
        a = pomdp.action_index(action)
        total += factor * float(pomdp.reward[a, state])
        factor *= pomdp.discount
        following, probabilities = pomdp.transition.row(a, state)
        state = int(rng.choice(following, p=probabilities))
        if not said.is_measured[a, state]:
            break  # the person has gone: a report, or a terminal state
        kind = int(rng.choice(len(cases.kinds), p=said.probabilities[a, state]))
        noise = int(rng.choice(len(cases.noises), p=cases.shares))
        heard = int(rng.choice(pool[kind, noise]))
        belief = planner.update(belief, action, pomdp.observations[heard])
    return total
