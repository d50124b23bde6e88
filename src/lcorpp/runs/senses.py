"""The senses of a robot that learns: which learn from the reports, their initial data, and the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.assembly.estimators import TrainingData, choose_learner
from lcorpp.assembly.options import HARD_LABELS, ClassifierOptions, EvidenceOptions, TrainingOptions
from lcorpp.assembly.progress import ProgressDisplay, no_progress
from lcorpp.assembly.robot import set_up_senses
from lcorpp.assembly.senses import Senses
from lcorpp.assembly.thresholds import parse_goal
from lcorpp.assembly.training_data import make_training_data
from lcorpp.decision import LCORPP, Strategy
from lcorpp.decision.lcorpp import CONFIDENCE
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError, expected_one_of

HARD, SOFT, CORRECTED = LABEL_KINDS = ("hard", "soft", "corrected")
"""A reported case counts for the reported class alone; for each class with the weight of the belief at the
report; or with the probability of the class that `correct_labels` estimates, which corrects C, too."""


@dataclass(frozen=True)
class ActiveLearningOptions:
    """Options of Algorithm 1.

    classifiers: sense -> how to get its classifier. A sense with `TrainingOptions` whose class a report names
        (`Domain.class_of`) learns from the reports; all others stay as they are. A sense that is left out
        learns by default if a report names its class, else it is the domain's noisy channel.
    evidence: labels or likelihoods.
    labels: how far a report is trusted as the label of a case, see `LABEL_KINDS`.
    batch_size: K, decisions between two trainings.
    epsilon, confidence: the run ends when no confusion matrix changes by more than this, with this
        probability; the default of epsilon depends on the number of classes.
    max_batches: the run ends after this many batches.
    strategy: decides about each person; LCORPP+trust learns from each what its sources are worth. The
        classifiers of senses that it does not use are trained all the same.
    watch: whether an alarm is raised if knowledge, rates or hearing are not as stated, see `Alarm`.
    seed: of all random numbers. jobs: processes for training.

    Examples:
        >>> from lcorpp.assembly import TrainingOptions
        >>> from lcorpp.runs import ActiveLearningOptions
        >>> options = ActiveLearningOptions({"motion": TrainingOptions("summaries")}, batch_size=50)
        >>> options.max_batches * options.batch_size  # decisions at most
        1000
        >>> ActiveLearningOptions(batch_size="many")
        Traceback (most recent call last):
            ...
        lcorpp.errors.DataError: ActiveLearningOptions: batch_size is 'many'; expected a whole number
    """

    classifiers: Mapping[str, ClassifierOptions] = field(default_factory=dict)
    evidence: EvidenceOptions = HARD_LABELS
    labels: str = HARD
    batch_size: int = 100
    epsilon: float | None = None
    confidence: float = CONFIDENCE
    max_batches: int = 20
    strategy: Strategy = LCORPP
    watch: bool = False
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        check_fields(self)
        if self.strategy.draws:
            raise DecisionError(
                f"{self.strategy.location} draws its actions; expected one that does not, so that a run that"
                " was interrupted goes on as it would have"
            )

    @property
    def learns_from_people(self) -> bool:
        """Whether the strategy learns from each person, as LCORPP+trust does."""
        return self.strategy.start is not None


@dataclass(frozen=True, eq=False)
class LearningSenses:
    """The senses of a robot that learns.

    data: sense -> its initial data, for each sense that learns. training: sense -> its options.
    fixed: the setups of the others, which stay as they are.
    """

    data: Mapping[str, TrainingData]
    training: Mapping[str, TrainingOptions]
    fixed: Senses


@check_arguments
def find_learning_senses(
    domain: Domain, classifiers: Mapping[str, ClassifierOptions]
) -> dict[str, TrainingOptions]:
    """Return the senses that learn from the reports, with their options; see `ActiveLearningOptions`.

    Raises:
        DomainError: there is none.
    """
    labelled = [sense.name for sense in domain.senses if sense.report_labels is not None]
    if not labelled:
        raise DomainError(
            f"{domain.folder}/domain.toml: no sense classifies a shared variable or has report_labels, so"
            " reports are not labels"
        )
    options = {name: classifiers.get(name, TrainingOptions()) for name in labelled}
    learning = {name: own for name, own in options.items() if isinstance(own, TrainingOptions)}
    if not learning:
        raise DomainError(
            f"nothing learns: the classifiers of {', '.join(labelled)} are given; expected one to train"
        )
    return learning


@check_arguments
def set_up_learning(
    domain: Domain, options: ActiveLearningOptions, *, progress: ProgressDisplay = no_progress
) -> LearningSenses:
    """Make the initial data of the senses that learn, and the classifiers of the others.

    Args:
        progress: as of `run_active_learning`.

    Raises:
        DecisionError: the options name no kind of labels.
        DomainError: no sense learns, or the domain has no such signals or noisy channel.
        DataError, FileError: a threshold, the data, or the files of other classifiers, are wrong.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.assembly import TrainingOptions
        >>> from lcorpp.runs import ActiveLearningOptions, set_up_learning
        >>> training = TrainingOptions("summaries", tracks=20)
        >>> senses = set_up_learning(load_domain("intention"), ActiveLearningOptions({"motion": training}))
        >>> senses.data["motion"].dataset.trajectories.shape, senses.training["motion"].learner
        ((20, 2, 304), 'summaries')
    """
    if options.labels not in LABEL_KINDS:
        raise DecisionError(f"the labels are {options.labels!r}; {expected_one_of(LABEL_KINDS)}")
    for name in options.classifiers:
        domain.find_sense(name)
    training = {
        name: own.complete(domain.find_sense(name))
        for name, own in find_learning_senses(domain, options.classifiers).items()
    }
    for name, own in training.items():
        if own.threshold is not None:
            parse_goal(domain.find_sense(name), own.threshold)  # rejects it before the work
    data = {
        name: make_training_data(domain, domain.find_sense(name), own, options.seed)
        for name, own in training.items()
    }
    training = {name: choose_learner(own, data[name].dataset) for name, own in training.items()}
    others = [sense for sense in domain.senses if sense.name not in training]
    fixed = set_up_senses(
        domain, others, options.classifiers, options.evidence, progress, seed=options.seed, jobs=options.jobs
    )
    return LearningSenses(data, training, fixed)
