"""Confusion matrix of a classifier as pr-atoms of a P-log program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from lcorpp.errors import ProgramError, check_type, expected_one_of
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.signature import Attribute
from lcorpp.reasoning.language.syntax import Literal, Number, Probability, Rule, Selection, Term
from lcorpp.reasoning.resolve import parse_label
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
    """Return a program in which the classifier has the error rates of a confusion matrix.

    ``pr(attribute=label | target=class) = rate.`` for each pair replaces all pr-atoms of `attribute`.

    Args:
        attribute: the classifier's attribute, which has a random selection.
        target: the classified attribute, whose values are the classes.
        confusion: the counts; its smoothed rates are used as exact fractions.
        label_of: class -> value of `attribute`.
        smoothing: the pseudo-count, see `ConfusionMatrix.rates`.

    Raises:
        ProgramError: an argument has another type, a name is unknown to the program or the matrix,
            `attribute` has no random selection, or a weight of Markov logic or plingo depends on it.
        DataError: `smoothing` is negative, or 0 although a class has no cases.

    Source: Algorithm 1 of the LCORPP paper, line 17 (update theta with C).

    Examples:
        >>> from lcorpp import ConfusionMatrix, Reasoner, parse_plog
        >>> from lcorpp.reasoning import with_classifier
        >>> program = parse_plog("asleep, seen : boolean. random(asleep). random(seen).")
        >>> matrix = ConfusionMatrix(("true", "false"), [[9, 1], [2, 8]])
        >>> labels = {"true": "true", "false": "false"}
        >>> measured = with_classifier(program, "seen", "asleep", matrix, labels, smoothing=0)
        >>> Reasoner(measured).posterior("asleep", {"seen": "true"})  # 0.9 : 0.2
        Distribution(true: 0.8182, false: 0.1818)
    """
    check_type(program, Program, "program", ProgramError)
    check_type(attribute, str, "attribute", ProgramError)
    check_type(target, str, "target", ProgramError)
    check_type(confusion, ConfusionMatrix, "confusion", ProgramError)
    check_type(label_of, Mapping, "label_of", ProgramError)
    check_type(smoothing, (int, float, Fraction), "smoothing", ProgramError)
    labelled, classified = _find_attribute(program, attribute), _find_attribute(program, target)
    places = [s.at for s in program.statements if isinstance(s, Selection) and s.term.name == attribute]
    if not places:
        raise ProgramError(
            f"{program.file}: {attribute} has no random selection; expected 'random({attribute}).'"
        )
    if _has_weight(program, attribute):
        raise ProgramError(
            f"{program.file}: a weight depends on {attribute}, and error rates cannot replace weights;"
            f" expected pr-atoms or a table of {attribute}, or a program without weights about it"
        )
    _check_values(confusion.classes, classified, "class")
    if set(label_of) != set(confusion.classes):
        raise ProgramError(
            f"labels are given for {', '.join(map(str, label_of)) or 'no class'},"
            f" the confusion matrix has {', '.join(confusion.classes)}"
        )
    labels = [label_of[name] for name in confusion.classes]
    _check_values(labels, labelled, "label")
    if len(set(labels)) < len(labels):
        raise ProgramError(f"classes share a label of {attribute}: {', '.join(labels)}")
    terms = [parse_label(program, label) for label in labels]
    rules = []
    for name, row in zip(confusion.classes, confusion.rates(smoothing), strict=True):
        condition = Literal(Term(target), "=", parse_label(program, name))
        for term, rate in zip(terms, row, strict=True):
            rules.append(Probability(Term(attribute), term, Number(rate), (condition,), at=places[0]))
    kept = [s for s in program.statements if not (isinstance(s, Probability) and s.term.name == attribute)]
    return Program(program.file, (*kept, *rules), program.semantics, program.names)


def _has_weight(program: Program, attribute: str) -> bool:
    """Whether a weight of a translated program depends on an attribute, directly or through rules."""
    weights = {name for name, words in program.names.items() if words.startswith("[weight")}
    if not weights:
        return False
    needs: dict[str, set[str]] = {}
    for statement in program.statements:
        if isinstance(statement, Rule) and statement.head is not None:
            head = statement.head.term.name
        elif isinstance(statement, Probability) and statement.term.name in weights:
            head = statement.term.name
        else:
            continue
        own = [literal.term.name for literal in statement.body if isinstance(literal, Literal)]
        needs.setdefault(head, set()).update(own)
    reached, waiting = set(weights), list(weights)
    while waiting:
        new = needs.get(waiting.pop(), set()) - reached
        reached |= new
        waiting += new
    return attribute in reached


def _find_attribute(program: Program, name: str) -> Attribute:
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


def _check_values(names: Sequence[str], attribute: Attribute, what: str) -> None:
    for name in names:
        if name not in attribute.values:
            raise ProgramError(
                f"{what} {name!r} is not a value of {attribute.name}; {expected_one_of(attribute.values)}"
            )
