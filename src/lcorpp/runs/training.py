"""The training of Algorithm 1: the classifiers on the labels so far, and the rules with their error rates."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace

import numpy as np

from lcorpp.assembly.estimators import make_estimator
from lcorpp.assembly.progress import Advance, ProgressDisplay
from lcorpp.assembly.robot import describe_classifiers
from lcorpp.assembly.robot_parts import ClassifierPart
from lcorpp.assembly.soft_rates import compute_soft_rates
from lcorpp.assembly.thresholds import set_threshold
from lcorpp.decision import Batch
from lcorpp.decision.lcorpp import Training
from lcorpp.decision.strategies import Rates
from lcorpp.domains import Domain
from lcorpp.learning import TrainedClassifier, Validation, cross_validate, train_and_validate
from lcorpp.learning.classifiers.registry import check_weighted
from lcorpp.learning.evaluation.folds import FOLDS, choose_folds
from lcorpp.learning.evaluation.validation import count_confusion
from lcorpp.learning.label_noise.uncertain_labels import split_by_class
from lcorpp.protocols import Classifier, Reasoner
from lcorpp.runs.corrected_labels import correct_labels
from lcorpp.runs.senses import (
    CORRECTED,
    HARD,
    SOFT,
    ActiveLearningOptions,
    LearningSenses,
)
from lcorpp.runs.untrained import RandomClassifier, is_trainable
from lcorpp.values import COVERAGE, ConfusionMatrix, Dataset


class SenseTrainer:
    """Trains the senses that learn, each with the learner of its options."""

    def __init__(
        self,
        domain: Domain,
        senses: LearningSenses,
        options: ActiveLearningOptions,
        progress: ProgressDisplay,
    ) -> None:
        """Raises `DataError` if uncertain labels are for a learner without `sample_weight`."""
        self._domain, self._senses, self._options, self._progress = domain, senses, options, progress
        self._split = {"seed": options.seed, "jobs": options.jobs}
        self._estimators = {  # later people come to the same place
            name: make_estimator(data, senses.training[name], options.seed, new_places=False)
            for name, data in senses.data.items()
        }
        if options.labels != HARD:
            for name, estimator in self._estimators.items():
                check_weighted(senses.training[name].learner or "", estimator)

    def train(self, name: str, dataset: Dataset) -> Training:
        """Train and cross-validate the classifier of a sense; a random one as long as that is impossible."""
        if self._options.labels == CORRECTED:
            return self._train_corrected(name, dataset)
        beliefs = [None if own is None else own.belief for own in dataset.evidence]
        weighted = split_by_class(dataset, beliefs)[0] if self._options.labels == SOFT else dataset
        if not self._is_trainable(name, weighted):
            return self._make_untrained(name)
        trained, validation = self._validate(name, weighted)
        return Training(self._finish(name, trained), validation.confusion)

    def _train_corrected(self, name: str, dataset: Dataset) -> Training:
        """Cross-validate on the reports, correct the labels, train on them, and correct the matrix."""
        if not self._is_trainable(name, dataset):
            return self._make_untrained(name)
        with self._show(
            name, "cross-validation against the reports on", dataset, choose_folds(dataset)
        ) as advance:
            first = cross_validate(self._estimators[name], dataset, **self._split, progress=advance)
        corrected = correct_labels(self._domain, name, dataset, first.predictions)
        weighted, origins = split_by_class(dataset, corrected.distributions)
        if not self._is_trainable(name, weighted):
            return self._make_untrained(name)
        trained, second = self._validate(name, weighted)
        _, rows = np.unique(origins, return_index=True)  # the cases of a person have the same prediction
        predictions = [second.predictions[row] for row in rows]
        confusion = correct_labels(self._domain, name, dataset, predictions).confusion
        reported = count_confusion(confusion.classes, dataset.labels, predictions, dataset.weights)
        return Training(self._finish(name, replace(trained, confusion=confusion)), confusion, reported)

    def _is_trainable(self, name: str, dataset: Dataset) -> bool:
        """Return whether a sense that began without data has enough; initial data are checked elsewhere."""
        classes = self._domain.find_sense(name).classes
        return bool(len(self._senses.data[name].dataset)) or is_trainable(dataset, classes, FOLDS)

    def _make_untrained(self, name: str) -> Training:
        sense, options = self._domain.find_sense(name), self._options
        untrained = RandomClassifier(sense.classes, options.seed, options.evidence.kind(name).is_likelihood)
        return Training(untrained, untrained.confusion)

    def _show(self, name: str, title: str, dataset: Dataset, parts: int) -> AbstractContextManager[Advance]:
        sense = f"{name}: " if len(self._estimators) > 1 else ""
        return self._progress(f"{sense}{title} {dataset.n_people:g} {dataset.unit}", parts)

    def _validate(self, name: str, dataset: Dataset) -> tuple[TrainedClassifier, Validation]:
        coverage = self._options.evidence.kind(name).coverage or COVERAGE
        with self._show(name, "training on", dataset, choose_folds(dataset) + 1) as advance:
            trained, validation = train_and_validate(
                self._estimators[name], dataset, **self._split, progress=advance, coverage=coverage
            )
        sense, own = self._domain.find_sense(name), self._senses.training[name]
        return set_threshold(self._domain, sense, own, trained, validation)

    def _finish(self, name: str, trained: TrainedClassifier) -> Classifier:
        return trained.as_evidence(self._options.evidence.kind(name))

    def make_reasoner(self, learned: Mapping[str, ConfusionMatrix]) -> Reasoner:
        """Return the reasoner with the error rates of all senses as rules, but for soft evidence."""
        confusions, soft = self._join_confusions(learned)
        program = self._domain.program_for(confusions, self._options.evidence.smoothing, soft=soft)
        return self._domain.make_reasoner(program)

    def compute_rates(self, learned: Mapping[str, ConfusionMatrix]) -> Rates:
        """Return the error rates of the senses with soft evidence, which are not in the rules."""
        confusions, soft = self._join_confusions(learned)
        return compute_soft_rates(self._domain, confusions, self._options.evidence.smoothing, soft=soft)

    def _join_confusions(
        self, learned: Mapping[str, ConfusionMatrix]
    ) -> tuple[dict[str, ConfusionMatrix], list[str]]:
        """Return the confusion matrices of all senses that have one, and those with soft evidence."""
        fixed = {name: setup.confusion for name, setup in self._senses.fixed.items()}
        confusions = {name: own for name, own in {**fixed, **learned}.items() if own is not None}
        evidence = self._options.evidence
        return confusions, [name for name in confusions if evidence.kind(name).is_likelihood]

    def describe_classifiers(self, batch: Batch) -> dict[str, ClassifierPart]:
        """Return the classifiers of the decisions after a batch, for the log."""
        learned = {
            name: ClassifierPart.of(
                (self._senses.training[name].learner or "") if sense.is_trained else "random",
                sense.classifier,
                confusion=sense.confusion,
                soft=self._options.evidence.kind(name).is_likelihood,
            )
            for name, sense in batch.senses.items()
        }
        return {**describe_classifiers(self._senses.fixed), **learned}
