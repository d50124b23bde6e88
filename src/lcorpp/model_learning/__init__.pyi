from .episodes import Episodes as Episodes, Step as Step, read_episodes as read_episodes
from .folder import write_model as write_model
from .learnt_model import LearntModel as LearntModel, learn_model as learn_model
from .report import format_report as format_report
