"""Limits: what a policy must not do too often, as an expected cost or the probability of an event."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.arguments import check_count, check_type
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.undiscounted import find_ended
from lcorpp.values import Array, share_frozen

MAX_COUNT = 20
"""Maximum of `more_than`: each count multiplies the states of the model."""

EXPECTED = "[total|discounted](ACTIONS[:STATES]) or ACTIONS[:STATES][>N], [|STATES], <= BOUND"
"""The form of a limit, for messages."""

Kind = Literal["probability", "total", "discounted"]

_FORM = re.compile(
    r"\s*(?:(?P<kind>total|discounted)\s*\((?P<inner>[^()]*)\)|(?P<event>[^()|<]*?))"
    r"\s*(?:\|(?P<given>[^|<]*))?<=(?P<bound>[^<]*)"
)

_NUMBER = re.compile(r"[+]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE][+-]?[0-9]+)?")


@dataclass(frozen=True, eq=False)
class Limit:
    """A bound on an expected cost, or on the probability of an event in a decision.

    name: for messages and tables.
    cost: (A, S) cost of an action in a state, not negative. Of an event, 1 where an action counts, else 0.
    bound: maximum of the expected cost or the probability.
    kind: "probability" that the cost of a decision is more than `more_than`; "total" or "discounted"
        expected cost, the latter with the discount of the model.
    more_than: of an event, how often it may happen before it counts.
    given: (S,) whether the limit is about decisions that begin in a state; None for all. The cost or
        probability is then conditional.

    Raises:
        ModelError: a shape, sign or number is wrong.

    Examples:
        >>> from lcorpp.planning import Limit
        >>> Limit("bothered", [[0, 1], [0, 0]], 0.02)  # the first of two actions in the second state
        <Limit bothered <= 0.02>
    """

    name: str
    cost: Array
    bound: float
    kind: Kind = "probability"
    more_than: int = 0
    given: npt.NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        try:
            cost = share_frozen(self.cost)
        except (TypeError, ValueError):
            raise ModelError(f"limit {self.name}: costs are finite numbers (A, S) from 0") from None
        object.__setattr__(self, "cost", cost)
        if cost.ndim != 2 or not np.isfinite(cost).all() or cost.min(initial=0.0) < 0:
            raise ModelError(f"limit {self.name}: costs are finite numbers (A, S) from 0")
        if not cost.any():
            raise ModelError(f"limit {self.name}: it counts nothing; expected a positive cost")
        count = check_count(f"more_than of the limit {self.name}", self.more_than, 0)
        if self.kind not in ("probability", "total", "discounted"):
            kinds = expected_one_of(("probability", "total", "discounted"))
            raise ModelError(f"limit {self.name}: unknown kind {self.kind!r}; {kinds}")
        check_type(f"the bound of {self.name}", self.bound, float, int)
        if not 0 <= self.bound < np.inf:
            raise ModelError(f"limit {self.name}: the bound is {self.bound}; expected a number from 0")
        if self.kind == "probability":
            if self.bound > 1:
                raise ModelError(f"limit {self.name}: the bound of a probability is {self.bound:g}, above 1")
            if not np.isin(cost, (0.0, 1.0)).all():
                raise ModelError(f"limit {self.name}: the costs of an event are 0 or 1")
            if count > MAX_COUNT:
                raise ModelError(f"limit {self.name}: more_than is {count}; expected 0 to {MAX_COUNT}")
        elif count:
            raise ModelError(f"limit {self.name}: more_than is of an event; expected 0 for a cost")
        if self.given is not None:
            given = np.array(self.given, dtype=bool)
            given.setflags(write=False)
            object.__setattr__(self, "given", given)
            if given.shape != cost.shape[1:]:
                raise ModelError(f"limit {self.name}: `given` has shape {given.shape}, not {cost.shape[1:]}")

    def __repr__(self) -> str:
        return f"<Limit {self.name} <= {self.bound:g}>"

    def check_model(self, pomdp: Pomdp) -> None:
        """Raise a `ModelError` unless the costs have the shape of a model's rewards."""
        if self.cost.shape != pomdp.reward.shape:
            raise ModelError(
                f"limit {self.name}: costs of shape {self.cost.shape}; expected those of the rewards,"
                f" {pomdp.reward.shape}"
            )


class LimitText(NamedTuple):
    """The parts of a limit as text.

    what: the actions and states, or a file. given: the condition, None without. name: without the bound.
    """

    name: str
    kind: Kind
    what: str
    more_than: int
    given: str | None
    bound: float


