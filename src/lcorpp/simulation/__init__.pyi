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
from .world import SimulatedWorld as SimulatedWorld, SimulationModel as SimulationModel
