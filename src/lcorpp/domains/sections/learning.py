"""The `[learning]` section of a domain, or several `[[learning]]`: the senses with their classifiers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lcorpp.domains.sections.files import find_file
from lcorpp.domains.sections.names import check_defined, check_same_names, find_attribute_values
from lcorpp.domains.sections.reasoning import ReasoningSection, read_value_mapping
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DataError, DomainError, expected_one_of
from lcorpp.learning.classifiers.learner_table import LEARNERS
from lcorpp.user_code import check_owner, split_function
from lcorpp.values import BASELINE_SIGN, EvidenceKind

_NAME, _BASELINE = re.compile(r"[^\W\d]\w*"), re.compile(r"[^\W\d]\w*(-\w+)+")
"""Names of a sense, and of a baseline."""

CLASSIFIERS = (*LEARNERS, "channel")
"""The learners, and the simulated noisy classifier."""

MAX_SECONDS, MAX_RATE = 3600.0, 1000.0
"""Limits of the duration of recorded tracks, and of their points per second."""

MIN_INTERVAL, DEFAULT_INTERVAL, MAX_INTERVAL = 1e-3, 0.033, 10.0
"""Seconds between two points of simulated tracks; the default is that of the paper's tracker."""


@dataclass(frozen=True)
class Sense:
    """A sense of the robot: a classifier, its labels and its training data: rho of the paper.

    name: for options and reports, by default that of the attribute; of a baseline with `BASELINE_SIGN`.
    attribute: the attribute whose values are the classifier's labels.
    of: the attribute that it classifies.
    label_of: class (a value of `of`) -> label (a value of `attribute`), in the order of `classes`.
    classes: the values of `of`, in the order of their declaration.
    positive: the class that F1, precision and recall refer to; None averages over all classes.
    classifier: name of the default classifier, "channel", or a learner of the domain's own as
        FILE.py:FUNCTION or MODULE:FUNCTION; None takes the learner that suits the data.
    evidence: what a trained classifier gives to the reasoner, unless the command chooses otherwise.
    tracks, epochs: number of simulated training cases, and of passes over them.
    interval: seconds between two points of simulated tracks.
    channels: names of the simulated channels or features; () for x and y, or the numbers of the features.
    data_labels: class name in recorded data -> class.
    report_labels: the class by the robot's report: a shared variable, and its value -> class; `of` itself, if
        it is shared. None if a report is not a label.
    data: recorded data for training and trials; None simulates them.
    data_groups: regular expression that finds the people of a bag in its name, see `read_bags`.
    seconds, rate: duration and points per second to which recorded tracks are cut and resampled; None for
        those of `read_data`. step: seconds between the windows of a track; None for one of each track.
    features, feature_rate: the classifier's features of motion, and points per second; () and None for those
        that suit the learner.

    Examples:
        >>> from lcorpp import load_domain
        >>> (sense,) = load_domain("intention").senses
        >>> sense.name, sense.of, sense.label_of
        ('motion', 'intention', {'interested': 'one', 'not_interested': 'zero'})
    """

    name: str
    attribute: str
    of: str
    label_of: Mapping[str, str]
    classes: tuple[str, ...]
    positive: str | None
    classifier: str | None
    evidence: EvidenceKind
    tracks: int
    epochs: int
    interval: float
    channels: tuple[str, ...]
    data_labels: Mapping[str, str]
    report_labels: tuple[str, Mapping[str, str]] | None
    data: Path | None
    seconds: float | None
    rate: float | None
    data_groups: str | None = None
    step: float | None = None
    features: tuple[str, ...] = ()
    feature_rate: float | None = None

    @property
    def is_baseline(self) -> bool:
        """Whether only the strategy of its name uses it, see `list_strategies`."""
        return BASELINE_SIGN in self.name

    def find_class(self, text: str) -> str:
        """Return the class that a text names: by itself, or by its label in the program.

        Raises:
            DomainError: the text names none.
        """
        for name, label in self.label_of.items():
            if text in (label, name):
                return name
        known = dict.fromkeys([*self.label_of.values(), *self.label_of])
        raise DomainError(f"{text!r} is not a label of {self.name}; {expected_one_of(known)}")


