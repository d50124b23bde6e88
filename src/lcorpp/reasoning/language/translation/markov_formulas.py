"""The formulas of Markov logic networks, as `mln_reader` reads them."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp
from typing import NamedTuple

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.issues import Place, SourceIssue

MAX_SIZE = 5000
"""Maximum number of connectives and atoms of a formula."""

MAX_HEIGHT = 250
"""Maximum number of connectives of a formula below each other."""

MAX_EXPANSIONS = 6
"""Maximum number of atoms with ``*`` in a formula."""


class Constant(NamedTuple):
    """A constant of a formula."""

    name: str


class Variable(NamedTuple):
    """A variable of a formula."""

    name: str


Argument = Constant | Variable


@dataclass(frozen=True, eq=False)
class Formula:
    """A formula.

    kind: "atom", "equal", "not", "and", "or", "exist"; other connectives are expressed by these.
    name, arguments: the predicate of an atom, or "" and both sides of an equation.
    parts: the formulas that it joins. variables: those that it binds.
    is_both: whether an atom has ``*``. size: the number of connectives and atoms; ``<=>`` doubles both sides.
    height: the number of connectives below each other.
    """

    kind: str
    at: Place
    name: str = ""
    arguments: tuple[Argument, ...] = ()
    parts: tuple[Formula, ...] = ()
    variables: tuple[str, ...] = ()
    is_both: bool = False
    size: int = field(default=1, init=False)
    height: int = field(default=1, init=False)

    def __post_init__(self) -> None:
        size = 1 + sum([part.size for part in self.parts])
        if size > MAX_SIZE:
            raise SourceIssue(self.at, f"a formula of more than {MAX_SIZE} connectives and atoms")
        height = 1 + max([part.height for part in self.parts], default=0)
        if height > MAX_HEIGHT:
            raise SourceIssue(self.at, f"a formula of more than {MAX_HEIGHT} connectives below each other")
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "height", height)


class Predicate(NamedTuple):
    """A declared predicate.

    types: of its arguments. is_exclusive: whether the last argument has one value for the others.
    """

    types: tuple[str, ...]
    is_exclusive: bool
    at: Place


class WeightedFormula(NamedTuple):
    """A formula and its weight, None if it is hard."""

    formula: Formula
    weight: float | None
    at: Place


@dataclass(eq=False)
class MarkovLogic:
    """A Markov logic network.

    domains: type -> its constants. predicates: name -> declaration.
    """

    domains: dict[str, list[str]] = field(default_factory=dict)
    predicates: dict[str, Predicate] = field(default_factory=dict)
    formulas: list[WeightedFormula] = field(default_factory=list)

    def add_constant(self, kind: str, name: str) -> None:
        """Add a constant to the domain of a type."""
        own = self.domains.setdefault(kind, [])
        if name not in own:
            own.append(name)

    def find_predicate(self, name: str, at: Place, n_arguments: int | None = None) -> Predicate:
        """Find the declaration of a predicate with a number of arguments.

        Raises:
            SourceIssue: there is none, or it has another number.
        """
        predicate = self.predicates.get(name)
        if predicate is None:
            known = (
                expected_one_of(list(self.predicates)) if self.predicates else "expected a declaration before"
            )
            raise SourceIssue(at, f"{name} is not declared; {known}")
        if n_arguments not in (None, len(predicate.types)):
            raise SourceIssue(at, f"{name} has {n_arguments} arguments; expected {len(predicate.types)}")
        return predicate


def join(kind: str, at: Place, *parts: Formula) -> Formula:
    """Join formulas; one alone stays as it is."""
    return parts[0] if len(parts) == 1 else Formula(kind, at, parts=parts)


def negate(formula: Formula) -> Formula:
    """Negate a formula; two negations cancel."""
    return formula.parts[0] if formula.kind == "not" else Formula("not", formula.at, parts=(formula,))


def expand(formula: Formula) -> list[Formula]:
    """List the formulas that one with ``*`` stands for."""
    places: dict[Place, int] = {}  # an atom that ``<=>`` doubles has one place and one sign

    def find(own: Formula) -> None:
        if own.is_both:
            places.setdefault(own.at, len(places))
        for part in own.parts:
            find(part)

    def choose(own: Formula, signs: int) -> Formula:
        if own.is_both:
            plain = Formula(own.kind, own.at, own.name, own.arguments)
            return plain if signs >> places[own.at] & 1 else negate(plain)
        parts = tuple([choose(part, signs) for part in own.parts])
        if own.kind == "not":
            return negate(parts[0])
        return Formula(own.kind, own.at, own.name, own.arguments, parts, own.variables)

    find(formula)
    if len(places) > MAX_EXPANSIONS:
        raise SourceIssue(formula.at, f"{len(places)} atoms with '*'; expected at most {MAX_EXPANSIONS}")
    return [choose(formula, signs) for signs in range(2 ** len(places))]


def compute_share(weight: float) -> tuple[float, float]:
    """Compute the probabilities of an observation given that a formula holds and does not, by its weight."""
    return (1.0, exp(-weight)) if weight >= 0 else (exp(weight), 1.0)
