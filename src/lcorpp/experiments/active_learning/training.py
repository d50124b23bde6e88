"""The training of Algorithm 1: the classifiers on the labels so far, and the rules with their error rates."""

from __future__ import annotations

from collections.abc import Mapping

from lcorpp.decision import Batch
from lcorpp.domains import Domain
from lcorpp.experiments.active_learning.senses import ActiveLearningOptions, LearningSenses
from lcorpp.experiments.active_learning.untrained import RandomClassifier, is_trainable
from lcorpp.experiments.robot_parts import ClassifierPart
from lcorpp.experiments.sense_setup import describe_classifiers
from lcorpp.experiments.setup import ProgressDisplay
from lcorpp.experiments.training_data import FOLDS, make_estimator
from lcorpp.learning import train_and_validate
from lcorpp.learning.classifiers.registry import check_weighted
from lcorpp.protocols import Classifier
from lcorpp.reasoning import Reasoner
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
        """Raises `DataError` if soft labels are for a learner without `sample_weight`."""
        self._domain, self._senses, self._options, self._progress = domain, senses, options, progress
        self._estimators = {
            name: make_estimator(data, senses.training[name], options.seed)
            for name, data in senses.data.items()
        }
        if options.soft_labels:
            for name, estimator in self._estimators.items():
                check_weighted(senses.training[name].learner or "", estimator)

    def train(self, name: str, dataset: Dataset) -> tuple[Classifier, ConfusionMatrix]:
        """Train and cross-validate the classifier of a sense; a random one as long as that is impossible."""
        options, classes = self._options, self._domain.find_sense(name).classes
        kind = options.evidence.kind(name)
        if not len(self._senses.data[name].dataset) and not is_trainable(dataset, classes, FOLDS):
            untrained = RandomClassifier(classes, options.seed, kind.is_likelihood)
            return untrained, untrained.confusion
        sense = f"{name}: " if len(self._estimators) > 1 else ""
        title = f"{sense}training on {dataset.n_people:g} {dataset.unit}"
        with self._progress(title, FOLDS + 1) as advance:
            trained, validation = train_and_validate(
                self._estimators[name],
                dataset,
                folds=FOLDS,
                seed=options.seed,
                jobs=options.jobs,
                progress=advance,
                coverage=kind.coverage or COVERAGE,
            )
        return trained.as_evidence(kind), validation.confusion

    def make_reasoner(self, learned: Mapping[str, ConfusionMatrix]) -> Reasoner:
        """Return the reasoner with the error rates of all senses as rules, but for soft evidence."""
        evidence = self._options.evidence
        fixed = {name: setup.confusion for name, setup in self._senses.fixed.items()}
        confusions = {name: own for name, own in {**fixed, **learned}.items() if own is not None}
        soft = [name for name in confusions if evidence.kind(name).is_likelihood]
        return Reasoner(self._domain.program_for(confusions, evidence.smoothing, soft=soft))

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
