from .domain import Domain as Domain
from .loading import load_domain as load_domain, shipped_domains as shipped_domains
from .sections.learning import LearningSection as LearningSection
from .sections.planning import PlanningSection as PlanningSection
from .sections.reasoning import ReasoningSection as ReasoningSection
from .sections.simulation import SimulationSection as SimulationSection
