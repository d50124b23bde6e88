"""Mutual information of observations and the shared variables."""

from __future__ import annotations

import numpy as np

from lcorpp.domains.domain import Domain
from lcorpp.values import Array, Belief


def compute_information(domain: Domain, belief: Belief) -> Array:
    """Return (A,) the mutual information, in nats, of each action's observation and the shared variables.

    It is that of P(v, o | b, a), where v is the value after the action. It is 0 for reports.
    """
    pomdp, information = domain.pomdp, np.zeros(len(domain.pomdp.actions))
    for a, action in enumerate(pomdp.actions):
        if domain.reported_value(action) is None:
            predicted = pomdp.transition.forward(a, belief)
            joint = (domain.planning.state_values.T * predicted) @ pomdp.observation.dense[a]  # (V, O)
            independent = np.outer(joint.sum(axis=1), joint.sum(axis=0))
            possible = joint > 0
            total = joint.sum()  # below 1 if the action may end the decision
            ratios = joint[possible] * total / independent[possible]
            information[a] = float(joint[possible] @ np.log(ratios))
    return information