def read_senses(
    tables: tuple[TomlTable, ...], reasoning: ReasoningSection, folder: Path
) -> tuple[Sense, ...]:
    """Read the sections, one for each sense; none for a robot without classifiers.

    Raises:
        DomainError: a name does not fit the P-log program, two senses have the same name or attribute, or a
            file is missing.
    """
    senses: list[Sense] = []
    for table in tables:
        sense = _read_sense(table, reasoning, folder)
        for other, earlier in zip(senses, tables, strict=False):
            for key in ("attribute", "name"):
                if getattr(other, key) == getattr(sense, key):
                    raise DomainError(
                        f"{table.location(key)}: {getattr(sense, key)!r} is already the {key} of the sense at"
                        f" {earlier.location(key)}; expected another {key} for each"
                    )
            if other.attribute == sense.of or sense.attribute == other.of:
                raise DomainError(
                    f"{table.location('of')}: a sense classifies what another sense predicts"
                    f" ({earlier.location('of')})"
                )
        senses.append(sense)
    return tuple(senses)


def _read_sense(table: TomlTable, reasoning: ReasoningSection, folder: Path) -> Sense:
    attribute, program = table.text("attribute"), reasoning.program
    find_attribute_values(table.location("attribute"), attribute, program)
    if attribute in reasoning.shared or attribute in reasoning.observed:
        raise DomainError(f"{table.location('attribute')}: {attribute!r} is already shared or observed")
    of = table.text("of", reasoning.shared[0] if len(reasoning.shared) == 1 else None)
    classes = find_attribute_values(table.location("of"), of, program)
    if of == attribute or of in reasoning.observed:
        raise DomainError(
            f"{table.location('of')}: {of!r} is the sense's own label or observed; expected another attribute"
        )
    if of not in reasoning.shared:  # which are checked
        check_defined(table.location("of"), (of,), program)
    check_defined(table.location("attribute"), (attribute,), program)
    label_of = _read_labels(table, attribute, of, reasoning)
    positive = table.text("positive") if "positive" in table else None
    if positive is not None:
        reasoning.check_value(table.location("positive"), of, positive)
    data_labels = table.mapping("data_labels") if "data_labels" in table else {}
    for name, value in data_labels.items():
        reasoning.check_value(table.location("data_labels", name), of, value)
    is_baseline = table.flag("baseline", default=False)
    name = table.text("name", attribute.replace("_", BASELINE_SIGN) if is_baseline else attribute)
    pattern = _BASELINE if is_baseline else _NAME
    if not pattern.fullmatch(name) or name.upper().startswith("LCORPP-"):
        expected = f"names joined by {BASELINE_SIGN}" if is_baseline else "letters, digits and _"
        raise DomainError(
            f"{table.location('name')}: {name!r}; expected {expected}, as for a function in people.py"
        )
    if "step" in table and "seconds" not in table:
        raise DomainError(f"{table.location('step')}: windows need `seconds`, their duration")
    sense = Sense(
        name=name,
        attribute=attribute,
        of=of,
        label_of=label_of,
        classes=classes,
        positive=positive,
        classifier=_read_classifier(table, folder) if "classifier" in table else None,
        evidence=_read_evidence(table),
        tracks=table.count("tracks", 2 * len(classes), 1600),
        epochs=table.count("epochs", 1, 20),
        interval=table.number("interval", MIN_INTERVAL, MAX_INTERVAL, DEFAULT_INTERVAL),
        channels=table.names("channels", required=False),
        data_labels=data_labels,
        report_labels=_read_report_labels(table, of, classes, reasoning),
        data=_find_existing(table, "data", folder) if "data" in table else None,
        seconds=table.number("seconds", MIN_INTERVAL, MAX_SECONDS) if "seconds" in table else None,
        rate=table.number("rate", 1 / MAX_SECONDS, MAX_RATE) if "rate" in table else None,
        data_groups=_read_pattern(table, "data_groups") if "data_groups" in table else None,
        step=table.number("step", MIN_INTERVAL, MAX_SECONDS) if "step" in table else None,
        features=_read_features(table),
        feature_rate=table.number("feature_rate", 1 / MAX_SECONDS, MAX_RATE)
        if "feature_rate" in table
        else None,
    )
    table.reject_unknown_keys()
    return sense


