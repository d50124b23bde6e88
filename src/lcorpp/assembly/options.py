"""Options of classifiers: how they are trained or loaded, how data are read, and what evidence they give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

from lcorpp.domains.sections.learning import Sense
from lcorpp.learning.classifiers.learner_table import LEARNERS
from lcorpp.learning.features.rate import RATE
from lcorpp.values import JEFFREYS, EvidenceKind


@dataclass(frozen=True)
class ReadingOptions:
    """How to read recorded data; see `read_data`.

    labels: label in the file -> class, besides the domain's `data_labels`.
    label_file: a CSV of ids and labels. repair: the kinds of faults to repair.
    robot: the robot's pose in the frame of the file.
    gap: maximum number of seconds between two samples of one person; None for the default.
    columns, unit, time_unit, fps: names of columns, and units.
    """

    labels: Mapping[str, str] = field(default_factory=dict)
    label_file: Path | None = None
    repair: tuple[str, ...] = ()
    robot: tuple[float, float, float] | None = None
    gap: float | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    unit: str | float | None = None
    time_unit: str | float | None = None
    fps: float | None = None


READ_AS_IT_IS = ReadingOptions()
"""Without repairs or other frames."""


@dataclass(frozen=True)
class TrainingOptions:
    """Options for training a classifier.

    learner: a name in `lcorpp.learning.learner`'s table, MODULE:FUNCTION or FILE.py:FUNCTION; None takes the
        one that suits the data.
    epochs: None takes the number that suits the data. device: "cpu" or "cuda".
    features: the classifier's features of the motion; None takes those of the domain, or that suit the
        learner.
    threshold: the decision threshold of the positive class: a number, the name of a metric to optimise, or
        the costs of a miss and of a false alarm as MISS:ALARM; None predicts the most probable class.
    prevalence: of the positive class, for thresholds; None takes it from the domain's knowledge.
    tracks: number of simulated training tracks; None takes the domain's number.
    data: recorded data for training and trials; None takes the domain's, or simulates them.
    reading: how to read them.
    rate: points of motion per second, see `Motion`; None takes the domain's, or 3.
    seconds: the last seconds of each track that are used; None takes those of the domain, or all.
    balance: "classes": equal total weight of all classes in the training; "none": of all cases.

    Examples:
        >>> from lcorpp.assembly import TrainingOptions
        >>> options = TrainingOptions("summaries", tracks=40)  # others as the data and the domain suggest
        >>> options.epochs is None, options.device
        (True, 'cpu')
    """

    learner: str | None = None
    epochs: int | None = None
    device: str = "cpu"
    features: tuple[str, ...] | None = None
    threshold: str | None = None
    prevalence: float | None = None
    tracks: int | None = None
    data: Path | None = None
    reading: ReadingOptions = READ_AS_IT_IS
    rate: float | None = None
    seconds: float | None = None
    balance: str = "classes"

    def complete(self, sense: Sense) -> TrainingOptions:
        """Return the options with the features and the rate of a sense, where none are given."""
        rate = sense.feature_rate if self.rate is None else self.rate
        row = LEARNERS.get(self.learner or "")
        own = () if row is not None and row.has_fixed_features else sense.features
        features = self.features or own or None
        return replace(self, features=features, rate=rate or RATE)


@dataclass(frozen=True)
class StoredOptions:
    """Options for loading a stored classifier.

    file: the classifier.
    data: recorded data for the trials; None takes the domain's, or simulates them. reading: how to read them.
    seconds: as in `TrainingOptions`.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_robot
        >>> from lcorpp.assembly import StoredOptions
        >>> options = StoredOptions(Path("motion.npz"))  # which `save_classifier` has written
        >>> load_robot("intention", classifiers={"motion": options})
        Traceback (most recent call last):
            ...
        lcorpp.errors.FileError: motion.npz: ...
    """

    file: Path
    data: Path | None = None
    reading: ReadingOptions = READ_AS_IT_IS
    seconds: float | None = None


ClassifierOptions = TrainingOptions | StoredOptions | None
"""How to get a classifier; None is the domain's noisy channel."""


@dataclass(frozen=True)
class EvidenceOptions:
    """The classifier's evidence for the reasoner.

    kinds: sense -> kind of evidence; the others give labels, as noisy channels always do.
    smoothing: added to the counts of the confusion matrix that becomes the rules for labels.

    Examples:
        >>> from lcorpp.assembly import EvidenceOptions
        >>> from lcorpp.values import LAPLACE, EvidenceKind
        >>> options = EvidenceOptions({"motion": EvidenceKind("soft")}, smoothing=LAPLACE)
        >>> options.kind("motion").is_likelihood, options.kind("gaze").is_likelihood
        (True, False)
    """

    kinds: Mapping[str, EvidenceKind] = field(default_factory=dict)
    smoothing: Fraction = JEFFREYS

    def kind(self, sense: str) -> EvidenceKind:
        """Return the kind of evidence of a trained sense."""
        return self.kinds.get(sense, LABEL)


LABEL = EvidenceKind()
"""A label as evidence."""


HARD_LABELS = EvidenceOptions()
"""Labels as evidence, with Jeffreys' smoothing."""
