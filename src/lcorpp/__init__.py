"""lcorpp: learn what can be learnt, reason with what people know, plan what to ask, then decide.

An implementation of LCORPP (Amiri, Shirazi and Zhang, AAAI 2020). The names below load their part of the
package when they are first used, so that `import lcorpp` stays cheap.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lcorpp.decision import STRATEGIES, Robot, dt_control, lcorpp
    from lcorpp.domains import Domain, load_domain
    from lcorpp.errors import LcorppError
    from lcorpp.planning import Planner, Pomdp, read_policy, read_pomdp, solve, write_policy
    from lcorpp.reasoning import Enumeration, parse_plog, read_plog
    from lcorpp.robots import ConsoleWorld
    from lcorpp.values import Instance

__version__ = "0.1.0"

_HOMES = {
    "decision": ("STRATEGIES", "Robot", "dt_control", "lcorpp"),
    "domains": ("Domain", "load_domain"),
    "errors": ("LcorppError",),
    "planning": ("Planner", "Pomdp", "read_policy", "read_pomdp", "solve", "write_policy"),
    "reasoning": ("Enumeration", "parse_plog", "read_plog"),
    "robots": ("ConsoleWorld",),
    "values": ("Instance",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "STRATEGIES",
    "ConsoleWorld",
    "Domain",
    "Enumeration",
    "Instance",
    "LcorppError",
    "Planner",
    "Pomdp",
    "Robot",
    "dt_control",
    "lcorpp",
    "load_domain",
    "parse_plog",
    "read_plog",
    "read_policy",
    "read_pomdp",
    "solve",
    "write_policy",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
