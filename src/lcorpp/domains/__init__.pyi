from .domain import Domain as Domain
from .loading import (
    list_domains as list_domains,
    load_domain as load_domain,
    with_reasoner as with_reasoner,
    with_world as with_world,
)
from .sections.learning import Sense as Sense
from .sections.planning import PlanningSection as PlanningSection
from .sections.reasoning import ReasoningSection as ReasoningSection
from .sections.simulation import SimulationSection as SimulationSection
