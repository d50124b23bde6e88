from .episodes import Episodes as Episodes, Step as Step, read_episodes as read_episodes
from .folder import write_knowledge as write_knowledge, write_model as write_model
from .knowledge.knowledge import Knowledge as Knowledge, learn_knowledge as learn_knowledge
from .learnt_model import LearntModel as LearntModel, learn_model as learn_model
from .logged import learn_from_log as learn_from_log
from .report import format_report as format_report
from .returns import (
    LearntReturn as LearntReturn,
    estimate_return as estimate_return,
    plan_robustly as plan_robustly,
)
