"""The plan of LCORPP+limits: the people of a domain as its robot sees them, and the policy for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod

import numpy as np

from lcorpp.assembly.strategies.strategy_table import LIMITS_NAME
from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.planning import (
    LimitedProgress,
    LimitedSolution,
    Pomdp,
    RandomisedPlanner,
    RandomisedPolicy,
    SparseTables,
    solve_limited,
)
from lcorpp.protocols import Reasoner as ReasonerProtocol
from lcorpp.reasoning import Program, Reasoner
from lcorpp.values import Array, Distribution, Label

MAX_CASES = 500
"""Maximum number of combinations of facts and labels."""

PRECISION_SHARE = 1e-3
"""Precision of the search, relative to the range of rewards."""


@dataclass(frozen=True, eq=False)
class Population:
    """The people of a domain as its robot sees them: N cases of facts and labels.

    names: of the facts and the labels. rows: (N) their values. weights: (N,) probabilities.
    starts: (N, S) priors of the planner. factors: (K, N, S) of the costs of the limits.
    """

    names: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    weights: Array
    starts: Array
    factors: Array


def list_population(domain: Domain, program: Program) -> Population:
    """List what the robot may perceive of people, with the probabilities of its own knowledge.

    Args:
        program: with the rates of its classifiers.

    Raises:
        DomainError: the combinations are too many; or no person fulfils the condition of a limit.
    """
    limits, shared = domain.planning.limits, domain.reasoning.shared
    names = (*domain.observed, *domain.label_attributes)
    size = prod(len(program.attributes[name].values) for name in names)
    if size > MAX_CASES:
        raise DomainError(
            f"{domain.folder}: limits need all combinations of facts and labels, and they are {size};"
            f" expected at most {MAX_CASES}"
        )
    conditions = dict.fromkeys(name for limit in limits for name in limit.condition)
    more = [name for name in conditions if name not in (*names, *shared)]
    attributes = (*names, *shared, *more)
    masses = dict[tuple[str, ...], Array]()
    given = dict[tuple[str, ...], Array]()
    for values, p in Reasoner(program).exact(attributes).items():
        person = dict(zip(attributes, values, strict=True))
        row, v = values[: len(names)], domain.values.index(domain.reasoning.join(person))
        masses.setdefault(row, np.zeros(len(domain.values)))[v] += float(p)
        concerned = given.setdefault(row, np.zeros((len(limits), len(domain.values))))
        concerned[:, v] += [float(p) * limit.concerns(person) for limit in limits]
    rows = tuple(row for row, mass in masses.items() if mass.sum() > 0)
    joint = np.array([masses[row] for row in rows])  # (N, V)
    concerned = np.stack([given[row] for row in rows], axis=1)  # (K, N, V)
    totals = concerned.sum(axis=(1, 2))
    for limit, total in zip(limits, totals.tolist(), strict=True):
        if total <= 0:
            raise DomainError(f"{domain.folder}: limit {limit.name}: no person fulfils its condition")
    shares = np.divide(concerned, joint, out=np.zeros_like(concerned), where=joint > 0)
    factors = shares / totals[:, None, None]
    marginals = joint / joint.sum(axis=1, keepdims=True)
    return Population(
        names,
        rows,
        joint.sum(axis=1) / joint.sum(),
        np.array([domain.prior(Distribution(domain.values, own)) for own in marginals]),
        factors @ domain.planning.state_values.T,
    )


def solve_domain_limits(
    domain: Domain,
    program: Program | None = None,
    *,
    time_limit: float | None = None,
    previous: LimitedSolution | None = None,
    callback: Callable[[LimitedProgress], None] | None = None,
) -> LimitedPlan:
    """Search the policy of LCORPP+limits for a domain.

    Args:
        program: with the rates of the robot's classifiers; the domain's own when None.
        time_limit: seconds; None takes that of the domain's solver.
        previous: as of `solve_limited`.

    Raises:
        DomainError: the domain has no limits, or they need too many cases.
        InfeasibleError: no policy keeps the limits.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.assembly import solve_domain_limits
        >>> solution = solve_domain_limits(load_domain("intention", preset="limit_5")).solution
        >>> bool(solution.costs[0] <= 0.05), solution.value > 48
        (True, True)
    """
    limits, pomdp = domain.planning.limits, domain.pomdp
    if not limits:
        raise make_missing_error(domain)
    population = list_population(domain, domain.program if program is None else program)
    solution = solve_limited(
        pomdp,
        [limit.make_limit(domain.planning.state_values) for limit in limits],
        population.starts,
        weights=population.weights,
        models=list_models(domain),
        factors=population.factors,
        precision=PRECISION_SHARE * float(np.ptp(pomdp.reward)),
        time_limit=domain.planning.solver.time_limit if time_limit is None else time_limit,
        previous=previous,
        callback=callback,
    )
    cases = {row: n for n, row in enumerate(population.rows)}
    return LimitedPlan(population.names, cases, solution.policy, solution)


def make_missing_error(domain: Domain) -> DomainError:
    """Return the error that a domain has no limits."""
    preset = "" if domain.preset is None else f" in preset {domain.preset}"
    return DomainError(
        f"{domain.folder}/domain.toml: no [[planning.limits]]{preset}; {LIMITS_NAME} needs one"
    )


def list_models(domain: Domain) -> list[Pomdp]:
    """Return the models for which the limits hold: one for each noise of `limit_noise`; () for the stated."""
    pomdp = domain.pomdp
    return [replace(pomdp, observation=SparseTables.of(own)) for own in domain.simulation.limit_models]


@dataclass(frozen=True, eq=False)
class LimitedPlan:
    """The policy of LCORPP+limits, and from which of its starts a decision begins.

    names: of facts and labels. cases: their values -> index of the start.
    solution: of the search; None for a plan from a log.
    """

    names: tuple[str, ...]
    cases: Mapping[tuple[str, ...], int]
    policy: RandomisedPolicy
    solution: LimitedSolution | None = None

    @property
    def cells(self) -> dict[str, float]:
        """The planned numbers of a row of a file: discounted return, its bound, and the cost of each limit.

        With several models the cost is the largest.
        """
        found, solution = dict[str, float](), self.solution
        if solution is not None:
            found = {"planned_return": solution.value, "planned_return_upper": solution.upper}
            names = [own.name for own in solution.model.stated_limits]
            costs = solution.costs.reshape(-1, len(names)).max(axis=0)
            found |= {f"planned_limit_{name}": float(cost) for name, cost in zip(names, costs, strict=True)}
        return found

    def find_start(self, evidence: Mapping[str, Label]) -> int | None:
        """Return the start of a decision; None if a fact or a label is missing, or is a likelihood."""
        row = tuple(evidence.get(name) for name in self.names)
        return self.cases.get(row) if all(isinstance(value, str) for value in row) else None  # type: ignore[arg-type]


_PLANS: dict[tuple[str, ...], LimitedPlan] = {}
"""Of the domains of this process."""


def find_plan(
    domain: Domain, program: Program, callback: Callable[[LimitedProgress], None] | None = None
) -> LimitedPlan:
    """Return the plan of a domain, which is searched once in this process; errors: `solve_domain_limits`."""
    noise = [own.tobytes().hex() for own in domain.simulation.limit_models]
    limits = [
        f"{own.name} {own.kind} {own.more_than} {own.bound} {own.condition} {own.cost.tobytes().hex()}"
        for own in domain.planning.limits
    ]
    seconds = f"{domain.planning.solver.time_limit}"
    key = (str(program), domain.pomdp.fingerprint, seconds, *limits, *noise)
    if key not in _PLANS:
        _PLANS[key] = solve_domain_limits(domain, program, callback=callback)
    return _PLANS[key]


class StartingPlanner(RandomisedPlanner):
    """The planner of one decision, which begins from the start of the evidence."""

    def __init__(self, plan: LimitedPlan, pomdp: Pomdp, rng: np.random.Generator) -> None:
        super().__init__(plan.policy, pomdp, rng)
        self._plan = plan

    def note(self, evidence: Mapping[str, Label]) -> None:
        """Begin the decision from the start of its evidence; from the nearest prior if there is none."""
        self._start = self._plan.find_start(evidence)


@dataclass(frozen=True, eq=False)
class NotingReasoner:
    """A reasoner that passes the evidence to the planner, too."""

    reasoner: ReasonerProtocol
    planner: StartingPlanner

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution | None:
        self.planner.note(evidence)
        return self.reasoner.posterior(attribute, evidence)
