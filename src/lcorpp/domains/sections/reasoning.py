"""The `[reasoning]` and `[learning]` sections of a domain: P-log attributes and what they are for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lcorpp.domains.toml import Settings
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.reasoning import Program, read_plog

CLASSIFIERS = ("lstm", "lstm-fast", "summaries", "forest", "minirocket", "channel")
"""The learners of `learning.learners`, by name, and the channel in place of one."""

SHORTEST, INTERVAL, LONGEST = 1e-3, 0.033, 10.0
"""Seconds between two points of simulated tracks: at least, by default as the mall's tracker had, at most."""


@dataclass(frozen=True)
class Knowledge:
    program: Program
    observed: tuple[str, ...]
    target: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class Learning:
    attribute: str
    label_of: Mapping[str, str]
    positive: str | None
    classifier: str
    tracks: int
    epochs: int
    interval: float
    data_labels: Mapping[str, str]


def read_knowledge(section: Settings, folder: Path) -> Knowledge:
    program = read_plog(folder / section.text("program"))
    target = section.text("target")
    observed = section.names("observed", empty=True)
    for key, names in (("target", (target,)), ("observed", observed)):
        for name in names:
            attribute_values(section.place(key), name, program)
    if target in observed:
        raise DomainError(f"{section.place('observed')}: {target!r} is the target, so it cannot be observed")
    section.close()
    return Knowledge(program, observed, target, program.attributes[target].values)


def read_learning(section: Settings, knowledge: Knowledge) -> Learning:
    attribute = section.text("attribute")
    words = attribute_values(section.place("attribute"), attribute, knowledge.program)
    if attribute == knowledge.target or attribute in knowledge.observed:
        raise DomainError(f"{section.place('attribute')}: {attribute!r} is already the target or observed")
    labels = section.mapping("labels")
    declared = f"{knowledge.program.file}:{knowledge.program.attributes[attribute].line}"
    require_same(section.place("labels"), tuple(labels), words, f"the values of {attribute} at {declared}")
    declared = f"{knowledge.program.file}:{knowledge.program.attributes[knowledge.target].line}"
    claims = tuple(labels.values())
    require_same(
        section.place("labels"), claims, knowledge.values, f"the values of {knowledge.target} at {declared}"
    )
    if len(set(claims)) < len(claims):
        raise DomainError(f"{section.place('labels')}: two labels claim the same value")
    positive = section.text("positive") if "positive" in section else None
    if positive is not None and positive not in knowledge.values:
        raise DomainError(
            f"{section.place('positive')}: {knowledge.target} cannot be {positive!r} ({declared});"
            f" {expected_one_of(knowledge.values)}"
        )
    classifier = section.text("classifier", "lstm")
    if classifier not in CLASSIFIERS:
        raise DomainError(
            f"{section.place('classifier')}: unknown classifier {classifier!r};"
            f" {expected_one_of(CLASSIFIERS)}"
        )
    data_labels = section.mapping("data_labels") if "data_labels" in section else {}
    for word, value in data_labels.items():
        if value not in knowledge.values:
            raise DomainError(
                f"{section.place('data_labels')}: {word!r} stands for {value!r}, which {knowledge.target}"
                f" cannot be ({declared}); {expected_one_of(knowledge.values)}"
            )
    tracks = section.count("tracks", 2 * len(knowledge.values), 1600)
    epochs = section.count("epochs", 1, 20)
    interval = section.number("interval", SHORTEST, LONGEST, INTERVAL)
    section.close()
    label_of = {value: word for word, value in labels.items()}
    return Learning(attribute, label_of, positive, classifier, tracks, epochs, interval, data_labels)


def attribute_values(place: str, name: str, program: Program) -> tuple[str, ...]:
    """The values of an attribute without arguments that `program` must know."""
    if name not in program.attributes:
        raise DomainError(
            f"{place}: {program.file} has no attribute {name!r}; {expected_one_of(tuple(program.attributes))}"
        )
    attribute = program.attributes[name]
    if attribute.arguments:
        raise DomainError(
            f"{place}: {name!r} takes arguments ({program.file}:{attribute.line}); expected one without"
        )
    return attribute.values


def require_same(place: str, names: tuple[str, ...], known: tuple[str, ...], what: str) -> None:
    """Complain about names that are not known, and known ones that are missing."""
    for name in names:
        if name not in known:
            raise DomainError(f"{place}: {name!r} is not among {what}; {expected_one_of(known)}")
    for name in known:
        if name not in names:
            raise DomainError(f"{place}: {name!r} is missing; expected {what}: {', '.join(known)}")
