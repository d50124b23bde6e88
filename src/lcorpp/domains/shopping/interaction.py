"""The dialogue of the shopping task as a POMDP, for any values of the shared variables.

The hidden state is the request: one value of each variable. The robot asks for the value of a variable (a
wh-question, e.g. ask_item), asks whether a variable has a value (a yes/no question, e.g. confirm_coffee), or
delivers. Questions do not change the request; a delivery ends the dialogue.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from lcorpp.planning import Pomdp, SparseTables

WH_COST, CONFIRM_COST = 1.5, 1.0
"""Costs of the two kinds of questions; the paper's."""
RIGHT, WRONG = 20.0, -20.0
"""Reward of a delivery with all parts right, and with all parts wrong; the paper's.

With one part wrong it is half of WRONG, as the trip is in vain; each further part that is wrong adds an
equal share of the other half.
"""
HEARD, CONFIRMED = 0.8, 0.9
"""Probabilities that the robot understands the value in an answer, and a yes or a no; all values that it may
understand instead are equally likely."""
DISCOUNT = 0.95


def make_model(values: Mapping[str, Sequence[str]]) -> Pomdp:
    """Return the model; `values`: shared variable -> its values."""
    requests = list(product(*values.values()))
    words = [word for known in values.values() for word in known]
    states = ["_".join(request) for request in requests] + ["done"]
    observations = [*words, "yes", "no", "none"]
    questions = [f"ask_{name}" for name in values] + [f"confirm_{word}" for word in words]
    actions = questions + ["deliver_" + "_".join(request) for request in requests]
    n_actions, n_states = len(actions), len(states)
    transition = np.zeros((n_actions, n_states, n_states))
    observation = np.zeros((n_actions, n_states, len(observations)))
    reward = np.zeros((n_actions, n_states))
    transition[: len(questions)] = np.eye(n_states)
    transition[len(questions) :, :, -1] = 1
    observation[:, -1, -1] = 1  # after a delivery the person says nothing
    observation[len(questions) :, :, -1] = 1
    for s, request in enumerate(requests):
        for a, (word, known) in enumerate(zip(request, values.values(), strict=True)):
            for heard in known:
                p = HEARD if heard == word else (1 - HEARD) / (len(known) - 1)
                observation[a, s, observations.index(heard)] = p
            reward[a, s] = -WH_COST
        for a, word in enumerate(words, start=len(values)):
            p_yes = CONFIRMED if word in request else 1 - CONFIRMED
            observation[a, s, -3:-1] = p_yes, 1 - p_yes
            reward[a, s] = -CONFIRM_COST
        for a, delivered in enumerate(requests, start=len(questions)):
            wrong = sum(given != wanted for given, wanted in zip(delivered, request, strict=True))
            share = (1 + (wrong - 1) / max(len(request) - 1, 1)) / 2
            reward[a, s] = WRONG * share if wrong else RIGHT
    start = np.append(np.full(len(requests), 1 / len(requests)), 0)
    return Pomdp(
        tuple(states),
        tuple(actions),
        tuple(observations),
        SparseTables.of(transition),
        SparseTables.of(observation),
        reward,
        DISCOUNT,
        start,
    )
