"""The simulated classifiers of a domain: their error rates, and the labels that the truth program draws."""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.domains.sections.learning import Sense
from lcorpp.domains.sections.names import check_same_names
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError
from lcorpp.reasoning import Program
from lcorpp.reasoning.language.syntax import Literal, Probability, Rule, Selection


def make_noisy_channels(
    table: TomlTable, true_program: Program, senses: Sequence[Sense]
) -> tuple[dict[str, dict[str, dict[str, float]]], tuple[str, ...]]:
    """Return P(label | class) of the simulated classifiers: from `channel`, else the true program.

    `channel` is the table of the only sense, or has a table for each of some senses.

    Returns:
        Sense -> class -> label -> probability, and the senses whose labels the program draws with the person.
    """
    channels, joint = {}, list[str]()
    given = table.section("channel") if "channel" in table else None
    for sense in senses:
        if given is not None and (len(senses) == 1 or sense.name in given):
            own = given if len(senses) == 1 else given.section(sense.name)
            channels[sense.name] = _read_noisy_channel(own, sense)
        elif sense.attribute in true_program.attributes:
            channels[sense.name] = compute_noisy_channel(true_program, sense)
            if is_joint(true_program, sense):
                joint.append(sense.name)
    if given is not None:
        given.reject_unknown_keys()
    return channels, tuple(joint)


def compute_noisy_channel(program: Program, sense: Sense) -> dict[str, dict[str, float]]:
    """Compute P(label | class) of a program: class -> label -> probability."""
    from lcorpp.reasoning import Reasoner  # imports the grounder and the compiler

    labels = sense.label_of.values()
    joint = Reasoner(program).exact((sense.of, sense.attribute))
    channel = {}
    for value in sense.classes:
        row = {label: joint[value, label] for label in program.attributes[sense.attribute].values}
        total = sum(row.values())
        channel[value] = (
            {label: float(p / total) for label, p in row.items()}
            if total
            else dict.fromkeys(labels, 1 / len(labels))  # an impossible value: its row is never used
        )
    return channel


def _read_noisy_channel(table: TomlTable, sense: Sense) -> dict[str, dict[str, float]]:
    """Read the table of a channel: a row of label probabilities for each class."""
    labels = tuple(sense.label_of.values())
    check_same_names(table.location(), tuple(table), sense.classes, f"the values of {sense.of}")
    rates = {}
    for value in sense.classes:
        row = table.section(value)
        check_same_names(table.location(value), tuple(row), labels, f"the values of {sense.attribute}")
        rates[value] = {label: row.number(label, 0, 1) for label in labels}
        row.reject_unknown_keys()
        total = sum(rates[value].values())
        if abs(total - 1) > 1e-9:
            raise DomainError(f"{table.location(value)}: the probabilities sum to {total:g}, not 1")
    table.reject_unknown_keys()
    return rates


def is_joint(program: Program, sense: Sense) -> bool:
    """Whether a program relates the label of a sense to more than its class.

    E.g. the rates depend on the location, or on the label of another sense that sees the same motion.
    """
    for statement in program.statements:
        if not isinstance(statement, Rule | Selection | Probability):
            continue
        causes = {literal.term.name for literal in statement.body if isinstance(literal, Literal)}
        if statement.head is None or statement.head.term.name != sense.attribute:
            if sense.attribute in causes:
                return True
        elif isinstance(statement, Probability):
            if causes - {sense.of}:
                return True
        elif isinstance(statement, Rule) or statement.body or statement.range is not None:
            return True
    return False
