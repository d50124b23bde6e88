"""The shared values of the planner's states: by a pattern of their names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from string import Formatter

import numpy as np

from lcorpp.domains.sections.names import check_declared, locate_declaration
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.planning import Pomdp
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class StateMap:
    """The shared value of each of S states, and where the planner's own variables start.

    initial_states: (V, S) the probability of each state, given the shared value v, before the first action.
    state_values: (S, V) 1 if a state has shared value v; zeros for terminal states.
    terminal: the indices of the terminal states.
    """

    initial_states: Array
    state_values: Array
    terminal: tuple[int, ...]


def read_states(table: TomlTable, pomdp: Pomdp, reasoning: ReasoningSection) -> StateMap:
    """Read the keys `states`, `terminal` and `local`.

    Raises:
        DomainError: a state has no shared value, a shared value no state, or a name is unknown.
    """
    template = table.text("states", "_".join(f"{{{name}}}" for name in reasoning.shared))
    variables, initial = _read_local_variables(table.section("local"), reasoning.shared)
    check_template(table, "states", template, {*reasoning.shared, *variables})
    terminal: tuple[int, ...] = ()
    if "terminal" in table:
        name = table.text("terminal")
        check_declared(table.location("terminal"), name, pomdp, "states")
        terminal = (pomdp.states.index(name),)
    return _match_names(table, template, pomdp, terminal, reasoning, variables, initial)


def check_template(table: TomlTable, key: str, template: str, variables: set[str]) -> None:
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


def _match_names(
    table: TomlTable,
    template: str,
    pomdp: Pomdp,
    terminal: tuple[int, ...],
    reasoning: ReasoningSection,
    variables: Mapping[str, tuple[str, ...]],
    initial: Mapping[str, str],
) -> StateMap:
    """Match the names of the POMDP's states with a template."""
    location, declaration = table.location("states"), locate_declaration(pomdp, "states")
    index_of = {state: s for s, state in enumerate(pomdp.states)}
    initial_states = np.zeros((len(reasoning.values), len(pomdp.states)))
    state_values = np.zeros((len(pomdp.states), len(reasoning.values)))
    for v, value in enumerate(reasoning.values):
        for combination in product(*variables.values()):
            local = dict(zip(variables, combination, strict=True))
            state = template.format_map({**reasoning.split(value), **local})
            s = index_of.get(state)
            if s is None:
                raise DomainError(
                    f"{location}: {template!r} makes {state!r}, which is not a state of"
                    f" {declaration}; {expected_one_of(pomdp.states)}"
                )
            if s in terminal:
                raise DomainError(
                    f"{location}: {template!r} makes {state!r}, the terminal state at"
                    f" {table.location('terminal')}; expected another one"
                )
            if state_values[s].any():
                raise DomainError(f"{location}: {template!r} makes {state!r} twice")
            state_values[s, v] = 1
            initial_states[v, s] = local == initial
    for s, state in enumerate(pomdp.states):
        if s not in terminal and not state_values[s].any():
            raise DomainError(
                f"{declaration}: state {state!r} is neither made by {template!r} ({location})"
                f" nor the terminal state"
            )
    return StateMap(initial_states, state_values, terminal)


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
