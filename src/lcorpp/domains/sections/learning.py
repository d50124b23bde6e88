"""The `[learning]` section of a domain: the classifier, its labels and its training data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from lcorpp.domains.sections.names import check_same_names, find_attribute_values
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of

CLASSIFIERS = ("lstm", "lstm-fast", "summaries", "forest", "minirocket", "channel")
"""Names in `learning.classifiers.registry`, and the simulated noisy classifier."""

MIN_INTERVAL, DEFAULT_INTERVAL, MAX_INTERVAL = 1e-3, 0.033, 10.0
"""Seconds between two points of simulated tracks; the default is that of the paper's tracker."""


@dataclass(frozen=True)
class LearningSection:
    """The classifier, its labels and its training data: rho of the paper.

    attribute: the attribute whose values are the classifier's labels.
    label_of: class (a target value) -> label (a value of `attribute`).
    positive: the target value that F1, precision and recall refer to; None averages over all values.
    classifier: name of the default classifier.
    tracks, epochs: number of simulated training tracks, and of passes over them.
    interval: seconds between two points of simulated tracks.
    data_labels: class name in recorded data -> target value.
    """

    attribute: str
    label_of: Mapping[str, str]
    positive: str | None
    classifier: str
    tracks: int
    epochs: int
    interval: float
    data_labels: Mapping[str, str]


def read_learning(table: TomlTable, reasoning: ReasoningSection) -> LearningSection:
    """Read the section.

    Raises:
        DomainError: a name does not fit the P-log program.
    """
    attribute = table.text("attribute")
    labels = find_attribute_values(table.location("attribute"), attribute, reasoning.program)
    if attribute == reasoning.target or attribute in reasoning.observed:
        raise DomainError(f"{table.location('attribute')}: {attribute!r} is already the target or observed")
    target, declaration = reasoning.target, reasoning.target_declaration
    value_of = table.mapping("labels")
    location = table.location("labels")
    declared = f"{reasoning.program.file}:{reasoning.program.attributes[attribute].line}"
    check_same_names(location, tuple(value_of), labels, f"the values of {attribute} at {declared}")
    values = tuple(value_of.values())
    check_same_names(location, values, reasoning.values, f"the values of {target} at {declaration}")
    if len(set(values)) < len(values):
        raise DomainError(f"{location}: two labels have the same value")
    positive = table.text("positive") if "positive" in table else None
    if positive is not None:
        reasoning.check_value(table.location("positive"), positive)
    classifier = table.text("classifier", "lstm")
    if classifier not in CLASSIFIERS:
        raise DomainError(
            f"{table.location('classifier')}: unknown classifier {classifier!r};"
            f" {expected_one_of(CLASSIFIERS)}"
        )
    data_labels = table.mapping("data_labels") if "data_labels" in table else {}
    for name, value in data_labels.items():
        if value not in reasoning.values:
            raise DomainError(
                f"{table.location('data_labels')}: {name!r} means {value!r}, but {target} cannot be {value!r}"
                f" ({declaration}); {expected_one_of(reasoning.values)}"
            )
    tracks = table.count("tracks", 2 * len(reasoning.values), 1600)
    epochs = table.count("epochs", 1, 20)
    interval = table.number("interval", MIN_INTERVAL, MAX_INTERVAL, DEFAULT_INTERVAL)
    table.reject_unknown_keys()
    label_of = {value: label for label, value in value_of.items()}
    return LearningSection(attribute, label_of, positive, classifier, tracks, epochs, interval, data_labels)
