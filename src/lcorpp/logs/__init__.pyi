from .decision_log import (
    DecisionLog as DecisionLog,
    LoggedDecision as LoggedDecision,
    read_log as read_log,
)
from .replay import (
    ChangedPart as ChangedPart,
    ReplayedDecision as ReplayedDecision,
    replay_log as replay_log,
)
from .watching import LogWatch as LogWatch
