"""Comparison of strategies: set up the classifiers and the planner of a domain and score the strategies."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.assembly.options import (
    HARD_LABELS,
    ClassifierOptions,
    EvidenceOptions,
)
from lcorpp.assembly.progress import ProgressDisplay, no_progress
from lcorpp.assembly.robot import compose_robot, set_up_senses
from lcorpp.assembly.senses import Senses
from lcorpp.assembly.solving import explain_error, explain_missing_reports
from lcorpp.assembly.strategies.limits import bind_limits, get_plan, keeps_limits, require_limits
from lcorpp.assembly.strategies.trust import check_dialogue
from lcorpp.decision import Strategy
from lcorpp.decision.strategies import list_strategies
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError
from lcorpp.logs.decision_log import DecisionLog
from lcorpp.planning import Policy, Solution, SolverOptions
from lcorpp.scoring.exact_evaluation import check_enumerable, evaluate_exactly
from lcorpp.scoring.experiment import Experiment
from lcorpp.scoring.metrics import Scores, scores_to_html
from lcorpp.scoring.other_people import check_people, make_channel
from lcorpp.scoring.trials import check_numbers, run_trials
from lcorpp.simulation import NoisyChannel
from lcorpp.simulation.people import SignalSource
from lcorpp.simulation.simulated_classifier import BatchClassifier

if TYPE_CHECKING:
    from lcorpp.assembly.strategies.limited_plan import LimitedPlan


@dataclass(frozen=True)
class ComparisonOptions:
    """Options of a comparison.

    strategies: () takes all of the domain.
    classifiers: sense -> options for training or loading its classifier; None, and for other senses, takes
        the domain's noisy channel.
    evidence: labels or likelihoods as the classifiers' evidence for the reasoner.
    trials: the number of simulated people; None computes exact scores, for noisy channels only.
    seed: of all random numbers. jobs: processes; the results are the same for any number.
    solver: of the POMDP; None takes the domain's. cache: a folder that keeps policies, None for none.
    log: a file to which the decisions of the trials are appended.
    people: a domain whose people are simulated, with its answers and rewards, see `check_people`; None takes
        the robot's. The senses are then its noisy channels.

    Raises:
        DataError: an option has another type.
        DecisionError: as of `check_numbers`.
        DomainError: exact scores are requested with classifiers other than noisy channels, or with a log.

    Examples:
        >>> from lcorpp.experiments import ComparisonOptions
        >>> ComparisonOptions(trials=100, seed=1).trials
        100
        >>> ComparisonOptions(trials=0)
        Traceback (most recent call last):
            ...
        lcorpp.errors.DecisionError: `trials` must be at least 1, not 0
    """

    strategies: tuple[Strategy, ...] = ()
    classifiers: Mapping[str, ClassifierOptions] = field(default_factory=dict)
    evidence: EvidenceOptions = HARD_LABELS
    trials: int | None = 5000
    seed: int = 0
    jobs: int = 1
    solver: SolverOptions | None = None
    cache: Path | None = None
    log: Path | None = None
    people: Domain | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        check_numbers(1 if self.trials is None else self.trials, self.jobs, self.seed)
        if self.trials is None and any(self.classifiers.values()):
            raise DomainError(
                "exact scores require the noisy channel: the error rates of a trained classifier are known"
                " from trials only"
            )
        if self.trials is None and self.log is not None:
            raise DomainError(
                f"{self.log}: exact scores are computed without decisions that a log could list"
            )
        if self.people is not None and (self.trials is None or any(self.classifiers.values())):
            raise DomainError("people of another domain are simulated, and their senses are noisy channels")


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result of a comparison.

    scores: one for each strategy, in the order of the options.
    failures: name of a strategy without exact scores -> the reason; the others have theirs.
    trials: the number of completed trials, less than requested after an interrupt; None for exact scores.
    senses: sense -> its classifier and error rates, for the senses that a strategy uses.
    solution: the solution of the POMDP; None if a policy was given.
    plan: of LCORPP+limits; None without it.
    """

    scores: tuple[Scores, ...]
    trials: int | None
    senses: Senses
    solution: Solution | None
    failures: Mapping[str, str] = field(default_factory=dict)
    plan: LimitedPlan | None = None

    @property
    def gap(self) -> float | None:
        """The largest gap between the bounds of the policy at a prior of a strategy's people, if known."""
        return max((row.gap for row in self.scores if row.gap is not None), default=None)

    def __repr__(self) -> str:
        count = "exact" if self.trials is None else f"{self.trials} trials"
        rows = "".join(f"\n  {scores!r}" for scores in self.scores)
        return f"<Comparison, {count}:{rows}>"

    def _repr_html_(self) -> str:
        count = "exact" if self.trials is None else f"{self.trials} people, 95 % intervals"
        return scores_to_html(self.scores, f"Scores of the strategies, {count}")


