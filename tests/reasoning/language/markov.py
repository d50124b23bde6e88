"""Markov logic by definition: a world has the measure e to the sum of the weights of what holds in it."""

from __future__ import annotations

import random
from collections.abc import Iterator
from itertools import product
from math import exp

from lcorpp.reasoning.language.translation.markov_formulas import Formula, MarkovLogic, Variable

World = dict[tuple[str, tuple[str, ...]], bool]


def list_worlds(network: MarkovLogic) -> Iterator[tuple[World, float]]:
    """Yield each world with its measure."""
    choices: list[list[dict]] = []
    for name, predicate in network.predicates.items():
        *given, last = [network.domains[kind] for kind in predicate.types]
        if predicate.is_exclusive:
            for values in product(*given):
                choices.append([{(name, (*values, v)): v == own for v in last} for own in last])
        else:
            choices += [[{(name, values): False}, {(name, values): True}] for values in product(*given, last)]
    for chosen in product(*choices):
        world = {atom: truth for own in chosen for atom, truth in own.items()}
        total, is_possible = 0.0, True
        for formula, weight, _ in network.formulas:
            types = find_types(network, formula)
            free = sorted(list_free(formula))
            for values in product(*[network.domains[types[variable]] for variable in free]):
                holds = evaluate(network, formula, dict(zip(free, values, strict=True)), world)
                is_possible &= weight is not None or holds
                total += (weight or 0.0) * holds
        if is_possible:
            yield world, exp(total)


def find_types(network: MarkovLogic, formula: Formula) -> dict[str, str]:
    found: dict[str, str] = {}
    for part in formula.parts:
        found |= find_types(network, part)
    if formula.kind == "atom":
        types = network.predicates[formula.name].types
        found |= {a.name: t for a, t in zip(formula.arguments, types, strict=True) if isinstance(a, Variable)}
    return found


def list_free(formula: Formula) -> set[str]:
    own = {a.name for a in formula.arguments if isinstance(a, Variable)}
    return own.union(*map(list_free, formula.parts)) - set(formula.variables)


def evaluate(network: MarkovLogic, formula: Formula, values: dict[str, str], world: World) -> bool:
    names = tuple(values[a.name] if isinstance(a, Variable) else a.name for a in formula.arguments)
    parts = formula.parts
    if formula.kind == "atom":
        return world[formula.name, names]
    if formula.kind == "equal":
        return names[0] == names[1]
    if formula.kind == "not":
        return not evaluate(network, parts[0], values, world)
    if formula.kind == "exist":
        types = find_types(network, formula)
        ranges = [network.domains[types[variable]] for variable in formula.variables]
        bound = [dict(zip(formula.variables, own, strict=True)) for own in product(*ranges)]
        return any(evaluate(network, parts[0], values | own, world) for own in bound)
    combine = all if formula.kind == "and" else any
    return combine(evaluate(network, part, values, world) for part in parts)


def make_random_text(seed: int) -> str:
    """Write a random network with at most twelve ground atoms."""
    rng = random.Random(seed)
    names = ["A", "B", "C"][: rng.choice([1, 2, 2, 3])]
    predicates = [("P", 1, False), ("Q", 1, False)]
    if len(names) < 3:
        predicates += [("R", 2, False)] * (rng.random() < 0.7) + [("S", 1, True)] * (rng.random() < 0.5)
    lines = [f"thing = {{{', '.join(names)}}}", "colour = {Red, Blue}"]
    for name, n, is_exclusive in predicates:
        lines.append(f"{name}({', '.join(['thing'] * n + ['colour!'] * is_exclusive)})")

    def write_atom(variables: list[str]) -> str:
        name, n, is_exclusive = rng.choice(predicates)
        arguments = [rng.choice([*variables, names[0]]) for _ in range(n)]
        return f"{name}({', '.join([*arguments, *[rng.choice(['Red', 'Blue', 'c'])] * is_exclusive])})"

    def write(depth: int, variables: list[str]) -> str:
        kind = rng.random()
        if depth == 0 or kind < 0.25:
            equation = f"{variables[0]} {rng.choice(['=', '!='])} {variables[-1]}"
            return (
                equation if kind < 0.03 else rng.choice(["", "", "!", "", "!", "*"]) + write_atom(variables)
            )
        if kind < 0.8:
            sign = rng.choice(["^", "v", "=>", "<=>"])
            return f"({write(depth - 1, variables)}) {sign} ({write(depth - 1, variables)})"
        if kind < 0.9:
            return f"!({write(depth - 1, variables)})"
        inner = write(depth - 1, [*variables, "z"])
        return f"{rng.choice(['EXIST', 'FORALL'])} z (P(z) {rng.choice(['^', 'v'])} ({inner}))"

    for _ in range(rng.randint(1, 4)):
        variables = rng.choice([["x"], ["x", "y"]])
        anchored = f"({write(2, variables)}) ^ (Q(x) v !Q(x)) ^ (Q({variables[-1]}) v !Q({variables[-1]}))"
        lines.append(f"{anchored} ." if rng.random() < 0.1 else f"{rng.uniform(-2, 3):.2f} {anchored}")
    return "\n".join(lines)
