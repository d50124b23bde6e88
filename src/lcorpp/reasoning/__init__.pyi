from .answers import (
    PossibleWorld as PossibleWorld,
)
from .choices.credal import (
    CredalProgram as CredalProgram,
    ProbabilityBounds as ProbabilityBounds,
    bound_probability as bound_probability,
    parse_credal_program as parse_credal_program,
    read_credal_program as read_credal_program,
)
from .choices.decision_problems import (
    BestDecisions as BestDecisions,
    DecisionProblem as DecisionProblem,
    choose_decisions as choose_decisions,
    parse_decision_problem as parse_decision_problem,
    read_decision_problem as read_decision_problem,
)
from .circuit.circuit import Circuit as Circuit
from .circuit.storage import load_circuit as load_circuit, save_circuit as save_circuit
from .classifier_rules import with_classifier as with_classifier
from .enumeration.reasoner import Enumeration as Enumeration
from .estimation import (
    Estimate as Estimate,
    EstimatedDistribution as EstimatedDistribution,
)
from .explanation import (
    Explanation as Explanation,
    FiredRule as FiredRule,
    explain as explain,
    find_fired as find_fired,
)
from .filtering import Filter as Filter
from .language.issues import ReasoningWarning as ReasoningWarning
from .language.parser import parse_plog as parse_plog, parse_query as parse_query, read_plog as read_plog
from .language.program import Program as Program, program_text as program_text
from .language.signature import Attribute as Attribute
from .language.syntax import Query as Query
from .reasoner import Reasoner as Reasoner, ask as ask
from .tabulation import table_text as table_text
