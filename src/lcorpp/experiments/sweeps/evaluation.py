"""One work unit of a sweep: the scores of the strategies in one configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from typing import Any

from lcorpp.assembly.solving import solve_domain
from lcorpp.assembly.strategies.baselines import find_strategies
from lcorpp.assembly.strategies.strategy_table import LIMITS_NAME
from lcorpp.decision import Strategy
from lcorpp.decision.strategies import list_strategies
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, LcorppError, WorkerError
from lcorpp.experiments.comparison import ComparisonOptions, compare_strategies
from lcorpp.experiments.sweeps.axes import Configuration, Problem, configure
from lcorpp.planning import Solution
from lcorpp.scoring.metrics import Scores, find_reference, make_cells
from lcorpp.work_units.store import hash_unit, make_seed

Rows = list[dict[str, Any]]
"""A row for each strategy: name, scores and differences; an interval has cells NAME, NAME_low, NAME_high."""

CHAIN = ("P", "R+P", "LCORPP")
"""The strategies that the paper's hypotheses order, in ascending order of return."""


def find_key(configuration: Configuration) -> str:
    """Return the key of a configuration: of its values and of the content of its files."""
    return hash_unit({s.name: [s.value, s.digest] for s in configuration})


def evaluate_configuration(problem: Problem, configuration: Configuration) -> Rows:
    """Score the strategies in a configuration.

    The seed of simulated people follows from that of the sweep and from the configuration.

    Raises:
        DecisionError: the configuration is impossible, or a strategy fails in it; the message names it.
    """
    try:
        domain = configure(problem, configuration)
        solution = _solve(_Model.of(domain))
        strategies = find_rows(problem, domain)
        seed = make_seed(problem.seed, find_key(configuration))
        options = ComparisonOptions(strategies=strategies, trials=problem.trials, seed=seed)
        comparison = compare_strategies(domain, options, policy=solution.policy)
    except WorkerError:
        raise
    except LcorppError as error:
        raise DecisionError(f"{describe(configuration)}: {error}") from error
    if comparison.trials != problem.trials:
        raise KeyboardInterrupt
    scores = {row.strategy: row for row in comparison.scores}
    reference = find_reference(comparison.scores).strategy
    planned = {} if comparison.plan is None else comparison.plan.cells
    better = dict.fromkeys(scores, reference) | dict(list_pairs(list(scores)))
    return [
        {
            "strategy": name,
            **row.cells,
            **_describe_difference(scores[better[name]], row),
            **(planned if name == LIMITS_NAME else dict.fromkeys(planned)),
            "converged": solution.converged,
        }
        for name, row in scores.items()
    ]


def try_configuration(problem: Problem, configuration: Configuration) -> Rows | str:
    """Return the scores in a configuration, or a message why there are none."""
    try:
        return evaluate_configuration(problem, configuration)
    except DecisionError as error:
        return str(error)


def describe(configuration: Configuration) -> str:
    """Return a configuration for messages: ``noise = 0.3, discount = 0.9``."""
    return ", ".join(f"{setting.name} = {setting.value}" for setting in configuration)


def list_pairs(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return the pairs of neighbours in `CHAIN`, of those strategies that a sweep has."""
    return list(pairwise(name for name in CHAIN if name in names))


def find_rows(problem: Problem, domain: Domain) -> tuple[Strategy, ...]:
    """Return the strategies of a sweep."""
    senses = [sense.name for sense in domain.all_senses]
    return find_strategies(problem.strategies, senses) if problem.strategies else list_strategies(senses)


@dataclass(frozen=True)
class _Model:
    """A domain, equal to others with the same problem for the solver."""

    key: tuple[object, ...]
    domain: Domain = field(compare=False)

    @classmethod
    def of(cls, domain: Domain) -> _Model:
        starts = domain.start_beliefs()
        return cls((domain.pomdp.fingerprint, starts.tobytes(), domain.planning.solver), domain)


@lru_cache(maxsize=64)
def _solve(model: _Model) -> Solution:
    """Solve the POMDP of a domain, once for each model."""
    return solve_domain(model.domain)


def _describe_difference(better: Scores, scores: Scores) -> dict[str, Any]:
    """Return what a better strategy costs and returns more, with paired intervals; None for itself."""
    gaps = better.subtract(scores)
    cells = make_cells({f"{name}_difference": gaps[name] for name in ("cost", "return")})
    row = {"reference": better.strategy, **cells}
    return dict.fromkeys(row) if better is scores else row
