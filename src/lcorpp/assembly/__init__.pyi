from .classifier_training import (
    load_trained as load_trained,
    train_classifier as train_classifier,
)
from .estimators import TrainingData as TrainingData
from .options import (
    EvidenceOptions as EvidenceOptions,
    StoredOptions as StoredOptions,
    TrainingOptions as TrainingOptions,
)
from .recorded_data import read_training_data as read_training_data
from .robot import (
    DomainRobot as DomainRobot,
    compose_robot as compose_robot,
    decide as decide,
    load_robot as load_robot,
)
from .robot_parts import (
    ClassifierPart as ClassifierPart,
    RobotParts as RobotParts,
)
from .senses import SenseSetup as SenseSetup
from .solving import solve_domain as solve_domain
from .strategies.baselines import (
    BASELINES as BASELINES,
    find_strategies as find_strategies,
)
from .strategies.limited_plan import LimitedPlan as LimitedPlan, solve_domain_limits as solve_domain_limits
from .strategies.own import load_strategy as load_strategy
from .training_data import simulate_training_data as simulate_training_data