def split_limit(text: str) -> LimitText:
    """Split the text of a limit into its parts, e.g. ``greet:not_interested <= 0.02``.

    Raises:
        ModelError: the text has another form; the message has the expected one.
    """
    check_type("a limit", text, str)
    match = _FORM.fullmatch(text)
    if match is None:
        raise ModelError(f"limit {text!r}: expected {EXPECTED}")
    kind: Kind = "probability"
    what, more_than = match["event"], 0
    if match["kind"] is not None:
        kind, what = ("total" if match["kind"] == "total" else "discounted"), match["inner"]
    if ">" in what:
        what, _, count = what.partition(">")
        if not re.fullmatch(r"\s*[0-9]{1,9}\s*", count) or kind != "probability":
            raise ModelError(
                f"limit {text!r}: {count!r} after '>' is not the count of an event; expected {EXPECTED}"
            )
        more_than = int(count)
    found = match["bound"].strip()
    if not _NUMBER.fullmatch(found):
        raise ModelError(f"limit {text!r}: {found!r} is not a number; expected a number from 0")
    bound = float(match["bound"])
    given = None if match["given"] is None else match["given"].strip()
    if not what.strip() or what.rstrip().endswith(":") or given == "":
        raise ModelError(f"limit {text!r}: expected {EXPECTED}")
    return LimitText(text.partition("<=")[0].strip(), kind, what.strip(), more_than, given, bound)


def read_limit(pomdp: Pomdp, text: str) -> Limit:
    """Return a limit of a model from text.

    ``ACTIONS:STATES <= BOUND`` limits the probability that one of these actions is taken in one of these
    states in a decision; ``>N`` after them, that it happens more than N times. Without states, all count but
    those that have ended. ``total(...)`` and ``discounted(...)`` limit the expected number instead, or the
    costs in a file: the rewards of a model with the same names. ``|STATES`` makes it conditional on the
    initial state. Names are divided by commas, and may be patterns with ``*``; a name of several states is
    what their names have before an underscore.

    Raises:
        ModelError: the text has another form, or a name is unknown.
        FileError, ParseError: the file of costs is wrong.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_limit
        >>> limit = read_limit(load_domain("intention").pomdp, "greet,turn:not_interested <= .05")
        >>> limit.cost.sum(axis=1)  # in two states each
        array([0., 2., 2., 0., 0.])
    """
    parts = split_limit(text)
    given = None if parts.given is None else find_states(pomdp, parts.given, text)
    cost = _read_costs(pomdp, parts, text) if parts.what.lower().endswith((".pomdp", ".pomdpx")) else None
    if cost is None:
        actions, _, states = parts.what.partition(":")
        chosen = find_states(pomdp, states, text) if states else ~find_ended(pomdp)
        cost = np.outer(find_actions(pomdp, actions, text), chosen).astype(np.float64)
    return Limit(parts.name, cost, parts.bound, parts.kind, parts.more_than, given)


def find_actions(pomdp: Pomdp, names: str, text: str) -> npt.NDArray[np.bool_]:
    """Return (A,) whether an action is named in a list of names and patterns; text: of the limit."""
    return _find(pomdp.actions, names, text, "action", lambda name, own: name == own)


def find_states(pomdp: Pomdp, names: str, text: str) -> npt.NDArray[np.bool_]:
    """Return (S,) whether a state is named in a list of names, patterns and first parts of names."""
    return _find(
        pomdp.states, names, text, "state", lambda name, own: name == own or name.startswith(f"{own}_")
    )


def _find(
    known: Sequence[str], names: str, text: str, kind: str, matches: Callable[[str, str], bool]
) -> npt.NDArray[np.bool_]:
    found = np.zeros(len(known), dtype=bool)
    for own in (part.strip() for part in names.split(",")):
        pattern = "*" in own
        hits = np.array([fnmatchcase(name, own) if pattern else matches(name, own) for name in known])
        if not hits.any():
            raise ModelError(f"limit {text!r}: no {kind} {own!r}; {expected_one_of(known)}")
        found |= hits
    return found


def _read_costs(pomdp: Pomdp, parts: LimitText, text: str) -> Array:
    """Read the costs of a file: the rewards of a model with the names of this one."""
    from lcorpp.planning.formats.model_file import read_model  # loads the parsers

    if parts.kind == "probability":
        raise ModelError(f"limit {text!r}: expected total({parts.what}) or discounted({parts.what})")
    model, _ = read_model(Path(parts.what))
    if (model.states, model.actions) != (pomdp.states, pomdp.actions):
        raise ModelError(f"limit {text!r}: the states or actions of {parts.what} have other names")
    if model.reward.min() < 0:
        raise ModelError(
            f"limit {text!r}: a cost in {parts.what} is {model.reward.min():g}; expected costs from 0,"
            " as rewards of a file with `values: reward`"
        )
    return model.reward


def check_limit_set(pomdp: Pomdp, limits: Iterable[Limit]) -> tuple[Limit, ...]:
    """Return the limits of a model.

    Raises:
        ModelError: there is none, two have one name, or one is for another model.
    """
    found = tuple(limits)
    if not found:
        raise ModelError("there is no limit; expected at least one")
    for k, limit in enumerate(found):
        check_type("a limit", limit, Limit)
        limit.check_model(pomdp)
        if limit.name in [other.name for other in found[:k]]:
            raise ModelError(f"two limits have the name {limit.name!r}")
    return found
