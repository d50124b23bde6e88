"""Rules as a program of P-log: declarations, and a pr-atom for each value of a rule but the last."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lcorpp.model_learning.knowledge.cases import Cases
from lcorpp.model_learning.knowledge.rules import Rule
from lcorpp.reasoning.quoting import write_name

Rules = Sequence[Sequence[Rule]]
"""The rules of each attribute."""


@dataclass(frozen=True, eq=False)
class Atom:
    """A pr-atom without its number: ``pr(time=evening | identity=student)``."""

    attribute: int
    rule: Rule
    value: int
    left_side: str


def list_declarations(cases: Cases) -> Iterator[str]:
    """Yield the declaration of each attribute, as a line."""
    ranges: dict[str, tuple[str, ...]] = {name: (value,) for name, value in cases.constants.items()}
    ranges |= dict(zip(cases.names, cases.values, strict=True))
    for name, own in ranges.items():
        written = write_name(name)
        yield f"{written} : {{{', '.join(map(write_name, own))}}}.   random({written})."


def list_atoms(cases: Cases, rules: Rules) -> Iterator[Atom]:
    """Yield the pr-atoms of all rules; the probability of the last value follows from the others."""
    for j, of_attribute in enumerate(rules):
        name = write_name(cases.names[j])
        for rule in of_attribute:
            body = ", ".join(_list_literals(cases, rule))
            for v, value in enumerate(cases.values[j][:-1]):
                yield Atom(j, rule, v, f"pr({name}={write_name(value)}{' | ' * bool(body)}{body})")


def _list_literals(cases: Cases, rule: Rule) -> Iterator[str]:
    """Yield the conditions of a rule: the only value of a parent, or each one that it does not have."""
    for i, kept in sorted(rule.context.items()):
        name, own = write_name(cases.names[i]), cases.values[i]
        if len(kept) == 1:
            yield f"{name}={write_name(own[next(iter(kept))])}"
        else:
            yield from (f"{name}!={write_name(value)}" for v, value in enumerate(own) if v not in kept)
