"""Comparison of strategies: the classifier, the planner and the scores of a run in one value."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.decision import STRATEGIES, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.experiments.exact_evaluation import evaluate_exactly
from lcorpp.experiments.metrics import Scores, scores_to_html
from lcorpp.experiments.progress import Progress, no_progress
from lcorpp.experiments.setup import (
    HARD_LABELS,
    ClassifierOptions,
    ClassifierSetup,
    EvidenceOptions,
    StoredOptions,
    from_channel,
    make_robot,
    solve_domain,
)
from lcorpp.experiments.trials import Experiment, run_trials
from lcorpp.planning import Planner, Policy, Solution
from lcorpp.simulation.channel import NoisyChannel


@dataclass(frozen=True)
class ComparisonOptions:
    """Options of a comparison.

    classifier: how to get the classifier. evidence: the classifier's evidence for the reasoner.
    trials: the number of simulated people; None enumerates people and answers, for a noisy channel only.
    seed: of everything that is drawn. jobs: processes; the results are the same for any number.
    """

    strategies: tuple[Strategy, ...] = STRATEGIES
    classifier: ClassifierOptions = None
    evidence: EvidenceOptions = HARD_LABELS
    trials: int | None = 5000
    seed: int = 0
    jobs: int = 1


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result of a comparison.

    scores: one for each strategy, in the order of the options.
    trials: the number of completed trials, less than requested after an interrupt; None for exact scores.
    classifier: the classifier and its error rates. solution: of the POMDP; None if a policy was given.
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
    progress: Progress = no_progress,
) -> Comparison:
    """Set up the robot of a domain and score the strategies (section "Experimental Results").

    Args:
        policy: a policy for the domain's POMDP; None solves it.

    Raises:
        DomainError: exact scores of a classifier that is no noisy channel; the domain lacks a channel or
            trajectories.
        DataError, FileError: the training options or files are wrong.
        KeyboardInterrupt: an interrupt before the first trials were complete.
    """
    if options.trials is None and options.classifier is not None:
        raise DomainError(
            "--exact needs --classifier channel: the errors of a trained one are known from trials only"
        )
    classifier = make_classifier(domain, options, progress)
    solution = None
    if policy is not None:
        planner = Planner(policy, domain.pomdp)
    else:
        with progress("solving the POMDP"):
            solution = solve_domain(domain)
        planner = Planner(solution)
    robot = make_robot(domain, classifier, planner)
    if options.trials is None:
        channel = NoisyChannel.of(domain)
        with progress("enumerating people and answers"):
            exact = evaluate_exactly(domain, robot, channel, options.strategies)
        return Comparison(tuple(exact), None, classifier, solution)
    experiment = Experiment(
        domain, robot, classifier.classifier, classifier.trajectories, options.strategies, options.seed
    )
    with progress("simulating trials", options.trials) as advance:
        scores, done = run_trials(experiment, options.trials, jobs=options.jobs, progress=advance)
    return Comparison(tuple(scores), done, classifier, solution)


def make_classifier(domain: Domain, options: ComparisonOptions, progress: Progress) -> ClassifierSetup:
    """Return the classifier that the options describe."""
    if options.classifier is None:
        return from_channel(domain)
    from lcorpp.experiments.classifier_training import load_trained, train_classifier

    if isinstance(options.classifier, StoredOptions):
        return load_trained(domain, options.classifier, options.evidence, seed=options.seed)
    return train_classifier(
        domain,
        options.classifier,
        options.evidence,
        seed=options.seed,
        jobs=options.jobs,
        progress=progress,
    )
