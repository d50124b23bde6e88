"""The `[reasoning]` section of a domain: the P-log program, the observed and the shared attributes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from lcorpp.domains.sections.files import find_file, find_function
from lcorpp.domains.sections.names import check_same_names, find_attribute_values
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.reasoning import Program, read_plog
from lcorpp.values import SharedValue

if TYPE_CHECKING:
    from lcorpp.domains.own_reasoner import OwnReasoners

MAX_SHARED_VALUES = 10_000
"""Maximal number of combinations of values of the shared variables."""


@dataclass(frozen=True)
class ReasoningSection:
    """The robot's knowledge: theta of the paper.

    program: the P-log program.
    observed: attributes that the robot observes as facts; beta of Algorithm 2.
    shared: attributes shared by reasoner and planner, at least one.
    own_reasoners: make the reasoner in place of that of the program; None without.

    Examples:
        >>> from lcorpp import load_domain
        >>> load_domain("intention").reasoning.observed_values
        {'time': ('morning', 'afternoon', 'evening'), 'location': ('library', 'classroom')}
    """

    program: Program
    observed: tuple[str, ...]
    shared: tuple[str, ...]
    own_reasoners: OwnReasoners | None = None

    @property
    def subject(self) -> str | tuple[str, ...]:
        """The shared attribute, or the tuple of several, as `Reasoner.posterior` takes it."""
        return self.shared[0] if len(self.shared) == 1 else self.shared

    @cached_property
    def values(self) -> tuple[SharedValue, ...]:
        """The values of the shared attribute, in the order of their declaration; of several, all tuples."""
        ranges = [self.program.attributes[name].values for name in self.shared]
        return ranges[0] if len(ranges) == 1 else tuple(product(*ranges))

    @cached_property
    def observed_values(self) -> dict[str, tuple[str, ...]]:
        """Observed attribute -> its values."""
        return {name: self.program.attributes[name].values for name in self.observed}

    def split(self, value: SharedValue) -> dict[str, str]:
        """Return a shared value as attribute -> value."""
        return dict(zip(self.shared, (value,) if isinstance(value, str) else value, strict=True))

    def join(self, values: Mapping[str, str]) -> SharedValue:
        """Return the shared value of attribute -> value, which may have other attributes."""
        joint = tuple([values[name] for name in self.shared])
        return joint[0] if len(joint) == 1 else joint

    def locate(self, attribute: str) -> str:
        """``file:line`` of the declaration of an attribute."""
        return f"{self.program.file}:{self.program.attributes[attribute].line}"

    def check_value(self, location: str, attribute: str, value: str) -> None:
        """Raise `DomainError` if a name of `domain.toml` is not a value of an attribute."""
        values = self.program.attributes[attribute].values
        if value not in values:
            raise DomainError(
                f"{location}: {attribute} cannot be {value!r} ({self.locate(attribute)});"
                f" {expected_one_of(values)}"
            )


def read_reasoning(table: TomlTable, folder: Path, *, own_reasoner: bool = True) -> ReasoningSection:
    """Read the section and the program.

    Args:
        own_reasoner: whether the file of a reasoner of the domain's own is loaded.

    Raises:
        DomainError: an attribute is not in the program, or a shared one is observed; the shared ones have too
            many values; or the file of the reasoner is wrong.
    """
    program = read_plog(find_file(table, "program", folder))
    key = "shared" if "shared" in table else "target"  # for one variable
    shared = table.names("shared") if key == "shared" else (table.text("target"),)
    observed = table.names("observed", required=False)
    size = 1
    for name in shared:
        size *= len(find_attribute_values(table.location(key), name, program))
    for name in observed:
        find_attribute_values(table.location("observed"), name, program)
        if name in shared:
            raise DomainError(
                f"{table.location('observed')}: {name!r} is in [reasoning] {key}, so it cannot be observed"
            )
    if size > MAX_SHARED_VALUES:
        raise DomainError(
            f"{table.location(key)}: the variables have {size} values together; expected at most"
            f" {MAX_SHARED_VALUES}"
        )
    parts = find_function(table, "reasoner", folder) if "reasoner" in table else None
    if "reasoner" in table and parts is None:
        raise DomainError(
            f"{table.location('reasoner')}: is {table.text('reasoner')!r}; expected FILE.py:NAME"
        )
    table.reject_unknown_keys()
    if parts is None or not own_reasoner:
        return ReasoningSection(program, observed, shared)
    from lcorpp.domains.own_reasoner import OwnReasoners  # few domains have one

    return ReasoningSection(program, observed, shared, OwnReasoners(*parts))


def read_value_mapping(table: TomlTable, reasoning: ReasoningSection) -> tuple[str, dict[str, str]]:
    """Read a table of one shared variable, such as `item = { tea = "yes", book = "no" }`.

    Returns:
        The variable, and its value -> name.

    Raises:
        DomainError: another number of variables, one that is not shared, or an unknown or missing value.
    """
    names = tuple(table)
    if len(names) != 1 or names[0] not in reasoning.shared:
        raise DomainError(
            f"{table.location()}: is a table of {', '.join(names) or 'nothing'}; expected one shared"
            f" variable: {', '.join(reasoning.shared)}"
        )
    (variable,) = names
    mapping, location = table.mapping(variable), table.location(variable)
    values = reasoning.program.attributes[variable].values
    what = f"the values of {variable} at {reasoning.locate(variable)}"
    check_same_names(location, tuple(mapping), values, what)
    return variable, mapping
