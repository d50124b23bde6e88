from .decision import STRATEGIES as STRATEGIES, Robot as Robot, dt_control as dt_control, lcorpp as lcorpp
from .domains import Domain as Domain, load_domain as load_domain
from .errors import LcorppError as LcorppError
from .planning import (
    Planner as Planner,
    Pomdp as Pomdp,
    read_policy as read_policy,
    read_pomdp as read_pomdp,
    solve as solve,
    write_policy as write_policy,
)
from .reasoning import (
    Enumeration as Enumeration,
    Reasoner as Reasoner,
    parse_plog as parse_plog,
    read_plog as read_plog,
)
from .values import Instance as Instance
from .worlds import ConsoleWorld as ConsoleWorld

__version__: str
