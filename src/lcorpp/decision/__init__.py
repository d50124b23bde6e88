"""The two algorithms of the paper, over protocols only: any parts that fit can take part."""

from lcorpp.decision.dt_control import Robot, dt_control
from lcorpp.decision.lcorpp import Batch, Resumed, lcorpp
from lcorpp.decision.strategies import STRATEGIES, Strategy, strategies

__all__ = ["STRATEGIES", "Batch", "Resumed", "Robot", "Strategy", "dt_control", "lcorpp", "strategies"]
