"""The shared values of the planner's states: by a pattern of their names, or by the model's variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from string import Formatter
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.domains.sections.names import check_declared, locate_declaration, locate_variable
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.planning import Pomdp
from lcorpp.values import Array

if TYPE_CHECKING:
    from lcorpp.planning import Factored, Variable


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


def read_states(
    table: TomlTable, pomdp: Pomdp, problem: Factored | None, reasoning: ReasoningSection
) -> StateMap:
    """Read the keys `states`, `terminal` and `local`.

    Args:
        problem: the variables of `pomdp`, if it has them; they are used if `states` is missing.

    Raises:
        DomainError: a state has no shared value, a shared value no state, or a name is unknown.
    """
    if problem is not None and "states" not in table:
        return _match_variables(table, pomdp, problem, reasoning)
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


def _match_variables(
    table: TomlTable, pomdp: Pomdp, problem: Factored, reasoning: ReasoningSection
) -> StateMap:
    """Match the variables of the model by their names and values.

    The variables that are not shared start as in the model: given the shared value v, or, if v has
    probability 0 there, as they do over all.
    """
    shape = [len(variable.values) for variable in problem.states]
    names = [variable.name for variable in problem.states]
    indices = np.unravel_index(np.arange(len(pomdp.states)), shape)  # (S,) of the values of each variable
    alive = np.ones(len(pomdp.states))  # (S,) 0 for terminal states
    final_name = final_value = None  # the variable and its value that make a state terminal
    if "terminal" in table:
        final_name, final_value = _read_terminal(table, pomdp, problem)
        axis = names.index(final_name)
        alive[indices[axis] == problem.states[axis].index(final_value)] = 0
    shared_index = np.zeros(len(pomdp.states), dtype=np.intp)
    for name in reasoning.shared:
        values = reasoning.program.attributes[name].values
        if name not in names:
            raise DomainError(
                f"{pomdp.file} has no state variable {name!r}, which is shared ({reasoning.locate(name)});"
                f" {expected_one_of(names)}, or a pattern in {table.location('states')}"
            )
        variable = problem.states[names.index(name)]
        _check_values(pomdp, variable, reasoning, final_value if name == final_name else None)
        order = [values.index(value) if value in values else 0 for value in variable.values]
        shared_index = shared_index * len(values) + np.array(order)[indices[names.index(name)]]
    state_values = np.zeros((len(pomdp.states), len(reasoning.values)))
    state_values[np.arange(len(pomdp.states)), shared_index] = alive
    initial_states = _spread_start(pomdp, state_values, shape, names, reasoning)
    return StateMap(initial_states, state_values, tuple(np.flatnonzero(alive == 0).tolist()))


def _read_terminal(table: TomlTable, pomdp: Pomdp, problem: Factored) -> tuple[str, str]:
    """Return the variable and the value of ``terminal = "VARIABLE=VALUE"``."""
    name, _, value = table.text("terminal").partition("=")
    known = {variable.name: variable.values for variable in problem.states}
    if value not in known.get(name, ()):
        examples = [f"{variable}={value}" for variable, values in known.items() for value in values]
        raise DomainError(
            f"{table.location('terminal')}: {pomdp.file} has no {table.text('terminal')!r};"
            f" {expected_one_of(examples)}"
        )
    return name, value


def _check_values(pomdp: Pomdp, variable: Variable, reasoning: ReasoningSection, final: str | None) -> None:
    """Check that a variable of the model has the values of the program's, beside the terminal one."""
    name = variable.name
    expected = reasoning.program.attributes[name].values
    found = [value for value in variable.values if value != final]
    if set(found) != set(expected):
        raise DomainError(
            f"{locate_variable(pomdp, name)}: variable {name!r} has the values {', '.join(found)}; expected"
            f" {', '.join(expected)}, as at {reasoning.locate(name)}"
        )


def _spread_start(
    pomdp: Pomdp, state_values: Array, shape: list[int], names: list[str], reasoning: ReasoningSection
) -> Array:
    """Return `initial_states` (V, S): the model's start given each shared value.

    Given a value that has probability 0 at the start, the planner's own variables start as they do over all.
    """
    start = pomdp.start * state_values.any(axis=1)  # (S,) without terminal states
    initial_states = state_values.T * start
    shared_axes = tuple(axis for axis, name in enumerate(names) if name in reasoning.shared)
    own_start = start.reshape(shape).sum(axis=shared_axes, keepdims=True)  # of the planner's own variables
    missing = ~initial_states.any(axis=1)
    initial_states[missing] = state_values.T[missing] * np.broadcast_to(own_start, shape).reshape(-1)
    totals = initial_states.sum(axis=1, keepdims=True)
    if not totals.all():
        raise DomainError(f"{pomdp.file}: the start belief is terminal; expected one before a report")
    return np.asarray(initial_states / totals)
