"""The classifiers of a robot's senses: trained, loaded, or noisy channels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lcorpp.assembly.robot_parts import ClassifierPart
from lcorpp.assembly.setup import (
    ClassifierOptions,
    EvidenceOptions,
    ProgressDisplay,
    Senses,
    SenseSetup,
    StoredOptions,
    from_channel,
    no_progress,
)
from lcorpp.domains import Domain, Sense


def set_up_senses(
    domain: Domain,
    senses: Iterable[Sense],
    classifiers: Mapping[str, ClassifierOptions],
    evidence: EvidenceOptions,
    progress: ProgressDisplay = no_progress,
    *,
    seed: int = 0,
    jobs: int = 1,
) -> dict[str, SenseSetup]:
    """Train or load the classifiers of some senses, or make their noisy channels.

    Args:
        classifiers: sense -> how to get its classifier; others are noisy channels.
        evidence: of trained and loaded classifiers. seed, jobs: of the training.

    Returns:
        sense -> its setup, in the order of `senses`.

    Raises:
        DomainError: a sense has no noisy channel, or no signals to train on.
        DataError, FileError: the options or files are wrong.
    """
    setups = {}
    for sense in senses:
        how = classifiers.get(sense.name)
        if how is None:
            setups[sense.name] = from_channel(domain, sense)
            continue
        # loads scikit-learn
        from lcorpp.assembly.classifier_training import load_trained, train_classifier

        if isinstance(how, StoredOptions):
            setups[sense.name] = load_trained(domain, sense, how, evidence, seed=seed)
        else:
            setups[sense.name] = train_classifier(
                domain, sense, how, evidence, seed=seed, jobs=jobs, progress=progress
            )
    return setups


def describe_classifiers(senses: Senses) -> dict[str, ClassifierPart]:
    """Return the classifiers of some senses as parts of a robot, for the log."""
    return {
        name: ClassifierPart.of(setup.source, setup.classifier, confusion=setup.confusion, soft=setup.soft)
        for name, setup in senses.items()
    }
