"""The choice of what simulates the people of a domain."""

from __future__ import annotations

from lcorpp.domains import Domain
from lcorpp.planning import Pomdp
from lcorpp.simulation.table_dynamics import SimulationModel
from lcorpp.simulation.world import Dynamics


def make_dynamics(domain: Domain) -> Dynamics:
    """Return what simulates the people of a domain, by its kind of model.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import make_dynamics
        >>> type(make_dynamics(load_domain("intention"))).__name__
        'SimulationModel'
    """
    model = domain.model
    if isinstance(model, Pomdp):
        return SimulationModel(domain)
    from lcorpp.simulation.generative_dynamics import GenerativeDynamics  # tables do without

    return GenerativeDynamics(domain, model)