def _read_features(table: TomlTable) -> tuple[str, ...]:
    """Read the names of features of motion."""
    names = table.names("features", required=False)
    for name in names:
        from lcorpp.learning.features.motion_features import MOTION_FEATURES  # few domains name features

        if name not in MOTION_FEATURES:
            raise DomainError(
                f"{table.location('features')}: unknown feature {name!r}; {expected_one_of(MOTION_FEATURES)}"
            )
    return names


def _read_pattern(table: TomlTable, key: str) -> str:
    """Read a regular expression."""
    pattern = table.text(key)
    try:
        re.compile(pattern)
    except re.error as error:
        raise DomainError(
            f"{table.location(key)}: {pattern!r}: {error}; expected a regular expression"
        ) from None
    return pattern


def _read_labels(table: TomlTable, attribute: str, of: str, reasoning: ReasoningSection) -> dict[str, str]:
    """Read `labels`, a table label -> class, and return class -> label."""
    class_of, location = table.mapping("labels"), table.location("labels")
    classes = tuple(class_of.values())
    for name, names in ((attribute, tuple(class_of)), (of, classes)):
        known = reasoning.program.attributes[name].values
        check_same_names(location, names, known, f"the values of {name} at {reasoning.locate(name)}")
    if len(set(classes)) < len(classes):
        raise DomainError(f"{location}: two labels have the same value")
    return {value: label for label, value in class_of.items()}


def _read_report_labels(
    table: TomlTable, of: str, classes: tuple[str, ...], reasoning: ReasoningSection
) -> tuple[str, Mapping[str, str]] | None:
    """Read the class that each value of one shared variable means: `report_labels.VARIABLE`."""
    if "report_labels" not in table:
        return (of, {value: value for value in classes}) if of in reasoning.shared else None
    location = table.location("report_labels")
    if of in reasoning.shared:
        raise DomainError(f"{location}: a report names {of!r} itself; expected no other labels")
    variable, class_of = read_value_mapping(table.section("report_labels"), reasoning)
    for value, name in class_of.items():
        reasoning.check_value(table.location("report_labels", variable, value), of, name)
    return variable, class_of


def _read_classifier(table: TomlTable, folder: Path) -> str:
    """Read a name of the table, or a learner of the domain's own, whose file is relative to its folder."""
    name, location = table.text("classifier"), table.location("classifier")
    own = split_function(name)
    if own is not None:
        return f"{_find_existing(table, 'classifier', folder, str(own[0]))}:{own[1]}"
    if ":" in name:
        check_owner(folder / "domain.toml", DomainError)  # it chooses a function of any installed module
    elif name not in CLASSIFIERS:
        raise DomainError(
            f"{location}: unknown classifier {name!r}; {expected_one_of(CLASSIFIERS)}, or one of your own as"
            " FILE.py:FUNCTION or MODULE:FUNCTION"
        )
    return name


def _read_evidence(table: TomlTable) -> EvidenceKind:
    try:
        return EvidenceKind.parse(table.text("evidence", "hard"))
    except DataError as error:
        words = str(error).removeprefix("evidence ")
        raise DomainError(f"{table.location('evidence')}: {words}") from None


def _find_existing(table: TomlTable, key: str, folder: Path, name: str | None = None) -> Path:
    """Return a path in the folder that exists."""
    path = find_file(table, key, folder, name)
    if not path.exists():
        raise DomainError(f"{table.location(key)}: no file or folder {path}")
    return path
