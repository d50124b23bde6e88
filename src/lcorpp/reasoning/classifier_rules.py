"""A classifier's confusion matrix as P-log rules: a new matrix gives a new program, nothing is edited."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from lcorpp.errors import ProgramError, expected_one_of
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.signature import Attribute
from lcorpp.reasoning.language.syntax import Literal, Number, Probability, Selection, Statement, Term
from lcorpp.values import JEFFREYS, ConfusionMatrix


def with_classifier(
    program: Program,
    attribute: str,
    target: str,
    confusion: ConfusionMatrix,
    label_of: Mapping[str, str],
    *,
    smoothing: Fraction = JEFFREYS,
) -> Program:
    """The program in which the classifier errs as the confusion matrix says.

    All pr-atoms of `attribute` give way to ``pr(attribute=label | target=class) = rate.``, one for each pair.

    Args:
        attribute: the classifier's attribute, which has a random selection.
        target: the attribute that it classifies; the classes are values of it.
        confusion: how often the classifier said what about whom; its smoothed rates are used, exactly.
        label_of: class -> the value of `attribute` that says so.
        smoothing: of the confusion matrix, see `ConfusionMatrix.rates`.

    Raises:
        ProgramError: a name on one side is unknown on the other, or `attribute` is not selected at random.

    Source: Algorithm 1 of the LCORPP paper, line 17, where C goes into theta.
    """
    said, about = _plain(program, attribute), _plain(program, target)
    places = [s.at for s in program.statements if isinstance(s, Selection) and s.term.name == attribute]
    if not places:
        raise ProgramError(
            f"{program.file}: {attribute} has no random selection; expected 'random({attribute}).'"
        )
    _members(confusion.classes, about, "class")
    if set(label_of) != set(confusion.classes):
        raise ProgramError(
            f"labels are given for {', '.join(label_of) or 'no class'},"
            f" the confusion matrix has {', '.join(confusion.classes)}"
        )
    labels = [label_of[name] for name in confusion.classes]
    _members(labels, said, "label")
    if len(set(labels)) < len(labels):
        raise ProgramError(f"classes share a label of {attribute}: {', '.join(labels)}")
    rules: list[Statement] = []
    for name, row in zip(confusion.classes, confusion.rates(smoothing), strict=True):
        condition = Literal(Term(target), "=", parse_term(name, "<class>"))
        for label, rate in zip(labels, row, strict=True):
            number = Number(rate)
            rules.append(
                Probability(Term(attribute), parse_term(label, "<label>"), number, (condition,), at=places[0])
            )
    kept = [s for s in program.statements if not (isinstance(s, Probability) and s.term.name == attribute)]
    return Program(program.file, (*kept, *rules), program.semantics)


def _plain(program: Program, name: str) -> Attribute:
    found = program.attributes.get(name)
    if found is None:
        raise ProgramError(
            f"{program.file}: unknown attribute {name!r}; {expected_one_of(list(program.attributes))}"
        )
    if found.arguments:
        raise ProgramError(
            f"{program.file}:{found.line}: {name} has arguments; expected an attribute without"
        )
    return found


def _members(names: Sequence[str], attribute: Attribute, what: str) -> None:
    for name in names:
        if name not in attribute.values:
            raise ProgramError(
                f"{what} {name!r} is not a value of {attribute.name}; {expected_one_of(attribute.values)}"
            )
