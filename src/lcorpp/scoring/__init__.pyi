from .exact_evaluation import evaluate_exactly as evaluate_exactly
from .experiment import (
    Experiment as Experiment,
    replay_trial as replay_trial,
)
from .metrics import Scores as Scores
from .trials import run_trials as run_trials
