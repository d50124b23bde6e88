"""Strategies scored twice, exactly and in simulated trials, for the figures that compare them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from lcorpp.assembly.progress import ProgressDisplay
from lcorpp.assembly.solving import solve_domain
from lcorpp.decision.strategies import strategies
from lcorpp.domains import Domain
from lcorpp.experiments.comparison import ComparisonOptions, compare_strategies
from lcorpp.experiments.figures import published
from lcorpp.experiments.figures.result import FigureOptions, Row
from lcorpp.planning import Planner
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.scoring.metrics import Scores, make_cells
from lcorpp.values import Z95, Interval

METRICS = ("f1", "accuracy", "cost", "return")
"""The scores in the tables of figures."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The scores of strategies in one setting.

    setting: e.g. the name of a preset. exact, simulated: strategy -> its scores; the classifier is the
        domain's noisy channel, for which the scores are known exactly.
    trials: the number of simulated people.
    """

    setting: str
    exact: Mapping[str, Scores]
    simulated: Mapping[str, Scores]
    trials: int

    def find_difference(self, metric: str, strategy: str, other: str) -> Interval:
        """Return the simulated "f1", "cost" or "return" of a strategy minus another's, see `Scores`."""
        return self.simulated[strategy].subtract(self.simulated[other])[metric]

    def subtract_exactly(self, metric: str, strategy: str, other: str) -> float:
        """Return the exact score of a strategy minus another's."""
        mine, its = (self.exact[name].metrics[metric].estimate for name in (strategy, other))
        return mine - its

    def describe_difference(self, metric: str, strategy: str, other: str, digits: int) -> str:
        """Return the exact difference of two strategies with its simulated check, for evidence."""
        exact, found = (
            self.subtract_exactly(metric, strategy, other),
            self.find_difference(metric, strategy, other),
        )
        return f"{strategy} - {other} {exact:.{digits}f} (simulated {found:.{digits}f})"

    def describe_score(self, metric: str, strategy: str, digits: int = 3) -> str:
        """Return the exact score of a strategy with its simulated check, for evidence."""
        exact, found = self.exact[strategy].metrics[metric], self.simulated[strategy].metrics[metric]
        return f"{strategy} {exact.estimate:.{digits}f} (simulated {found:.{digits}f})"

    def make_rows(self, **columns: str) -> list[Row]:
        """Return two tidy rows for each strategy; `columns` come first, e.g. the setting."""
        return [
            {
                **columns,
                "strategy": name,
                "scores": kind,
                "trials": trials,
                **make_cells({metric: scores.metrics[metric] for metric in METRICS}),
                "cost_sd": scores.cost_sd,
            }
            for kind, trials, table in (
                ("exact", None, self.exact),
                ("simulated", self.trials, self.simulated),
            )
            for name, scores in table.items()
        ]

    @property
    def largest_error(self) -> float:
        """The largest difference of a simulated from an exact score, in standard errors."""
        errors = [0.0]
        for name, scores in self.simulated.items():
            for metric in METRICS:
                found, true = scores.metrics[metric], self.exact[name].metrics[metric].estimate
                if found.high > found.low:
                    errors.append(2 * Z95 * abs(found.estimate - true) / (found.high - found.low))
        return max(errors)


def evaluate(
    domain: Domain,
    setting: str,
    options: FigureOptions,
    progress: ProgressDisplay,
    *,
    names: Sequence[str] = tuple(published.STRATEGIES),
) -> Evaluation:
    """Score strategies in a domain, with its noisy channel as the classifier.

    Args:
        names: of the strategies; the paper's six by default.

    Raises:
        KeyboardInterrupt: the solver or the trials are interrupted; no trial is kept.
    """
    chosen = ComparisonOptions(
        strategies(names),
        trials=options.n_trials,
        seed=options.seed,
        jobs=options.jobs,
        cache=find_cache_folder(),
    )
    exact = _score(domain, replace(chosen, trials=None), progress)
    return Evaluation(setting, exact, _score(domain, chosen, progress), options.n_trials)


def _score(domain: Domain, options: ComparisonOptions, progress: ProgressDisplay) -> dict[str, Scores]:
    """Return strategy -> its scores; a figure has all of its trials or none."""
    comparison = compare_strategies(domain, options, progress=progress)
    stopped = comparison.solution is not None and comparison.solution.reason == "interrupted"
    if stopped or comparison.trials != options.trials:
        raise KeyboardInterrupt
    return {row.strategy: row for row in comparison.scores}


def make_planner(domain: Domain, progress: ProgressDisplay) -> Planner:
    """Return the planner of a domain's solved POMDP.

    Raises:
        KeyboardInterrupt: the solver is interrupted.
    """
    with progress("solving the POMDP") as advance:
        solution = solve_domain(domain, any_prior=True, cache=find_cache_folder(), advance=advance)
    if solution.reason == "interrupted":
        raise KeyboardInterrupt
    return Planner(solution)
