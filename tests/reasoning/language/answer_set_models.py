"""Random LPMLN programs, and their models by the definition: every interpretation is tested."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import exp
from random import Random


@dataclass(frozen=True)
class AnswerSetRule:
    """A rule; its weight is None if it is hard.

    heads: a disjunction; none for a constraint. body: of atoms.
    at_least: a number, and atoms of which so many are true at least; None without.
    """

    heads: tuple[str, ...]
    body: tuple[str, ...]
    negated: tuple[str, ...]
    weight: float | None = None
    is_choice: bool = False
    at_least: tuple[int, tuple[str, ...]] | None = None

    def holds(self, model: frozenset[str]) -> bool:
        """Whether the body is true."""
        return (
            model.issuperset(self.body)
            and model.isdisjoint(self.negated)
            and (self.at_least is None or len(model.intersection(self.at_least[1])) >= self.at_least[0])
        )

    def is_satisfied(self, model: frozenset[str]) -> bool:
        return self.is_choice or not self.holds(model) or not model.isdisjoint(self.heads)

    def write(self) -> str:
        """Write the rule in the syntax of plingo."""
        parts = [*self.body, *(f"not {atom}" for atom in self.negated)]
        if self.at_least is not None:
            parts.append(f"{self.at_least[0]} {{ {'; '.join(self.at_least[1])} }}")
        if self.weight is not None:
            parts.append(f'&weight("{self.weight!r}")')
        head = "; ".join(self.heads)
        if self.is_choice:
            head = f"{{ {head} }}"
        return f"{head} :- {', '.join(parts)}." if parts or not head else f"{head}."


def weigh_models(rules: Sequence[AnswerSetRule], atoms: Sequence[str]) -> dict[frozenset[str], float]:
    """Return model -> e^(sum of the weights of the rules that it satisfies).

    Models are the stable models of the rules that they satisfy, among them all hard ones. Source: Lee and
    Wang, KR 2016, definition 1.
    """
    weights: dict[frozenset[str], float] = {}
    for signs in product((False, True), repeat=len(atoms)):
        model = frozenset(atom for atom, sign in zip(atoms, signs, strict=True) if sign)
        if any(rule.weight is None and not rule.is_satisfied(model) for rule in rules):
            continue
        satisfied = [rule for rule in rules if rule.is_satisfied(model)]
        if is_stable(satisfied, model):
            weights[model] = exp(sum(rule.weight for rule in satisfied if rule.weight is not None))
    return weights


def is_stable(rules: Sequence[AnswerSetRule], model: frozenset[str]) -> bool:
    """Whether a model of rules is minimal for the reduct: no proper subset satisfies it."""
    reduct = []
    for rule in rules:
        if not model.isdisjoint(rule.negated):
            continue
        if rule.is_choice:
            reduct += [((atom,), rule) for atom in rule.heads if atom in model]
        else:
            reduct.append((rule.heads, rule))
    return not any(
        all(
            not (smaller.issuperset(rule.body) and _reaches(rule, smaller)) or not smaller.isdisjoint(heads)
            for heads, rule in reduct
        )
        for smaller in _iter_subsets(model)
    )


def _reaches(rule: AnswerSetRule, model: frozenset[str]) -> bool:
    return rule.at_least is None or len(model.intersection(rule.at_least[1])) >= rule.at_least[0]


def _iter_subsets(model: frozenset[str]) -> Iterator[frozenset[str]]:
    own = sorted(model)
    for signs in product((False, True), repeat=len(own)):
        if not all(signs):
            yield frozenset(atom for atom, sign in zip(own, signs, strict=True) if sign)


def make_random_rules(rng: Random, n_atoms: int) -> tuple[list[AnswerSetRule], list[str]]:
    """Make random rules, also soft ones and choices, and the atoms that they are about."""
    atoms = [*(f"p({number})" for number in range(1, n_atoms - 1)), "q", "r(x)"][:n_atoms]
    rules = []
    for _ in range(rng.randint(n_atoms, 2 * n_atoms)):
        body = tuple(rng.sample(atoms, rng.choice((0, 0, 1, 1, 2))))
        negated = tuple(rng.sample(atoms, rng.choice((0, 0, 1, 2))))
        weight = rng.choice((None, None, round(rng.uniform(-2, 2), 2), 1.0))
        counted = None
        if rng.random() < 0.15:
            counted = rng.randint(1, 2), tuple(rng.sample(atoms, min(3, len(atoms))))
        kind = rng.random()
        if kind < 0.1 and (body or negated or counted):
            rules.append(AnswerSetRule((), body, negated, weight, at_least=counted))
        elif kind < 0.4:
            heads = tuple(rng.sample(atoms, rng.choice((1, 1, 2))))
            rules.append(AnswerSetRule(heads, body, negated, None, True, counted))
        else:
            rules.append(AnswerSetRule((rng.choice(atoms),), body, negated, weight, at_least=counted))
    return rules, atoms
