"""Labels that may be wrong: how probable each class is, by the answers behind a report and the classifier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.domains import Domain
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.label_noise.answer_source import AnswerSource
from lcorpp.learning.label_noise.dawid_skene import estimate_classes
from lcorpp.values import Array, ConfusionMatrix, Dataset, Indices, LabelEvidence
from lcorpp.values.probabilities import MIN_LABEL

MODEL_WEIGHT, MATRIX_WEIGHT = 4.0, 1.0
"""The planner's observation model counts like this many answers to each action by people of each value, and
the confusion matrix against the reports like this many people of each class. Few answers leave the rates of
errors nearly open: the classes would follow the classifier, which would seem better than it is."""


@dataclass(frozen=True, eq=False)
class CorrectedLabels:
    """The labels of a data set, corrected.

    distributions: (cases,) class -> probability; None for a certain label.
    confusion: of the classifier whose predictions were used, estimated for the true classes.
    """

    distributions: tuple[Mapping[str, float] | None, ...]
    confusion: ConfusionMatrix


@check_arguments
def correct_labels(
    domain: Domain, sense: str, dataset: Dataset, predictions: Sequence[str]
) -> CorrectedLabels:
    """Estimate the true classes of the cases that a robot has labelled, and the classifier's error rates.

    The hidden class of a case is the person's shared value. Its evidence are the answers, the observed facts
    and the prediction; what the robot believed is not used, as its models of answers and people may be wrong.
    See `estimate_classes` for the assumptions. The report of a case without recorded
    answers counts as one answer.

    Args:
        dataset: with the evidence of each label that is not certain.
        predictions: (cases,) the class of each case by a classifier that was not trained on it.

    Raises:
        DataError: an action or observation is not in the domain's model, or there are other numbers of cases
            and predictions.
    """
    if len(predictions) != len(dataset):
        raise DataError(f"{len(dataset)} cases need as many predictions, not {len(predictions)}")
    classes = tuple(sorted(domain.find_sense(sense).classes))
    index = {name: number for number, name in enumerate(classes)}
    class_of = np.array([index[domain.class_of(sense, value)] for value in domain.values])
    labels, predicted = (
        np.eye(len(classes))[[index[name] for name in names]] for names in (dataset.labels, predictions)
    )
    uncertain = [(row, evidence) for row, evidence in enumerate(dataset.evidence) if evidence is not None]
    rows, evidence = [row for row, _ in uncertain], [own for _, own in uncertain]
    certain_weights = np.where([own is None for own in dataset.evidence], dataset.weights, 0)
    known = (labels * certain_weights[:, np.newaxis]).T @ predicted
    if not rows:
        return CorrectedLabels((None,) * len(dataset), ConfusionMatrix(classes, known))
    weighted = labels * dataset.weights[:, np.newaxis]
    against_reports = weighted.T @ predicted + np.eye(len(classes)) + 0.5
    against_reports /= against_reports.sum(axis=1, keepdims=True)
    sources = [
        *_find_answers(domain, evidence),
        *_find_reports(evidence, labels[rows], dataset.weights[rows], class_of, classes),
        AnswerSource(predicted[rows], class_of, known + MATRIX_WEIGHT * against_reports),
    ]
    facts = [str(sorted(own.context.items())) for own in evidence]
    contexts = np.unique(np.array(facts, dtype=str), return_inverse=True)[1]
    estimate = estimate_classes(sources, contexts, len(class_of), dataset.weights[rows])
    distributions: list[Mapping[str, float] | None] = [None] * len(dataset)
    for row, probabilities in zip(rows, estimate.posteriors @ np.eye(len(classes))[class_of], strict=True):
        distributions[row] = _drop_improbable(classes, probabilities)
    totals = (known + estimate.counts[-1]).sum(axis=1, keepdims=True)
    confusion = ConfusionMatrix(classes, *_match_intervals(estimate.samples[-1], totals))
    return CorrectedLabels(tuple(distributions), confusion)


def _match_intervals(samples: Array, totals: Array) -> tuple[Array, Array]:
    """Return counts and effective cases (K, K) whose Jeffreys intervals are those of sampled rates.

    The interval of n effective cases with the rate r is that of Beta(r n + 1/2, (1 - r) n + 1/2), which here
    has the mean and the variance of the samples.

    Args:
        samples: (S, K, K) of the rates. totals: (K, 1) number of cases of each class.
    """
    means, variances = samples.mean(axis=0), samples.var(axis=0)
    cases = means * (1 - means) / variances - 2
    rates = np.clip((means * (cases + 1) - 0.5) / np.maximum(cases, 0.5), 0, 1)
    return totals * rates / rates.sum(axis=1, keepdims=True), np.clip(cases, 0, totals)


def _find_answers(domain: Domain, evidence: Sequence[LabelEvidence]) -> list[AnswerSource]:
    """Return the answers to each action whose answers depend on the shared value in the planner's model.

    Values for which the model has the same answers share a row of the estimated rates.
    """
    pomdp = domain.pomdp
    counts = {action: np.zeros((len(evidence), len(pomdp.observations))) for action in pomdp.actions}
    observations = {name: number for number, name in enumerate(pomdp.observations)}
    for case, own in enumerate(evidence):
        for action, observation in own.answers or ():
            if action not in counts or observation not in observations:
                raise DataError(
                    f"the answer {observation!r} to {action!r} is not of the domain {domain.name};"
                    f" {expected_one_of(counts)}, and {expected_one_of(observations)}"
                )
            counts[action][case, observations[observation]] += 1
    sources = []
    for action, answers in counts.items():
        if not answers.any():
            continue
        states = domain.planning.state_values / domain.planning.state_values.sum(axis=0)
        model = states.T @ pomdp.observation[pomdp.action_index(action)]  # (values, observations)
        matrix, rows = np.unique(np.round(model, 9), axis=0, return_inverse=True)
        if len(matrix) > 1:
            heard = (matrix > 0).any(axis=0) | answers.any(axis=0)
            sources.append(AnswerSource(answers, rows, MODEL_WEIGHT * matrix + heard / 2))
    return sources


def _find_reports(
    evidence: Sequence[LabelEvidence],
    reports: Array,
    weights: Array,
    class_of: Indices,
    classes: Sequence[str],
) -> list[AnswerSource]:
    """Return the reports (cases, classes) as answers, for cases whose answers are not known."""
    is_asked = any(own.answers for own in evidence)
    used = np.array([own.answers is None or not is_asked for own in evidence])
    if not used.any():
        return []
    beliefs = np.array([[own.belief.get(name, 0.0) for name in classes] for own in evidence])
    trust = float(np.average((beliefs * reports)[used].sum(axis=1), weights=weights[used]))
    n = len(classes)
    model = np.full((n, n), (1 - trust) / (n - 1)) + np.eye(n) * (trust - (1 - trust) / (n - 1))
    return [AnswerSource(reports * used[:, None], class_of, MODEL_WEIGHT * model + 0.5)]


def _drop_improbable(classes: Sequence[str], probabilities: Array) -> dict[str, float]:
    kept = np.where(probabilities < MIN_LABEL, 0, probabilities)
    return dict(zip(classes, (kept / kept.sum()).tolist(), strict=True))
