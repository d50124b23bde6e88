"""The `[reasoning]` section of a domain: the P-log program, the observed attributes and the target."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lcorpp.domains.sections.names import find_attribute_values
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.reasoning import Program, read_plog


@dataclass(frozen=True)
class ReasoningSection:
    """The robot's knowledge: theta of the paper.

    program: the P-log program.
    observed: attributes that the robot observes as facts; beta of Algorithm 2.
    target: the attribute shared by reasoner and planner.
    """

    program: Program
    observed: tuple[str, ...]
    target: str

    @property
    def values(self) -> tuple[str, ...]:
        """The values of the target, in the order of their declaration."""
        return self.program.attributes[self.target].values

    @property
    def target_declaration(self) -> str:
        """``file:line`` of the declaration of the target."""
        return f"{self.program.file}:{self.program.attributes[self.target].line}"

    def check_value(self, location: str, value: str) -> None:
        """Raise `DomainError` if a name of `domain.toml` is no value of the target."""
        if value not in self.values:
            raise DomainError(
                f"{location}: {self.target} cannot be {value!r} ({self.target_declaration});"
                f" {expected_one_of(self.values)}"
            )


def read_reasoning(table: TomlTable, folder: Path) -> ReasoningSection:
    """Read the section and the program.

    Raises:
        DomainError: an attribute is not in the program, or the target is observed.
    """
    program = read_plog(folder / table.text("program"))
    target = table.text("target")
    observed = table.names("observed", required=False)
    for key, names in (("target", (target,)), ("observed", observed)):
        for name in names:
            find_attribute_values(table.location(key), name, program)
    if target in observed:
        raise DomainError(f"{table.location('observed')}: {target!r} is the target, so it cannot be observed")
    table.reject_unknown_keys()
    return ReasoningSection(program, observed, target)
