"""Checks of all tables of a factored POMDP together."""

from __future__ import annotations

from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.factored.table import Table, check_distributions
from lcorpp.planning.factored.variables import AFTER, Scope


def topological_order(
    kind: str, tables: Sequence[Table], scope: Scope, children: Sequence[str], parents: Sequence[str]
) -> tuple[Table, ...]:
    """Check the tables of a kind and order them so that each follows those that it depends on.

    Args:
        kind: ``transition`` or another, for messages.
        children: variables; each must be a child in exactly one table.
        parents: the variables that the tables may depend on.

    Raises:
        ModelError: a table is invalid, a variable has no table or two, or the dependencies have a cycle.
    """
    table_of: dict[str, int] = {}
    for i, table in enumerate(tables):
        for name in table.children:
            if name not in children:
                raise ModelError(f"{kind} has a table for unknown {name!r}; {expected_one_of(children)}")
            if name in table_of:
                raise ModelError(f"{kind} has two tables for {name!r}")
            table_of[name] = i
        if not table.children:
            raise ModelError(f"{kind} has a table without children")
        what = f"{kind} of {' '.join(name.removesuffix(AFTER) for name in table.children)!r}"
        _check_shape(what, table, scope, parents)
        check_distributions(table, scope, what)
    for name in children:
        if name not in table_of:
            raise ModelError(f"{kind} has no table for {name.removesuffix(AFTER)!r}")
    needs = {
        i: dict.fromkeys(table_of[name] for name in table.parents if name in table_of)
        for i, table in enumerate(tables)
    }
    try:
        return tuple(tables[i] for i in TopologicalSorter(needs).static_order())
    except CycleError as error:
        cycle = [" ".join(tables[i].children) for i in reversed(error.args[1])]
        raise ModelError(f"in {kind}, {' depends on '.join(cycle)}: a cycle") from None


def check_reward(what: str, table: Table, scope: Scope) -> None:
    """Raise a ModelError if a reward has children, or is not a table of finite numbers over the variables."""
    if table.children:
        raise ModelError(f"{what} is a reward table: it must not have children")
    _check_shape(what, table, scope, tuple(scope))
    if not np.isfinite(table.rows.values).all():
        raise ModelError(f"{what} contains a number that is not finite")


def _check_shape(what: str, table: Table, scope: Scope, parents: Sequence[str]) -> None:
    for name in table.parents:
        if name not in parents:
            raise ModelError(f"{what} cannot depend on {name!r}{_format_advice(name, parents)}")
    shape = tuple(len(scope[name].values) for name in (*table.parents, *table.children))
    if table.shape != shape:
        raise ModelError(f"{what} has the shape {table.shape}; its variables have {shape} values")


def _format_advice(name: str, allowed: Sequence[str]) -> str:
    if name + AFTER in allowed:
        return f", the value before the action; {name + AFTER!r} is the value after it"
    if name.removesuffix(AFTER) in allowed:
        return f", the value after the action; {name.removesuffix(AFTER)!r} is the value before it"
    return f"; {expected_one_of(allowed)}"
