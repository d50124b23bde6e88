"""Reading a domain folder and checking its files against each other."""

from __future__ import annotations

from pathlib import Path

from lcorpp.domains.domain import Domain
from lcorpp.domains.sections.planning import read_planning
from lcorpp.domains.sections.reasoning import read_knowledge, read_learning
from lcorpp.domains.sections.simulation import read_simulation
from lcorpp.domains.toml import read_settings
from lcorpp.errors import DomainError, expected_one_of

SHIPPED = Path(__file__).parent


def shipped_domains() -> tuple[str, ...]:
    """The names of the domains that come with lcorpp."""
    return tuple(sorted(file.parent.name for file in SHIPPED.glob("*/domain.toml")))


def load_domain(place: str | Path, *, preset: str | None = None) -> Domain:
    """Read a domain folder and check it as a whole.

    Args:
        place: a folder with a `domain.toml`, or the name of a shipped domain.
        preset: one of its presets; None takes the first, where it has any.

    Raises:
        DomainError: a file is missing, or a name in one file is not known in another; both places are named.
        ParseError, ProgramError, ModelError, FileError: a file of the folder is itself wrong.
    """
    folder = Path(place)
    if not (folder / "domain.toml").is_file():
        if str(place) not in shipped_domains():
            raise DomainError(
                f"{place}: no folder with a domain.toml, and no shipped domain;"
                f" {expected_one_of(shipped_domains())}"
            )
        folder = SHIPPED / str(place)
    settings, chosen = read_settings(folder / "domain.toml", preset)
    name = settings.text("name", folder.resolve().name)
    description = settings.text("description", name)
    knowledge = read_knowledge(settings.section("reasoning", required=True), folder)
    learning = read_learning(settings.section("learning", required=True), knowledge)
    planning = read_planning(settings.section("planning", required=True), folder, knowledge)
    simulation = read_simulation(settings.section("simulation"), folder, knowledge, learning, planning)
    settings.close()
    return Domain(
        name=name,
        description=description,
        folder=folder,
        preset=chosen,
        program=knowledge.program,
        observed=knowledge.observed,
        target=knowledge.target,
        attribute=learning.attribute,
        label_of=learning.label_of,
        positive=learning.positive,
        classifier=learning.classifier if simulation.trajectories else "channel",
        tracks=learning.tracks,
        epochs=learning.epochs,
        interval=learning.interval,
        data_labels=learning.data_labels,
        pomdp=planning.pomdp,
        reports=planning.reports,
        entry=planning.entry,
        share=planning.share,
        terminal=planning.terminal,
        simulation=simulation,
    )
