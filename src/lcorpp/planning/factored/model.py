"""Factored POMDPs: states, actions and observations are values of variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from types import MappingProxyType

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.notebook import html_table, join_some
from lcorpp.planning.factored.cpt import Spec, Words, build_table, split_words
from lcorpp.planning.factored.table import Table, check_distributions
from lcorpp.planning.factored.variables import AFTER, Scope, Variable, build_scope, check_word
from lcorpp.planning.pomdp import Pomdp, discount_message
from lcorpp.planning.sparse import SparseTables


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


Domain = Words | Mapping[str, Words]
"""The values of one variable, or of several variables by name."""


@dataclass(frozen=True, eq=False)
class Factored:
    """A POMDP as a dynamic Bayesian network over one step. `Factored.of` builds one from text.

    states, actions, observations: the variables. A state variable may be `observed` (mixed observability);
        there may be no observation variable.
    start:       tables P(x | ...) over the state variables, before the first action
    transition:  tables P(x' | ...) given actions, states before (x) and after (y')
    observation: tables P(o | ...) given actions, states after and other observations
                 each variable is a child in exactly one table, and dependencies have no cycle
    reward:      tables by name, over any variables; the reward is their sum
    discount:    0 <= discount <= 1
    file:        name of the source file, for messages; "" if there is none

    Raises:
        ModelError: a name appears twice, a table is missing, appears twice or has a wrong shape or parent,
            dependencies have a cycle, or a row is not a distribution.

    Source: Boutilier, Dean and Hanks, JAIR 1999 (factored); Ong, Png, Hsu and Lee, RSS 2009 (observed parts).

    Examples:
        >>> from lcorpp.planning import Factored
        >>> room = Factored.of(
        ...     states={"cup": "full empty", "lamp": "on off"}, observed="lamp", actions="wait",
        ...     start={"cup": "full", "lamp": "uniform"}, transition={"cup": "same", "lamp": "same"},
        ...     reward=1, discount=0.9,
        ... )
        >>> [variable.name for variable in room.observed]
        ['lamp']
    """

    states: tuple[Variable, ...]
    actions: tuple[Variable, ...]
    observations: tuple[Variable, ...]
    start: tuple[Table, ...]
    transition: tuple[Table, ...]
    observation: tuple[Table, ...]
    reward: Mapping[str, Table]
    discount: float
    file: str = ""
    scope: Scope = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for kind in ("states", "actions", "observations", "start", "transition", "observation"):
            object.__setattr__(self, kind, tuple(getattr(self, kind)))
        object.__setattr__(self, "reward", MappingProxyType(dict(self.reward)))
        object.__setattr__(self, "discount", float(self.discount))
        for variable in (*self.actions, *self.observations):
            if variable.observed:
                raise ModelError(f"{variable.name!r} is not a state variable: it cannot be 'observed'")
        scope = build_scope(self.states, self.actions, self.observations)
        object.__setattr__(self, "scope", scope)
        if not 0 <= self.discount <= 1:
            raise ModelError(discount_message(self.discount))
        before = [variable.name for variable in self.states]
        after = [name + AFTER for name in before]
        actions = [variable.name for variable in self.actions]
        observations = [variable.name for variable in self.observations]
        for kind, children, parents in (
            ("start", before, before),
            ("transition", after, [*actions, *before, *after]),
            ("observation", observations, [*actions, *after, *observations]),
        ):
            object.__setattr__(
                self, kind, topological_order(kind, getattr(self, kind), scope, children, parents)
            )
        for name, table in self.reward.items():
            check_word(name, "the name of a reward")
            if name in scope:
                raise ModelError(f"a reward has the name of variable {name!r}")
            check_reward(f"reward {name!r}", table, scope)

    @classmethod
    def of(
        cls,
        *,
        states: Mapping[str, Words],
        observed: Words = (),
        actions: Domain,
        observations: Domain = (),
        start: Mapping[str, Spec],
        transition: Mapping[str, Spec],
        observation: Mapping[str, Spec] | Spec | None = None,
        reward: Mapping[str, Spec] | Spec,
        discount: float,
    ) -> Factored:
        """Build a problem from text.

            Factored.of(
                states={"place": "hall kitchen", "cup": "clean dirty"},
                observed="place",
                actions="look go",
                observations="clean dirty",
                start={"place": "hall", "cup": "uniform"},
                transition={
                    "place": cpt("action place", {"* *": "same", "go hall": {"kitchen": 0.9, "hall": 0.1}}),
                    "cup": "same",
                },
                observation=cpt("action place' cup'", {
                    "* * *": "uniform",
                    "look kitchen -": [[0.8, 0.2], [0.3, 0.7]],
                }),
                reward=cpt("action", {"go": -1}),
                discount=0.95,
            )

        Args:
            states: the values of each state variable, as text or as an iterable of items.
            observed: the state variables whose value is always observed.
            actions: the values of each action variable, or of a single variable, named ``action``.
            observations: likewise, named ``observation``; there may be none.
            start, transition, observation: a table for each variable, see `cpt`. Dependent variables may
                share one, as ``"x y"``. Keys are the plain names; among parents, ``x`` is the value before
                and ``x'`` the value after the action.
            reward: tables of numbers by name, which are added up; missing cases have reward 0.
            discount: 0 <= discount <= 1.

        Raises:
            ModelError: as for `Factored`, and for unknown names and arrays of a wrong shape; the message
                names table and row.
        """
        observed_names = split_words(observed)
        parts = tuple(
            Variable(name, split_words(values), observed=name in observed_names)
            for name, values in states.items()
        )
        for name in observed_names:
            if name not in states:
                raise ModelError(f"unknown state variable {name!r} is 'observed'; {expected_one_of(states)}")
        action_parts = _make_variables("action", actions)
        observation_parts = _make_variables("observation", observations)
        scope = build_scope(parts, action_parts, observation_parts)

        def build_tables(kind: str, specs: Mapping[str, Spec], suffix: str) -> tuple[Table, ...]:
            known = [v.name for v in (observation_parts if kind == "observation" else parts)]
            for name in (name for names in specs for name in split_words(names)):
                if name not in known:
                    raise ModelError(f"{kind} has a table for unknown {name!r}; {expected_one_of(known)}")
            return tuple(
                build_table(
                    scope, spec, tuple(name + suffix for name in split_words(names)), f"{kind} of {names!r}"
                )
                for names, spec in specs.items()
            )

        if observation is None:
            observation = {}
        elif not isinstance(observation, Mapping):
            if len(observation_parts) != 1:
                raise ModelError(
                    f"observation is one table for {len(observation_parts)} variables; give them by name"
                )
            observation = {observation_parts[0].name: observation}
        rewards = reward if isinstance(reward, Mapping) else {"reward": reward}
        return cls(
            parts,
            action_parts,
            observation_parts,
            build_tables("start", start, ""),
            build_tables("transition", transition, AFTER),
            build_tables("observation", observation, ""),
            {name: build_table(scope, spec, (), f"reward {name!r}") for name, spec in rewards.items()},
            discount,
        )

    @classmethod
    def of_pomdp(cls, pomdp: Pomdp) -> Factored:
        """Convert a POMDP to a factored one with variables ``state``, ``action`` and ``observation``."""
        S, A = len(pomdp.states), len(pomdp.actions)
        reward = SparseTables.of(np.reshape(pomdp.reward, (1, A * S, 1)))
        return cls(
            (Variable("state", pomdp.states),),
            (Variable("action", pomdp.actions),),
            (Variable("observation", pomdp.observations),),
            (Table.of((), ("state",), pomdp.start),),
            (_make_flat_table(pomdp.transition, ("action", "state"), "state'"),),
            (_make_flat_table(pomdp.observation, ("action", "state'"), "observation"),),
            {"reward": Table(("action", "state"), (), (A, S), reward)},
            pomdp.discount,
            pomdp.file,
        )

    def _kinds(self) -> tuple[tuple[str, tuple[Variable, ...]], ...]:
        return ("state", self.states), ("action", self.actions), ("observation", self.observations)

    def __repr__(self) -> str:
        name = f"{self.file}: " if self.file else ""
        sizes = (
            f"{kind}s {' x '.join(str(len(v.values)) for v in variables)}, "
            for kind, variables in self._kinds()
            if variables
        )
        return f"<Factored {name}{''.join(sizes)}discount {self.discount:g}>"

    def _repr_html_(self) -> str:
        rows = [
            ("observed state" if variable.observed else kind, variable.name, join_some(variable.values))
            for kind, variables in self._kinds()
            for variable in variables
        ]
        return html_table(("kind", "variable", "values"), rows, caption=repr(self)[1:-1])

    def equals(self, other: Factored) -> bool:
        """Return whether both problems are bitwise equal; the source file does not count."""
        names, other_names = (
            (f.states, f.actions, f.observations, f.discount, tuple(f.reward)) for f in (self, other)
        )
        # each variable is the child of one table, so equal tables belong to the same kind
        tables, other_tables = (
            (*f.start, *f.transition, *f.observation, *f.reward.values()) for f in (self, other)
        )
        return (names, len(tables)) == (other_names, len(other_tables)) and all(
            table.equals(other_table) for table, other_table in zip(tables, other_tables, strict=True)
        )

    @cached_property
    def observed(self) -> tuple[Variable, ...]:
        """The state variables whose value is always observed."""
        return tuple(variable for variable in self.states if variable.observed)


def _make_variables(kind: str, domain: Domain) -> tuple[Variable, ...]:
    if isinstance(domain, Mapping):
        return tuple(Variable(name, split_words(values)) for name, values in domain.items())
    values = split_words(domain)
    return (Variable(kind, values),) if values or kind == "action" else ()


def _make_flat_table(rows: SparseTables, parents: tuple[str, str], child: str) -> Table:
    A, R, N = rows.shape
    return Table(
        parents, (child,), (A, R, N), SparseTables((1, A * R, N), rows.begins, rows.columns, rows.values)
    )
