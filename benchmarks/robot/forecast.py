"""Forecast of a decision from P(interested), for attention.py: what it yields and how long it takes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lcorpp import Distribution, Domain, Planner, Reasoner
from lcorpp.decision import Robot
from lcorpp.robot.attending import forecast_decision


class Forecast:
    """Value and duration of a decision, from P(interested)."""

    def __init__(self, domain: Domain, planner: Planner) -> None:
        self._domain, self._model = domain, planner.pomdp
        self._robot = Robot({}, Reasoner(domain.program), planner, domain)
        self.of = lru_cache(maxsize=None)(self._forecast)

    def _forecast(self, percent: int, service: float) -> tuple[float, float]:
        """Return P(an interested person is reported as such), and the expected seconds. percent: P in %."""
        p = percent / 100
        belief = self._domain.prior(Distribution(self._domain.values, np.array([p, 1 - p])))
        found = forecast_decision(self._domain, self._robot, self._model, belief, "interested")
        return found.value, found.seconds + service * found.value
