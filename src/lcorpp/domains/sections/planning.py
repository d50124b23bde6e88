"""The `[planning]` section of a domain: the POMDP, the shared values of its states, and the reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from string import Formatter

import numpy as np

from lcorpp.domains.sections.names import check_declared, locate_declaration
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.planning import Pomdp, read_pomdp
from lcorpp.values import Array, SharedValue, format_value


@dataclass(frozen=True, eq=False, repr=False)
class PlanningSection:
    """What the robot plans with: M of the paper. A POMDP state is a shared value with local variables.

    pomdp: the model, S states.
    reports: report action -> shared value.
    initial_states: (V, S) 1 if a state has shared value v and the initial values of the local variables.
    state_values: (S, V) 1 if a state has shared value v; zeros for the terminal state.
    terminal: index of the terminal state, None without one.
    """

    pomdp: Pomdp
    reports: Mapping[str, SharedValue]
    initial_states: Array
    state_values: Array
    terminal: int | None

    def __repr__(self) -> str:
        return f"PlanningSection({self.pomdp!r}, reports: {', '.join(self.reports)})"


def read_planning(table: TomlTable, folder: Path, reasoning: ReasoningSection) -> PlanningSection:
    """Read the section and the POMDP.

    Raises:
        DomainError: the state names do not match the template, or a name is unknown.
    """
    pomdp = read_pomdp(folder / table.text("model"))
    template = table.text("states", "_".join(f"{{{name}}}" for name in reasoning.shared))
    variables, initial = _read_local_variables(table.section("local"), reasoning.shared)
    _check_template(table, "states", template, {*reasoning.shared, *variables})
    terminal = None
    if "terminal" in table:
        name = table.text("terminal")
        check_declared(table.location("terminal"), name, pomdp, "states")
        terminal = pomdp.states.index(name)
    initial_states, state_values = _match_states(
        table, template, pomdp, terminal, reasoning, variables, initial
    )
    reports = _read_reports(table, pomdp, reasoning)
    table.reject_unknown_keys()
    return PlanningSection(pomdp, reports, initial_states, state_values, terminal)


def _check_template(table: TomlTable, key: str, template: str, variables: set[str]) -> None:
    """Check that a template of names contains each variable in braces, and no other field."""
    try:
        parts = [part for part in Formatter().parse(template) if part[1] is not None]
    except ValueError as error:
        raise DomainError(f"{table.location(key)}: {template!r}: {error}") from None
    fields = {f"{field}{':' if spec else ''}{conversion or ''}" for _, field, spec, conversion in parts}
    if fields != variables:
        raise DomainError(
            f"{table.location(key)}: {template!r} has to name each of {', '.join(sorted(variables))} in"
            f" braces, and nothing else"
        )


def _match_states(
    table: TomlTable,
    template: str,
    pomdp: Pomdp,
    terminal: int | None,
    reasoning: ReasoningSection,
    variables: Mapping[str, tuple[str, ...]],
    initial: Mapping[str, str],
) -> tuple[Array, Array]:
    """Return `initial_states` (V, S) and `state_values` (S, V), from the names of the POMDP's states."""
    location, declaration = table.location("states"), locate_declaration(pomdp, "states")
    index_of = {state: s for s, state in enumerate(pomdp.states)}
    initial_states = np.zeros((len(reasoning.values), len(pomdp.states)))
    state_values = np.zeros((len(pomdp.states), len(reasoning.values)))
    for v, value in enumerate(reasoning.values):
        for combination in product(*variables.values()):
            local = dict(zip(variables, combination, strict=True))
            state = template.format_map({**reasoning.split(value), **local})
            s = index_of.get(state)
            if s is None or s == terminal:
                raise DomainError(
                    f"{location}: {template!r} makes {state!r}, which is not a state of"
                    f" {declaration}; {expected_one_of(pomdp.states)}"
                )
            if state_values[s].any():
                raise DomainError(f"{location}: {template!r} makes {state!r} twice")
            state_values[s, v] = 1
            initial_states[v, s] = local == initial
    for s, state in enumerate(pomdp.states):
        if s != terminal and not state_values[s].any():
            raise DomainError(
                f"{declaration}: state {state!r} is neither made by {template!r} ({location})"
                f" nor the terminal state"
            )
    return initial_states, state_values


def _read_local_variables(
    table: TomlTable, shared: tuple[str, ...]
) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Return the values and the initial value of each variable that only the planner has."""
    values: dict[str, tuple[str, ...]] = {}
    initial: dict[str, str] = {}
    for name in table:
        variable = table.section(name)
        if name in shared:
            raise DomainError(f"{table.location(name)}: {name!r} is shared, not the planner's own variable")
        values[name] = variable.names("values")
        initial[name] = variable.text("start", values[name][0])
        if initial[name] not in values[name]:
            raise DomainError(
                f"{variable.location('start')}: unknown value {initial[name]!r};"
                f" {expected_one_of(values[name])}"
            )
        variable.reject_unknown_keys()
    return values, initial


def _read_reports(table: TomlTable, pomdp: Pomdp, reasoning: ReasoningSection) -> dict[str, SharedValue]:
    """Read `reports`: a template of the report actions, or a table action -> value (of several: a list)."""
    reports: dict[str, SharedValue] = {}
    if table.is_text("reports"):
        template, location = table.text("reports"), table.location("reports")
        _check_template(table, "reports", template, set(reasoning.shared))
        for value in reasoning.values:
            action = template.format_map(reasoning.split(value))
            check_declared(location, action, pomdp, "actions")
            if action in reports:
                raise DomainError(f"{location}: {template!r} makes {action!r} twice")
            reports[action] = value
        return reports
    section = table.section("reports", required=True)
    for action in section:
        location = section.location(action)
        check_declared(location, action, pomdp, "actions")
        one = len(reasoning.shared) == 1
        names = (section.text(action),) if one else section.names(action, distinct=False)
        if len(names) != len(reasoning.shared):
            raise DomainError(
                f"{location}: {list(names)} has {len(names)} values; expected one for each of"
                f" {', '.join(reasoning.shared)}"
            )
        for attribute, value in zip(reasoning.shared, names, strict=True):
            reasoning.check_value(location, attribute, value)
        reports[action] = reasoning.join(dict(zip(reasoning.shared, names, strict=True)))
    reported = set(reports.values())
    for value in reasoning.values:
        if value not in reported:
            raise DomainError(f"{table.location('reports')}: no action reports {format_value(value)!r}")
    return reports