@check_arguments
def compare_strategies(
    domain: Domain,
    options: ComparisonOptions,
    *,
    policy: Policy | None = None,
    policy_file: Path | None = None,
    progress: ProgressDisplay = no_progress,
) -> Comparison:
    """Set up the robot of a domain and score the strategies (section "Experimental Results" of the paper).

    Args:
        policy: a policy for the domain's POMDP; None solves it. policy_file: its file, for the log.
        progress: displays long steps; called with a title and the number of parts, it returns a context that
            yields a callback with (parts done, parts).

    Raises:
        DomainError: exact scores are requested of a domain with a world of its own; a sense has no noisy
            channel, or no signals to train on; or trust cannot follow the dialogue of the domain, see
            `DomainDialogue`.
        DataError, FileError: the training options or files are wrong.
        KeyboardInterrupt: an interrupt before the first trial was complete.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.experiments import ComparisonOptions, compare_strategies
        >>> options = ComparisonOptions(strategies(["R+P", "LCORPP"]), trials=None)  # exact scores
        >>> comparison = compare_strategies(load_domain("intention"), options)
        >>> {scores.strategy: round(scores.return_.estimate, 2) for scores in comparison.scores}
        {'R+P': 45.98, 'LCORPP': 51.53}
    """
    for name in options.classifiers:
        domain.find_sense(name)
    with ExitStack() as stack:
        log = None if options.log is None else stack.enter_context(DecisionLog(options.log))
        experiment, senses, solution = set_up_experiment(
            domain, options, policy=policy, policy_file=policy_file, progress=progress
        )
        stack.enter_context(explain_missing_reports(solution))
        if options.trials is None:
            channels = {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.all_senses}
            errors: dict[str, DecisionError] = {}
            with progress("enumerating people and answers") as advance:
                exact_scores = evaluate_exactly(
                    domain,
                    experiment.robot,
                    channels,
                    experiment.strategies,
                    progress=advance,
                    on_failure=lambda strategy, error: errors.update({strategy.name: error}),
                )
            if not exact_scores:
                raise next(iter(errors.values()))
            failures = {name: explain_error(error, solution) for name, error in errors.items()}
            return Comparison(tuple(exact_scores), None, senses, solution, failures)
        with progress("simulating trials", options.trials) as advance:
            scores, completed = run_trials(
                experiment, options.trials, jobs=options.jobs, progress=advance, log=log
            )
        plan = get_plan(experiment.strategies)
        return Comparison(tuple(scores), completed, senses, solution, plan=plan)


def set_up_experiment(
    domain: Domain,
    options: ComparisonOptions,
    *,
    policy: Policy | None = None,
    policy_file: Path | None = None,
    progress: ProgressDisplay = no_progress,
) -> tuple[Experiment, Senses, Solution | None]:
    """Train or load the classifiers and solve the POMDP: everything before the first trial.

    Arguments and errors are those of `compare_strategies`.

    Returns:
        The experiment, the setup of each sense that a strategy uses, and the solution of the POMDP, None if a
        policy was given.
    """
    if options.people is not None:
        check_people(domain, options.people)
    strategies = options.strategies or list_strategies([sense.name for sense in domain.all_senses])
    if options.trials is None:
        check_enumerable(domain, strategies)
    check_dialogue(domain, strategies, SolverOptions() if policy is not None else options.solver)
    require_limits(domain, strategies)
    used = [sense for sense in domain.all_senses if any(row.uses(sense.name) for row in strategies)]
    senses = set_up_senses(
        domain, used, options.classifiers, options.evidence, progress, seed=options.seed, jobs=options.jobs
    )
    robot = compose_robot(
        domain,
        senses,
        options.solver,
        policy=policy,
        policy_file=policy_file,
        smoothing=options.evidence.smoothing,
        cache=options.cache,
        progress=progress,
    )
    classifiers: dict[str, BatchClassifier] = {name: setup.classifier for name, setup in senses.items()}
    signals: dict[str, SignalSource] = {name: setup.signals for name, setup in senses.items()}
    if options.people is not None:
        channels = {name: make_channel(options.people, name) for name in senses}
        classifiers, signals = {**channels}, {**channels}
    parts, seed = robot.parts, options.seed
    if any(keeps_limits(row) for row in strategies):
        from lcorpp.assembly.strategies.limited_plan import find_plan  # loads the search

        with progress("keeping the limits") as advance:
            limit = domain.planning.solver.time_limit
            plan = find_plan(domain, parts.program, lambda now: advance(round(now.seconds), round(limit)))
        strategies = bind_limits(strategies, plan)
    experiment = Experiment(
        domain, robot.robot, classifiers, signals, strategies, seed, parts, parts.rates, options.people
    )
    return experiment, senses, robot.solution
