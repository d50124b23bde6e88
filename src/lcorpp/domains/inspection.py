"""Read a domain folder without running its Python code."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lcorpp.domains.loading import read_knowledge
from lcorpp.domains.sections.files import find_file, find_function
from lcorpp.domains.sections.planning import read_planning
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.sections.simulation import read_truth
from lcorpp.domains.toml import TomlTable, read_domain_toml
from lcorpp.errors import DomainError
from lcorpp.files import read_text
from lcorpp.planning import Pomdp
from lcorpp.user_code import NO_CODE, split_function


@dataclass(frozen=True, eq=False)
class InspectedDomain:
    """What a domain folder states without its Python code.

    pomdp: None if a function makes it. code: the Python files that a command would run.
    """

    name: str
    preset: str | None
    reasoning: ReasoningSection
    pomdp: Pomdp | None
    code: tuple[Path, ...]


def inspect_domain(folder: Path, preset: str | None = None) -> InspectedDomain:
    """Read a domain folder and the syntax of its Python files; nothing of them is run.

    Without its model, the names in `[planning]` and `[simulation]` are not checked.

    Raises:
        LcorppError: as `load_domain`; or a Python file is missing or has a wrong syntax.
    """
    with NO_CODE.apply():
        table, preset = read_domain_toml(folder / "domain.toml", preset, {})
        name = table.text("name", folder.resolve().name)
        reasoning, senses = read_knowledge(table, folder, own_reasoner=False)
        planning, simulation = table.section("planning", required=True), table.section("simulation")
        made = find_function(planning, "model", folder)
        pomdp = None
        if made is None:
            pomdp = read_planning(planning, folder, reasoning, own_solver=False).pomdp
        read_truth(simulation, folder, reasoning, senses)
        own = [split_function(sense.classifier or "") for sense in senses]
        own += [_find(table.section("reasoning"), "reasoner", folder)]
        own += [made, _find(planning, "solver", folder), _find(simulation, "world", folder)]
        files = [part[0] for part in own if part is not None]
        if "people" in simulation:
            files.append(find_file(simulation, "people", folder))
        for file in files:
            _check_syntax(file)
        return InspectedDomain(name, preset, reasoning, pomdp, tuple(dict.fromkeys(files)))


def _find(table: TomlTable, key: str, folder: Path) -> tuple[Path, str] | None:
    return find_function(table, key, folder) if key in table else None


def _check_syntax(file: Path) -> None:
    """Raise `DomainError` if a file is not Python."""
    try:
        compile(read_text(file), str(file), "exec", dont_inherit=True)
    except SyntaxError as error:
        raise DomainError(f"{file}:{error.lineno}: SyntaxError: {error.msg}") from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise DomainError(f"{file}: cannot be compiled: {error}") from None
