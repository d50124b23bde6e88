"""The robot's questions and reports as a POMDP, for any values of the shared variables.

A state is one value of each shared variable; `done` follows a report. A question is about one variable, and
its answer is understood rightly with its reliability; otherwise each other value is equally likely.
"""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from lcorpp.planning import Pomdp, SparseTables

# question: (variable, cost, probability that the answer is understood rightly)
QUESTIONS = {
    "ask": ("wish", 1.0, 0.85),
}
# rewards of a report: all values right, any value wrong
RIGHT, WRONG = 20.0, -20.0
DISCOUNT = 0.95


def make_model(values: Mapping[str, Sequence[str]]) -> Pomdp:
    """Return the model; `values`: shared variable -> its values."""
    cases = list(product(*values.values()))
    states = ["_".join(case) for case in cases] + ["done"]
    reports = ["report_" + "_".join(case) for case in cases]
    actions = [*QUESTIONS, *reports]
    heard = list(dict.fromkeys(value for known in values.values() for value in known))
    observations = [f"hear_{value}" for value in heard] + ["nothing"]
    transition = np.zeros((len(actions), len(states), len(states)))
    observation = np.zeros((len(actions), len(states), len(observations)))
    reward = np.zeros((len(actions), len(states)))
    observation[:, -1, -1] = 1  # nothing is heard after a report
    for a, (question, (variable, cost, reliability)) in enumerate(QUESTIONS.items()):
        if not 0 <= reliability <= 1:
            raise ValueError(f"the reliability of {question} is {reliability}; expected 0 to 1")
        transition[a] = np.eye(len(states))
        known = values[variable]
        for s, case in enumerate(cases):
            truth = dict(zip(values, case, strict=True))[variable]
            for value in known:
                p = reliability if value == truth else (1 - reliability) / (len(known) - 1)
                observation[a, s, heard.index(value)] = p
            reward[a, s] = -cost
    for a in range(len(QUESTIONS), len(actions)):
        transition[a, :, -1] = 1
        observation[a, :, -1] = 1
        reward[a, :-1] = WRONG
        reward[a, a - len(QUESTIONS)] = RIGHT
    start = np.append(np.full(len(cases), 1 / len(cases)), 0)
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
