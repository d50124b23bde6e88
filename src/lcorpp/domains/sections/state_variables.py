"""The shared values of the planner's states: by the variables of a factored model."""

from __future__ import annotations

import numpy as np

from lcorpp.domains.sections.names import locate_variable
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.sections.states import StateMap
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.planning import Factored, Pomdp, Variable
from lcorpp.values import Array


def match_variables(
    table: TomlTable, pomdp: Pomdp, problem: Factored, reasoning: ReasoningSection
) -> StateMap:
    """Match the variables of the model by their names and values.

    The key `terminal` is read, too. The variables that are not shared start as in the model: given the shared
    value v, or, if v has
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
