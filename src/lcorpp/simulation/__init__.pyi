from .dynamics import make_dynamics as make_dynamics
from .people import (
    Population as Population,
    RecordedSignals as RecordedSignals,
    SimulatedSignals as SimulatedSignals,
    simulate_dataset as simulate_dataset,
    simulate_signals as simulate_signals,
)
from .people_stream import DecisionResult as DecisionResult, PeopleStream as PeopleStream
from .recordings import simulate_recording as simulate_recording
from .simulated_classifier import NoisyChannel as NoisyChannel, classify_perceived as classify_perceived
from .table_dynamics import SimulationModel as SimulationModel
from .world import Dynamics as Dynamics, SimulatedWorld as SimulatedWorld
