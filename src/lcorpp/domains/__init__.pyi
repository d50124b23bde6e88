from .domain import Domain as Domain, Simulation as Simulation
from .loading import load_domain as load_domain, shipped_domains as shipped_domains
