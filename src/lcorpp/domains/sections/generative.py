"""The keys of a domain with a generative model: the work of the search, and those that need tables."""

from __future__ import annotations

import numpy as np

from lcorpp.domains.sections.states import StateMap
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, ModelError
from lcorpp.planning import GenerativeModel, SearchOptions, Widening
from lcorpp.planning.generative_model import BOUNDS

TABLE_KEYS = (
    "states",
    "terminal",
    "local",
    "solver",
    "precision",
    "time_limit",
    "step_seconds",
    "answers",
    "recogniser",
)
"""Keys that need a model with tables."""


SIMULATION_KEYS = ("simulations", "widening")
"""Keys of a search by simulations, without bounds."""

EXPANSION_KEYS = ("expansions", "samples")
"""Keys of a search with bounds."""


def map_values(model: GenerativeModel) -> StateMap:
    """Return the shared values of the named states: one state each, then the terminal one."""
    n = len(model.values)
    return StateMap(np.eye(n, n + 1), np.eye(n + 1, n), (n,))


def read_search(table: TomlTable, model: GenerativeModel) -> SearchOptions:
    """Read `particles`, and `simulations` and `widening`, or `expansions` and `samples`.

    Raises:
        DomainError: a number is out of range, or a key needs a model with tables.
    """
    table.reject_keys(TABLE_KEYS, f"{model.file} is simulated, it has no tables")
    default = SearchOptions.for_model(model)
    particles = table.count("particles", 1, default.particles)
    if model.has_bounds:
        table.reject_keys(SIMULATION_KEYS, f"{model.file} has bounds, so that the search is another one")
        return SearchOptions(
            particles=particles,
            expansions=table.count("expansions", 1, default.expansions),
            samples=table.count("samples", 1, default.samples),
        )
    table.reject_keys(EXPANSION_KEYS, f"{model.file} has no methods {' and '.join(BOUNDS)}")
    return SearchOptions(
        simulations=table.count("simulations", 1, default.simulations),
        particles=particles,
        widening=_read_widening(table) if "widening" in table else default.widening,
    )


def _read_widening(table: TomlTable) -> Widening:
    value, location = table.value("widening"), table.location("widening")
    if not isinstance(value, list) or len(value) != 2:
        raise DomainError(f"{location}: {value!r}; expected [FACTOR, POWER], e.g. [4, 0.05]")
    try:
        return Widening(*value)
    except ModelError as error:
        raise DomainError(f"{location}: {error}") from None
