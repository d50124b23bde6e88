from .active_learning.batches import BatchResult as BatchResult
from .active_learning.run import run_active_learning as run_active_learning
from .active_learning.run_store import RunStore as RunStore
from .active_learning.senses import (
    ActiveLearningOptions as ActiveLearningOptions,
    LearningSenses as LearningSenses,
    set_up_learning as set_up_learning,
)
from .audit.audit import audit_people as audit_people
from .audit.estimates import Audit as Audit
from .audit.logged_people import LoggedPeople as LoggedPeople, read_people as read_people
from .classifier_training import load_trained as load_trained, train_classifier as train_classifier
from .comparison import (
    Comparison as Comparison,
    ComparisonOptions as ComparisonOptions,
    compare_strategies as compare_strategies,
)
from .decision_log import DecisionLog as DecisionLog, LoggedDecision as LoggedDecision, read_log as read_log
from .replay import (
    ChangedPart as ChangedPart,
    ReplayedDecision as ReplayedDecision,
    replay_log as replay_log,
)
from .results import write_batches as write_batches, write_comparison as write_comparison
from .robot_parts import ClassifierPart as ClassifierPart, RobotParts as RobotParts
from .scoring.exact_evaluation import evaluate_exactly as evaluate_exactly
from .scoring.experiment import Experiment as Experiment, replay_trial as replay_trial
from .scoring.metrics import Scores as Scores
from .scoring.trials import run_trials as run_trials
from .setup import (
    EvidenceOptions as EvidenceOptions,
    SenseSetup as SenseSetup,
    StoredOptions as StoredOptions,
    TrainingOptions as TrainingOptions,
    make_robot as make_robot,
    solve_domain as solve_domain,
)
from .strategies.baselines import (
    BASELINES as BASELINES,
    find_strategies as find_strategies,
)
from .strategies.own import load_strategy as load_strategy
from .sweeps.definition import Sweep as Sweep, read_sweep as read_sweep
from .sweeps.results import write_sweep as write_sweep
from .sweeps.running import SweepResult as SweepResult, run_sweep as run_sweep
from .training_data import (
    TrainingData as TrainingData,
    read_training_data as read_training_data,
    simulate_training_data as simulate_training_data,
)
from .watching import LogWatch as LogWatch
