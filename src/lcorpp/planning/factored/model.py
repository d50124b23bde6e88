"""The problem in its parts: a POMDP whose states, actions and observations are values of variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.factored.cpt import Spec, Words, distribution, words
from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.validation import check_reward, topological_order
from lcorpp.planning.factored.variables import AFTER, Scope, Variable, check_word, scope_of
from lcorpp.planning.pomdp import Pomdp, discount_message
from lcorpp.planning.sparse import SparseTables

Domain = Words | Mapping[str, Words]
"""The values of one variable, or of several by name."""


@dataclass(frozen=True, eq=False)
class Factored:
    """A POMDP in parts: a dynamic Bayesian network over one step. `Factored.of` makes one from plain words.

    states, actions, observations: the variables; a state variable may always be `observed` (mixed
        observability). There may be no observation variable.
    start:       tables P(x | ...) over the state variables, before the first action
    transition:  tables P(x' | ...) given actions, states before (x) and after (y')
    observation: tables P(o | ...) given actions, states after and other observations
                 together they hold each variable once, and no two of them depend on each other
    reward:      tables by name; the reward is their sum. They may depend on any variable
    discount:    0 < discount < 1
    file:        where it was read from, for people to read; "" when it was not

    Raises:
        ModelError: two names are the same, a table is missing, there twice, of the wrong shape or depends on
            what it cannot depend on, variables depend on each other in a circle, or a row is no distribution.

    Source: Boutilier, Dean and Hanks, JAIR 1999 (factored); Ong, Png, Hsu and Lee, RSS 2009 (observed parts).
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
                raise ModelError(f"{variable.name!r} is no part of the state: it cannot be 'observed'")
        scope = scope_of(self.states, self.actions, self.observations)
        object.__setattr__(self, "scope", scope)
        if not 0 < self.discount < 1:
            raise ModelError(discount_message(self.discount))
        before = [variable.name for variable in self.states]
        after = [name + AFTER for name in before]
        actions = [variable.name for variable in self.actions]
        seen = [variable.name for variable in self.observations]
        for kind, children, parents in (
            ("start", before, before),
            ("transition", after, [*actions, *before, *after]),
            ("observation", seen, [*actions, *after, *seen]),
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
        """A problem in plain words.

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
            states: the values of each state variable, as words or as a sequence of anything with a name.
            observed: the state variables whose value is always seen.
            actions: the values of each action variable; those of one alone are called ``action``.
            observations: likewise, ``observation``; there may be none.
            start, transition, observation: a table for each variable, see `cpt`; several variables that
                belong together may share one, as ``"x y"``. In `start` and `transition` they are called by
                their plain names; where tables depend on them, ``x`` is before and ``x'`` after the action.
            reward: tables of numbers by name, which are added up; cases not given earn 0.
            discount: 0 < discount < 1.

        Raises:
            ModelError: as for `Factored`, and for unknown names and numbers of the wrong shape; the table and
                the row are named.
        """
        seen = words(observed)
        parts = tuple(Variable(name, words(values), observed=name in seen) for name, values in states.items())
        for name in seen:
            if name not in states:
                raise ModelError(
                    f"unknown state variable {name!r} is 'observed'; {expected_one_of(tuple(states))}"
                )
        acts, looks = _variables("action", actions), _variables("observation", observations)
        scope = scope_of(parts, acts, looks)

        def tables(kind: str, specs: Mapping[str, Spec], sign: str) -> tuple[Table, ...]:
            known = [v.name for v in (looks if kind == "observation" else parts)]
            for name in (name for names in specs for name in words(names)):
                if name not in known:
                    raise ModelError(f"{kind} has a table for unknown {name!r}; {expected_one_of(known)}")
            return tuple(
                distribution(scope, spec, tuple(name + sign for name in words(names)), f"{kind} of {names!r}")
                for names, spec in specs.items()
            )

        if observation is None:
            observation = {}
        elif not isinstance(observation, Mapping):
            if len(looks) != 1:
                raise ModelError(f"observation is one table for {len(looks)} variables; give them by name")
            observation = {looks[0].name: observation}
        rewards = reward if isinstance(reward, Mapping) else {"reward": reward}
        return cls(
            parts,
            acts,
            looks,
            tables("start", start, ""),
            tables("transition", transition, AFTER),
            tables("observation", observation, ""),
            {name: distribution(scope, spec, (), f"reward {name!r}") for name, spec in rewards.items()},
            discount,
        )

    @classmethod
    def of_pomdp(cls, pomdp: Pomdp) -> Factored:
        """A flat problem as one of a single ``state``, ``action`` and ``observation``."""
        S, A = len(pomdp.states), len(pomdp.actions)
        worth = SparseTables.of(np.reshape(pomdp.reward, (1, A * S, 1)))
        return cls(
            (Variable("state", pomdp.states),),
            (Variable("action", pomdp.actions),),
            (Variable("observation", pomdp.observations),),
            (Table.of((), ("state",), pomdp.start),),
            (_flat_table(pomdp.transition, ("action", "state"), "state'"),),
            (_flat_table(pomdp.observation, ("action", "state'"), "observation"),),
            {"reward": Table(("action", "state"), (), (A, S), worth)},
            pomdp.discount,
            pomdp.file,
        )

    def same(self, other: Factored) -> bool:
        """Whether both are the same, bit for bit, wherever they were read from."""
        mine, others = (
            (
                (f.states, f.actions, f.observations, f.discount, tuple(f.reward)),
                (f.start, f.transition, f.observation, tuple(f.reward.values())),
            )
            for f in (self, other)
        )
        return mine[0] == others[0] and all(
            len(a) == len(b) and all(x.same(y) for x, y in zip(a, b, strict=True))
            for a, b in zip(mine[1], others[1], strict=True)
        )

    @cached_property
    def observed(self) -> tuple[Variable, ...]:
        """The state variables whose value is always seen."""
        return tuple(variable for variable in self.states if variable.observed)


def _variables(kind: str, domain: Domain) -> tuple[Variable, ...]:
    if isinstance(domain, Mapping):
        return tuple(Variable(name, words(values)) for name, values in domain.items())
    values = words(domain)
    return (Variable(kind, values),) if values or kind == "action" else ()


def _flat_table(rows: SparseTables, parents: tuple[str, str], child: str) -> Table:
    A, R, N = rows.shape
    return Table(
        parents, (child,), (A, R, N), SparseTables((1, A * R, N), rows.begins, rows.columns, rows.values)
    )
