"""A domain is a folder: what is observed, learnt, known, shared, planned and simulated, in its own words."""

from lcorpp.domains.domain import Domain, Simulation
from lcorpp.domains.loading import load_domain, shipped_domains

__all__ = ["Domain", "Simulation", "load_domain", "shipped_domains"]
