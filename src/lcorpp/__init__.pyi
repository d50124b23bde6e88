from .assembly import decide as decide, load_robot as load_robot
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
from .values import (
    ConfusionMatrix as ConfusionMatrix,
    Dataset as Dataset,
    Distribution as Distribution,
    Episode as Episode,
    Instance as Instance,
    Interval as Interval,
    Likelihood as Likelihood,
    Step as Step,
)
from .worlds import ConsoleWorld as ConsoleWorld

__version__: str
