"""The decision threshold of a trained classifier: from the user's goal and the class prevalence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcorpp.assembly.options import TrainingOptions
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DataError
from lcorpp.learning import (
    DecisionThreshold,
    TrainedClassifier,
    Validation,
    apply_threshold,
    choose_threshold,
)
from lcorpp.learning.evaluation.thresholds import resolve_goal

MIN_PREVALENCE = 1e-3
"""Lower bound on the prevalence of a class that the knowledge rules out, so that thresholds exist."""

Goal = str | tuple[float, float] | float
"""A goal by name, the costs of a miss and of a false alarm, or the threshold itself."""


def set_threshold(
    domain: Domain,
    sense: Sense,
    options: TrainingOptions,
    trained: TrainedClassifier,
    validation: Validation,
) -> tuple[TrainedClassifier, Validation]:
    """Return the classifier and its validation with the threshold of the options; as they are without one.

    Raises:
        DataError: as `parse_goal`.
    """
    if options.threshold is None:
        return trained, validation
    positive = find_positive_class(sense)
    prevalence = compute_class_prevalence(domain, sense, options.prevalence)[positive]
    threshold = select_threshold(validation, positive, prevalence, parse_goal(sense, options.threshold))
    predictions = apply_threshold(validation.classes, validation.probabilities, threshold)
    validation = validation.with_predictions(predictions)
    return replace(trained, confusion=validation.confusion, threshold=threshold), validation


def parse_goal(sense: Sense, text: str) -> Goal:
    """Parse a goal: a number, the name of a metric, or two costs as MISS:ALARM.

    Raises:
        DataError: the text is not a goal, or the sense has more than two classes and none is positive.
    """
    if len(sense.classes) > 2 and sense.positive is None:
        raise DataError(
            f"--threshold is for the positive class; {sense.name} has {len(sense.classes)} classes:"
            f" name one of them as `positive` in [learning]"
        )
    try:
        numbers = [float(part) for part in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) == 1:
        return DecisionThreshold(find_positive_class(sense), numbers[0]).probability
    goal = (numbers[0], numbers[1]) if len(numbers) == 2 else text
    resolve_goal(goal)
    return goal


def find_positive_class(sense: Sense) -> str:
    """Return the positive class of a sense, or the last in alphabetical order if it has none."""
    return sense.positive or max(sense.classes)


def compute_class_prevalence(
    domain: Domain, sense: Sense, positive_prevalence: float | None = None
) -> dict[str, float]:
    """Return the prevalence of each class: from the domain's knowledge, or with a given positive class.

    Args:
        positive_prevalence: replaces the prevalence of the positive class; the others keep their ratios.

    Raises:
        DomainError: a reasoner of the domain's own decides, and the classes are not the shared values.
    """
    if sense.of != domain.shared:
        domain.check_program_decides(f"the prevalence of the classes of {sense.name}")
    marginal = domain.make_reasoner(domain.program).posterior(sense.of, {})
    assert marginal is not None
    shares = {value: max(share, MIN_PREVALENCE) for value, share in marginal}
    total = sum(shares.values())
    prevalence = {value: share / total for value, share in shares.items()}
    if positive_prevalence is None:
        return prevalence
    positive, given = find_positive_class(sense), positive_prevalence
    others = 1 - prevalence[positive]
    return {v: given if v == positive else p * (1 - given) / others for v, p in prevalence.items()}


def select_threshold(
    validation: Validation, positive: str, prevalence: float, goal: Goal
) -> DecisionThreshold:
    """Return the given threshold, or the best one for a goal on the out-of-fold probabilities."""
    if isinstance(goal, float):
        return DecisionThreshold(positive, goal)
    probabilities = validation.probabilities[:, validation.classes.index(positive)]
    truth = np.array(validation.labels) == positive
    best = choose_threshold(
        probabilities,
        truth,
        validation.folds,
        prevalence=prevalence,
        goal=goal,
        weights=validation.weights,
    )
    return DecisionThreshold(positive, best.probability)
