"""Comparison of strategies: set up the classifier and the planner of a domain and score the strategies."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.decision import STRATEGIES, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError, check_type
from lcorpp.experiments.exact_evaluation import evaluate_exactly
from lcorpp.experiments.metrics import Scores, scores_to_html
from lcorpp.experiments.setup import (
    HARD_LABELS,
    ClassifierOptions,
    ClassifierSetup,
    EvidenceOptions,
    ProgressDisplay,
    StoredOptions,
    TrainingOptions,
    from_channel,
    make_robot,
    no_progress,
    solve_domain,
)
from lcorpp.experiments.trials import Experiment, run_trials
from lcorpp.planning import Planner, Policy, Solution
from lcorpp.simulation import NoisyChannel


@dataclass(frozen=True)
class ComparisonOptions:
    """Options of a comparison.

    classifier: options for training or loading the classifier; None takes the domain's noisy channel.
    evidence: labels or likelihoods as the classifier's evidence for the reasoner.
    trials: the number of simulated people; None computes exact scores, for the noisy channel only.
    seed: of all random numbers. jobs: processes; the results are the same for any number.
    """

    strategies: tuple[Strategy, ...] = STRATEGIES
    classifier: ClassifierOptions = None
    evidence: EvidenceOptions = HARD_LABELS
    trials: int | None = 5000
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        for strategy in self.strategies:
            check_type(strategy, Strategy, "a strategy", DecisionError)
        kinds = (TrainingOptions, StoredOptions, type(None))
        check_type(self.classifier, kinds, "the option `classifier`", DecisionError)


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result of a comparison.

    scores: one for each strategy, in the order of the options.
    trials: the number of completed trials, less than requested after an interrupt; None for exact scores.
    classifier: the classifier and its error rates.
    solution: the solution of the POMDP; None if a policy was given.
    """

    scores: tuple[Scores, ...]
    trials: int | None
    classifier: ClassifierSetup
    solution: Solution | None

    def __repr__(self) -> str:
        count = "exact" if self.trials is None else f"{self.trials} trials"
        rows = "".join(f"\n  {scores!r}" for scores in self.scores)
        return f"<Comparison, {count}:{rows}>"

    def _repr_html_(self) -> str:
        return scores_to_html(self.scores)


def compare_strategies(
    domain: Domain,
    options: ComparisonOptions,
    *,
    policy: Policy | None = None,
    progress: ProgressDisplay = no_progress,
) -> Comparison:
    """Set up the robot of a domain and score the strategies (section "Experimental Results" of the paper).

    Args:
        policy: a policy for the domain's POMDP; None solves it.

    Raises:
        DomainError: exact scores are requested of a classifier other than the noisy channel; the domain has
            no noisy channel or no trajectories.
        DataError, FileError: the training options or files are wrong.
        KeyboardInterrupt: an interrupt before the first trial was complete.
    """
    check_type(domain, Domain, "the domain", DomainError)
    check_type(options, ComparisonOptions, "`options`", DecisionError)
    if options.trials is None and options.classifier is not None:
        raise DomainError(
            "exact scores require the noisy channel: the error rates of a trained classifier are known from"
            " trials only"
        )
    setup, solution = _make_classifier(domain, options, progress), None
    if policy is not None:
        planner = Planner(policy, domain.pomdp)
    else:
        with progress("solving the POMDP"):
            solution = solve_domain(domain)
        planner = Planner(solution)
    robot = make_robot(domain, setup, planner)
    if options.trials is None:
        channel = NoisyChannel.of(domain)
        with progress("enumerating people and answers"):
            exact_scores = evaluate_exactly(domain, robot, channel, options.strategies)
        return Comparison(tuple(exact_scores), None, setup, solution)
    experiment = Experiment(
        domain, robot, setup.classifier, setup.trajectories, options.strategies, options.seed
    )
    with progress("simulating trials", options.trials) as advance:
        scores, completed = run_trials(experiment, options.trials, jobs=options.jobs, progress=advance)
    return Comparison(tuple(scores), completed, setup, solution)


def _make_classifier(
    domain: Domain, options: ComparisonOptions, progress: ProgressDisplay
) -> ClassifierSetup:
    """Train or load the classifier, or make the noisy channel, as the options require."""
    if options.classifier is None:
        return from_channel(domain)
    from lcorpp.experiments.classifier_training import load_trained, train_classifier  # loads scikit-learn

    evidence, seed = options.evidence, options.seed
    if isinstance(options.classifier, StoredOptions):
        return load_trained(domain, options.classifier, evidence, seed=seed)
    return train_classifier(
        domain, options.classifier, evidence, seed=seed, jobs=options.jobs, progress=progress
    )
