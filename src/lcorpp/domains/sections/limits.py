"""The `[[planning.limits]]` tables of a domain: what the robot must not do too often, in its names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, ModelError, expected_one_of
from lcorpp.planning import GenerativeModel, Limit, Pomdp
from lcorpp.planning.limits.limit import Kind, find_actions, split_limit
from lcorpp.values import Array, SharedValue, share_frozen

WRONG = "wrong"
"""Name of all reports of another value than the true one, in place of actions."""


@dataclass(frozen=True, eq=False)
class DomainLimit:
    """A limit on what a robot does to people, see `lcorpp.planning.Limit`.

    cost: (A, V) cost of an action about a person of a shared value; of an event, 0 or 1.
    condition: attribute of the knowledge -> values of the people whom the limit is about; {} for all.

    Examples:
        >>> from lcorpp import load_domain
        >>> (limit,) = load_domain("intention", preset="limit_5").planning.limits
        >>> limit.name, limit.bound, dict(limit.condition)
        ('bothered', 0.05, {'intention': ('not_interested',)})
    """

    name: str
    cost: Array
    bound: float
    kind: Kind = "probability"
    more_than: int = 0
    condition: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cost", share_frozen(self.cost))

    def make_limit(self, state_values: Array) -> Limit:
        """Return the limit of the planner's model, without the condition; state_values: (S, V)."""
        return Limit(self.name, self.cost @ state_values.T, self.bound, self.kind, self.more_than)

    def concerns(self, person: Mapping[str, str]) -> bool:
        """Whether the limit is about a person (attribute -> value)."""
        return all(person[name] in values for name, values in self.condition.items())

    def score(self, totals: Array) -> Array:
        """Return the costs of decisions from their sums (n,): of an event whether it happened."""
        return (totals > self.more_than).astype(np.float64) if self.kind == "probability" else totals


def read_limits(
    table: TomlTable,
    model: Pomdp | GenerativeModel,
    reasoning: ReasoningSection,
    reports: Mapping[str, SharedValue],
) -> tuple[tuple[DomainLimit, ...], tuple[float, ...]]:
    """Read the tables `limits`, and `limit_noise`, from `[planning]`.

    A limit has a text `limit` in the form of `lcorpp.planning.read_limit`, and maybe a `name`. In place of
    states the text has values of the shared variable, or ``VARIABLE=VALUE``; the condition may be about any
    attribute of the knowledge, several of them divided by ``&``. `WRONG` stands for all wrong reports.

    Raises:
        DomainError: a limit has another form, a name is unknown, or the model is generative.
    """
    if not isinstance(model, Pomdp):
        raise DomainError(
            f"{table.location('limits')}: {model.file} is simulated; limits need a model with tables"
        )
    limits = _read_tables(table.sections("limits"), model, reasoning, reports)
    noise = table.value("limit_noise") if "limit_noise" in table else []
    numbers = noise if isinstance(noise, list) else [-1]
    if not all(type(n) in (int, float) and 0 <= n <= 1 for n in numbers) or len(set(numbers)) < len(numbers):
        raise DomainError(
            f"{table.location('limit_noise')}: expected a list of different probabilities, not {noise!r}"
        )
    return limits, tuple(map(float, numbers))


def _read_tables(
    tables: Sequence[TomlTable],
    pomdp: Pomdp,
    reasoning: ReasoningSection,
    reports: Mapping[str, SharedValue],
) -> tuple[DomainLimit, ...]:
    limits = list[DomainLimit]()
    for table in tables:
        location = table.location("limit")
        try:
            limit = _read_limit(table.text("limit"), pomdp, reasoning, reports)
            limit = replace(limit, name=table.text("name", limit.name))
            limit.make_limit(np.eye(limit.cost.shape[1]))  # checks the numbers
        except ModelError as error:
            raise DomainError(f"{location}: {error}") from None
        if limit.name in [other.name for other in limits]:
            raise DomainError(f"{location}: another limit has the name {limit.name!r}")
        table.reject_unknown_keys()
        limits.append(limit)
    return tuple(limits)


def _read_limit(
    text: str, pomdp: Pomdp, reasoning: ReasoningSection, reports: Mapping[str, SharedValue]
) -> DomainLimit:
    parts = split_limit(text)
    if parts.what.lower().endswith((".pomdp", ".pomdpx")):
        raise ModelError(f"limit {text!r}: costs of a file are for `lcorpp solve`")
    actions, _, values = parts.what.partition(":")
    chosen = np.ones(len(reasoning.values), bool)
    if values:
        wanted = _read_condition(values, reasoning, text)
        if unknown := [name for name in wanted if name not in reasoning.shared]:
            raise ModelError(
                f"limit {text!r}: {unknown[0]!r} is not shared; {expected_one_of(reasoning.shared)}"
            )
        people = [reasoning.split(value) for value in reasoning.values]
        chosen = np.array([all(person[n] in own for n, own in wanted.items()) for person in people])
    if actions.strip() == WRONG and WRONG not in pomdp.actions:
        cost = np.zeros((len(pomdp.actions), len(reasoning.values)))
        for action, value in reports.items():
            cost[pomdp.action_index(action)] = [own != value for own in reasoning.values]
        cost *= chosen
    else:
        cost = np.outer(find_actions(pomdp, actions, text), chosen).astype(np.float64)
    condition = {} if parts.given is None else _read_condition(parts.given, reasoning, text)
    return DomainLimit(parts.name, cost, parts.bound, parts.kind, parts.more_than, condition)


def _read_condition(text: str, reasoning: ReasoningSection, limit: str) -> dict[str, tuple[str, ...]]:
    """Read ``ATTRIBUTE=VALUE,VALUE & ...``; values alone are those of the only shared variable."""
    condition = dict[str, tuple[str, ...]]()
    for part in text.split("&"):
        name, sign, listed = part.partition("=")
        if not sign:
            if len(reasoning.shared) > 1:
                example = f"{reasoning.shared[0]}=VALUE"
                raise ModelError(f"limit {limit!r}: {part.strip()!r} names no variable; expected {example}")
            name, listed = reasoning.shared[0], part
        name = name.strip()
        known = reasoning.program.attributes
        if name not in known:
            raise ModelError(f"limit {limit!r}: no attribute {name!r}; {expected_one_of(tuple(known))}")
        values = tuple(value.strip() for value in listed.split(","))
        for value in values:
            if value not in known[name].values:
                raise ModelError(
                    f"limit {limit!r}: {name} is never {value!r}; {expected_one_of(known[name].values)}"
                )
        if name in condition:
            raise ModelError(f"limit {limit!r}: {name} occurs twice; expected its values by commas")
        condition[name] = values
    return condition
