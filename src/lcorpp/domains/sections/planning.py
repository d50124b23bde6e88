"""The `[planning]` section of a domain: how the planner's states carry the target, and what reports what."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from string import Formatter

import numpy as np

from lcorpp.domains.sections.reasoning import Knowledge
from lcorpp.domains.toml import Settings
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.files import read_text
from lcorpp.planning import Pomdp, read_pomdp
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Planning:
    pomdp: Pomdp
    reports: Mapping[str, str]
    entry: Array
    share: Array
    terminal: int | None


def read_planning(section: Settings, folder: Path, knowledge: Knowledge) -> Planning:
    pomdp = read_pomdp(folder / section.text("model"))
    template = section.text("states", "{" + knowledge.target + "}")
    local, start = _local(section.section("local"), knowledge.target)
    try:
        parts = [part for part in Formatter().parse(template) if part[1] is not None]
    except ValueError as error:
        raise DomainError(f"{section.place('states')}: {template!r}: {error}") from None
    fields = {f"{field}{':' if spec else ''}{conversion or ''}" for _, field, spec, conversion in parts}
    variables = {knowledge.target, *local}
    if fields != variables:
        raise DomainError(
            f"{section.place('states')}: {template!r} has to name each of {', '.join(sorted(variables))} in"
            f" braces, and nothing else"
        )
    terminal = _terminal(section, pomdp)
    states = declared(pomdp, "states")
    entry = np.zeros((len(knowledge.values), len(pomdp.states)))
    share = np.zeros((len(pomdp.states), len(knowledge.values)))
    for v, value in enumerate(knowledge.values):
        for combination in product(*local.values()):
            own = dict(zip(local, combination, strict=True))
            state = template.format_map({knowledge.target: value, **own})
            if state not in pomdp.states or pomdp.states.index(state) == terminal:
                raise DomainError(
                    f"{section.place('states')}: {template!r} makes {state!r}, which is not a state of"
                    f" {states}; {expected_one_of(pomdp.states)}"
                )
            s = pomdp.states.index(state)
            if share[s].any():
                raise DomainError(f"{section.place('states')}: {template!r} makes {state!r} twice")
            share[s, v] = 1
            entry[v, s] = own == start
    for s, state in enumerate(pomdp.states):
        if s != terminal and not share[s].any():
            raise DomainError(
                f"{states}: state {state!r} is neither made by {template!r} ({section.place('states')})"
                f" nor the terminal state"
            )
    reports = _reports(section, pomdp, knowledge)
    section.close()
    return Planning(pomdp, reports, entry, share, terminal)


def _local(section: Settings, target: str) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """The planner's own variables: their values, and where each starts."""
    values: dict[str, tuple[str, ...]] = {}
    start: dict[str, str] = {}
    for name in section:
        variable = section.section(name)
        if name == target:
            raise DomainError(
                f"{section.place(name)}: {name!r} is the target, not the planner's own variable"
            )
        values[name] = variable.names("values")
        start[name] = variable.text("start", values[name][0])
        if start[name] not in values[name]:
            raise DomainError(
                f"{variable.place('start')}: unknown value {start[name]!r}; {expected_one_of(values[name])}"
            )
        variable.close()
    return values, start


def _terminal(section: Settings, pomdp: Pomdp) -> int | None:
    if "terminal" not in section:
        return None
    name = section.text("terminal")
    if name not in pomdp.states:
        raise DomainError(
            f"{section.place('terminal')}: {declared(pomdp, 'states')} has no state {name!r};"
            f" {expected_one_of(pomdp.states)}"
        )
    return pomdp.states.index(name)


def _reports(section: Settings, pomdp: Pomdp, knowledge: Knowledge) -> dict[str, str]:
    reports = section.mapping("reports")
    for action, value in reports.items():
        if action not in pomdp.actions:
            raise DomainError(
                f"{section.place('reports', action)}: {declared(pomdp, 'actions')} has no action {action!r};"
                f" {expected_one_of(pomdp.actions)}"
            )
        if value not in knowledge.values:
            line = knowledge.program.attributes[knowledge.target].line
            raise DomainError(
                f"{section.place('reports', action)}: {knowledge.target} cannot be {value!r}"
                f" ({knowledge.program.file}:{line}); {expected_one_of(knowledge.values)}"
            )
    for value in knowledge.values:
        if value not in reports.values():
            raise DomainError(f"{section.place('reports')}: no action reports {value!r}")
    return reports


def declared(pomdp: Pomdp, kind: str) -> str:
    """Where a POMDP file declares its states, actions or observations."""
    for number, line in enumerate(read_text(pomdp.file).splitlines(), 1):
        if re.match(rf"\s*{kind}\s*:", line):
            return f"{pomdp.file}:{number}"
    return pomdp.file
