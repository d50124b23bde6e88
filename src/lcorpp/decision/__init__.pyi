from .dt_control import Robot as Robot, dt_control as dt_control
from .lcorpp import (
    Batch as Batch,
    ResumePoint as ResumePoint,
    TrainedSense as TrainedSense,
    lcorpp as lcorpp,
)
from .strategies import (
    LCORPP as LCORPP,
    STRATEGIES as STRATEGIES,
    Strategy as Strategy,
    strategies as strategies,
)
