"""Options about the classifiers of the senses: of `run`, `learn` and `explain`."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.cli.options.recordings import RECORDING_OPTIONS
from lcorpp.errors import DataError, DomainError
from lcorpp.learning.classifiers.learner_table import LEARNERS
from lcorpp.values import EvidenceKind

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions, ReadingOptions
    from lcorpp.domains import Domain
    from lcorpp.domains.sections.learning import Sense

ClassifiersOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[SENSE=]channel|FILE",
        help="Instead of training: channel (a noisy channel with the domain's rates) or a classifier.npz of"
        " an earlier run; repeatable.",
    ),
]
LearnersOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[SENSE=]NAME",
        help=f"The learner: {', '.join(LEARNERS)}, or your own as MODULE:FUNCTION or FILE.py:FUNCTION;"
        " repeatable. By default the domain's.",
    ),
]


@dataclass(frozen=True)
class ClassifierGroup:
    """The classifiers of the senses, their evidence and data; each field is an option of its name."""

    classifier: ClassifiersOption = None
    learner: LearnersOption = None
    evidence: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[SENSE=]hard|soft|set[:COVERAGE]",
            help="The reasoner's evidence: the label (hard, the default), a likelihood (soft) or a conformal"
            " prediction set (set, by default of coverage 0.95) of a trained classifier; repeatable.",
        ),
    ] = None
    data: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[SENSE=]PATH",
            help="Recorded tracks or a table of features for training and trials: a folder or a file, see"
            " docs/guides/data/formats.md; one for each sense.",
        ),
    ] = None

    def choose_classifiers(
        self,
        domain: Domain,
        used: Sequence[Sense],
        *,
        reading: ReadingOptions,
        training: Mapping[str, Any],
        trained: Collection[str] = (),
        by_channel: bool = False,
    ) -> dict[str, ClassifierOptions]:
        """Return the options of the classifier of each used sense; see the function of this name."""
        return choose_classifiers(
            domain,
            used,
            classifiers=self.classifier or [],
            learners=self.learner or [],
            data=self.data or [],
            reading=reading,
            training=training,
            trained=trained,
            by_channel=by_channel,
        )

    def choose_evidence(
        self, domain: Domain, chosen: Mapping[str, ClassifierOptions]
    ) -> dict[str, EvidenceKind]:
        """Return the evidence of the senses that give a likelihood; see the function of this name."""
        return choose_evidence(domain, chosen, self.evidence or [])


def choose_classifiers(
    domain: Domain,
    used: Sequence[Sense],
    *,
    classifiers: Sequence[str],
    learners: Sequence[str],
    data: Sequence[str],
    reading: ReadingOptions,
    training: Mapping[str, Any],
    trained: Collection[str] = (),
    by_channel: bool = False,
) -> dict[str, ClassifierOptions]:
    """Return the options of the classifier of each used sense: sense -> options, None for a noisy channel.

    Args:
        used: the senses that a strategy uses.
        classifiers, learners, data: the texts of --classifier, --learner and --data.
        training: fields of `TrainingOptions`; None is the default.
        trained: senses that are trained even if the domain's default is a channel.
        by_channel: whether a sense without options is a channel, whatever the domain's default.

    Raises:
        DomainError: a sense is unknown, options exclude each other, or an option has no effect.
    """
    from lcorpp.assembly.options import READ_AS_IT_IS, StoredOptions, TrainingOptions
    from lcorpp.domains.sections.learning import CLASSIFIERS

    names = [sense.name for sense in used]
    learner_of, general_learner = _split_by_sense(domain, names, "--learner", learners)
    file_of, general_file = _split_by_sense(domain, names, "--classifier", classifiers)
    data_of, general_data = _split_by_sense(domain, names, "--data", data)
    if len(domain.senses) > 1:  # one file belongs to one sense
        _require_sense(domain, "--data", general_data)
        _require_sense(domain, "--classifier", None if general_file in CLASSIFIERS else general_file)
    chosen: dict[str, ClassifierOptions] = {}
    for sense in used:
        name = sense.name
        own = file_of.get(name), learner_of.get(name)
        kind, learner = own if any(own) else (general_file, general_learner)
        if sense.is_baseline and not any(own):  # what is compared with it does not replace it
            kind, learner = general_file if general_file == "channel" else None, None
        if kind is not None and learner is not None:
            raise DomainError(
                f"--classifier {kind} and --learner {learner} both choose the classifier; expected one"
            )
        text = data_of.get(name, general_data)
        path = None if text is None else Path(text)
        if kind is not None and kind not in CLASSIFIERS:
            chosen[name] = StoredOptions(Path(kind), path, reading, training["seconds"])
            continue
        learner = kind or learner or ("channel" if by_channel else sense.classifier)
        if learner == "channel" and kind is None and (path is not None or name in trained):
            # there are data to train on, or the command needs a trained classifier
            learner = sense.classifier if sense.classifier != "channel" else None
        if learner == "channel":
            chosen[name] = None
            reject_given("nothing is trained, as the classifier is a channel", data=data_of.get(name))
        else:
            given = {key: value for key, value in training.items() if value is not None}
            chosen[name] = TrainingOptions(learner, data=path, reading=reading, **given)
    _reject_unused(domain, chosen, learners=learners, classifiers=classifiers, data=data, training=training)
    has_data = any(
        options is not None and (options.data or domain.find_sense(name).data)
        for name, options in chosen.items()
    )
    if reading != READ_AS_IT_IS and not has_data:
        raise DomainError(f"--label, {RECORDING_OPTIONS}: no recorded data are read; expected --data")
    return chosen


def choose_evidence(
    domain: Domain, chosen: Mapping[str, ClassifierOptions], texts: Sequence[str]
) -> dict[str, EvidenceKind]:
    """Return the evidence of the senses that give a likelihood, by the texts of --evidence or the domain.

    Args:
        chosen: the result of `choose_classifiers`.

    Raises:
        DomainError: a word is unknown, or the classifier has labels only.
    """
    kind_of, general = _split_by_sense(domain, chosen, "--evidence", texts)
    kinds = {text: _parse_evidence(text) for text in (*kind_of.values(), general or "hard")}
    trained = [name for name, options in chosen.items() if options is not None]
    for name, text in kind_of.items():
        if kinds[text].is_likelihood and name not in trained:
            raise DomainError(
                f"--evidence {name}={text} needs a trained classifier: a channel has labels only"
            )
    if general is not None and kinds[general].is_likelihood and not trained:
        raise DomainError(f"--evidence {general} needs a trained classifier: a channel has labels only")
    given = {name: kind_of.get(name, general) for name in trained}
    evidence = {
        name: domain.find_sense(name).evidence if text is None else kinds[text]
        for name, text in given.items()
    }
    return {name: kind for name, kind in evidence.items() if kind.is_likelihood}


def _parse_evidence(text: str) -> EvidenceKind:
    try:
        return EvidenceKind.parse(text)
    except DataError as error:
        raise DomainError(f"--{error}") from None


def reject_given(reason: str, **given: object) -> None:
    """Reject options with a value: `reason` is why they would have no effect."""
    for name, value in given.items():
        if value is not None and value != []:
            raise DomainError(f"--{name}: {reason}")


def _reject_unused(
    domain: Domain,
    chosen: Mapping[str, ClassifierOptions],
    *,
    learners: Sequence[str],
    classifiers: Sequence[str],
    data: Sequence[str],
    training: Mapping[str, Any],
) -> None:
    """Reject options without effect on the chosen classifiers."""
    from lcorpp.assembly.options import TrainingOptions

    kinds = {type(options) for options in chosen.values()}
    if not domain.senses:
        reason = "the domain has no [learning], so nothing is classified"
        reject_given(reason, classifier=classifiers, learner=learners, data=data, **training)
    elif not kinds:
        reject_given("nothing is trained, as no strategy learns", learner=learners, **training)
    elif kinds == {type(None)}:
        reject_given("nothing is trained, as the classifier is a channel", data=data, **training)
    elif TrainingOptions not in kinds:
        only_trained = {key: value for key, value in training.items() if key != "seconds"}
        reject_given("nothing is trained, as --classifier gives a file", **only_trained)


def _split_by_sense(
    domain: Domain, used: Collection[str], option: str, texts: Sequence[str]
) -> tuple[dict[str, str], str | None]:
    """Return sense -> value of texts such as "gaze=forest", and the value that names no sense.

    A text with "=" that is an existing path names no sense.
    """
    values: dict[str, str] = {}
    general: str | None = None
    for text in texts:
        name, equals, value = text.partition("=")
        if not (value if equals else text):
            raise DomainError(f"{option} {text!r}: expected [SENSE=]VALUE, found no value")
        if not equals or Path(text).exists():
            if general is not None:
                raise DomainError(f"{option} {text!r}: {general!r} without a sense is already given")
            general = text
            continue
        if domain.find_sense(name).name not in used:
            raise DomainError(f"{option} {text!r}: no strategy uses the sense {name}")
        if name in values:
            raise DomainError(f"{option} {text!r}: {values[name]!r} is already given for {name}")
        values[name] = value
    return values, general


def _require_sense(domain: Domain, option: str, text: str | None) -> None:
    if text is not None:
        names = ", ".join(sense.name for sense in domain.all_senses)
        raise DomainError(f"{option} {text!r}: expected the name of a sense first, SENSE=FILE: {names}")
