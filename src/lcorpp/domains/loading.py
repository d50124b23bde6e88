"""Load a domain folder and check its files against each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from lcorpp.domains.domain import Domain
from lcorpp.domains.sections.learning import Sense, read_senses
from lcorpp.domains.sections.names import check_defined
from lcorpp.domains.sections.planning import read_planning
from lcorpp.domains.sections.reasoning import ReasoningSection, read_reasoning
from lcorpp.domains.sections.simulation import read_simulation
from lcorpp.domains.toml import SHIPPED_FOLDER as SHIPPED_FOLDER, TomlTable, read_domain_toml
from lcorpp.errors import DomainError, check_type, expected_one_of
from lcorpp.user_code import split_function


def list_domains() -> tuple[str, ...]:
    """Return the names of the domains that come with lcorpp.

    Examples:
        >>> from lcorpp.domains import list_domains
        >>> list_domains()
        ('engagement', 'intention', 'museum', 'shopping')
    """
    return tuple(sorted(file.parent.name for file in SHIPPED_FOLDER.glob("*/domain.toml")))


def load_domain(
    name_or_folder: str | Path, *, preset: str | None = None, changes: Mapping[str, Any] = {}
) -> Domain:
    """Load a domain folder and check it as a whole.

    Args:
        name_or_folder: a folder with a `domain.toml`, that file, or the name of a shipped domain.
        preset: name of a preset, or names with commas, of which later ones replace keys of earlier ones; None
            for the first, if the domain has any.
        changes: of `domain.toml`, after the preset: nested tables such as ``{"simulation": {"noise": 0.2}}``.

    Raises:
        DomainError: a file is missing, one file uses a name that another does not declare, or a shared
            variable has no value in some possible world; the message names both places.
        ParseError, ProgramError, ModelError, FileError: a file of the folder is itself wrong.

    Examples:
        >>> from lcorpp import load_domain
        >>> domain = load_domain("intention", preset="paper", changes={"simulation": {"noise": 0.2}})
        >>> domain.preset, domain.simulation.feedback_model[0, 0].round(2).tolist()
        ('paper', [0.8, 0.2, 0.0])
    """
    check_type(name_or_folder, (str, Path), "the domain", DomainError)
    folder = Path(name_or_folder)
    if folder.name == "domain.toml" and folder.is_file():
        folder = folder.parent
    if not (folder / "domain.toml").is_file():
        if str(name_or_folder) not in list_domains():
            raise DomainError(
                f"{name_or_folder}: no folder with a domain.toml, and no shipped domain;"
                f" {expected_one_of(list_domains())}"
            )
        folder = SHIPPED_FOLDER / str(name_or_folder)
    table, preset_name = read_domain_toml(folder / "domain.toml", preset, changes)
    name = table.text("name", folder.resolve().name)
    description = table.text("description", name)
    reasoning, senses = read_knowledge(table, folder)
    planning_table = table.section("planning", required=True)
    planning = read_planning(planning_table, folder, reasoning)
    simulation = read_simulation(table.section("simulation"), folder, reasoning, senses, planning)
    table.reject_unknown_keys()
    senses = tuple(  # without signals or data nothing can be trained
        sense if sense.data or sense.name in simulation.signals else replace(sense, classifier="channel")
        for sense in senses
    )
    own, baselines = (tuple(s for s in senses if s.is_baseline == is_one) for is_one in (False, True))
    domain = Domain(
        name, description, folder, preset_name, reasoning, own, planning, simulation, baselines=baselines
    )
    if planning.answers is None:
        return domain
    from lcorpp.domains.stated_form import state_form  # few domains state a form

    return state_form(domain, planning.answers, planning_table.location("answers"))


def read_knowledge(
    table: TomlTable, folder: Path, *, own_reasoner: bool = True
) -> tuple[ReasoningSection, tuple[Sense, ...]]:
    """Read the sections `[reasoning]` and `[learning]`; errors as of `load_domain`.

    Args:
        own_reasoner: as of `read_reasoning`.
    """
    knowledge = table.section("reasoning", required=True)
    reasoning = read_reasoning(knowledge, folder, own_reasoner=own_reasoner)
    check_defined(
        knowledge.location("shared" if "shared" in knowledge else "target"),
        reasoning.shared,
        reasoning.program,
    )
    return reasoning, read_senses(table.sections("learning"), reasoning, folder)


def with_world(domain: Domain, text: str) -> Domain:
    """Return the domain with people who answer as the worlds of ``FILE.py:NAME`` do, see `OwnWorlds`.

    Raises:
        DomainError: the text is something else, or the file is wrong.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain
        >>> from lcorpp.domains import with_world
        >>> _ = Path("people.py").write_text('''
        ... class Friend:
        ...     def __init__(self, person, rng): ...
        ...     def act(self, action): return "pos"
        ...     def report(self, action): ...
        ... ''')
        >>> with_world(load_domain("intention"), "people.py:Friend").simulation.world
        people.py:Friend
    """
    from lcorpp.domains.own_world import OwnWorlds

    own = OwnWorlds(*_split("world", text))
    return replace(domain, simulation=replace(domain.simulation, world=own))


def with_reasoner(domain: Domain, text: str) -> Domain:
    """Return the domain with the reasoner that ``FILE.py:NAME`` makes, see `OwnReasoners`.

    Raises:
        DomainError: the text is something else, or the file is wrong.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain
        >>> from lcorpp.domains import with_reasoner
        >>> _ = Path("mine.py").write_text('''
        ... class Half:
        ...     def __init__(self, program, rates): ...
        ...     def posterior(self, shared, evidence):
        ...         return {"interested": 0.5, "not_interested": 0.5}
        ... ''')
        >>> domain = with_reasoner(load_domain("intention"), "mine.py:Half")
        >>> domain.make_reasoner(domain.program).posterior(domain.shared, {})
        Distribution(interested: 0.5, not_interested: 0.5)
    """
    from lcorpp.domains.own_reasoner import OwnReasoners

    own = OwnReasoners(*_split("reasoner", text))
    return replace(domain, reasoning=replace(domain.reasoning, own_reasoners=own))


def _split(what: str, text: str) -> tuple[Path, str]:
    """Return the file and the function that a text names."""
    parts = split_function(text)
    if parts is None:
        raise DomainError(f"the {what} {text!r}: expected FILE.py:NAME")
    return parts
