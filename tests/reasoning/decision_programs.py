"""Random programs of DTProbLog, and their expected utilities by the definition: all worlds are listed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from random import Random


@dataclass(frozen=True)
class DecisionProgram:
    """Facts with probabilities, decisions, rules and utilities.

    rules: (head, body); a negated literal begins with ``\\+``. utilities: (literal, number).
    evidence: literals that are observed.
    """

    facts: Mapping[str, float]
    decisions: Sequence[str]
    rules: Sequence[tuple[str, tuple[str, ...]]]
    utilities: Sequence[tuple[str, float]]
    evidence: Sequence[str]

    def write(self) -> str:
        lines = [f"{p}::{atom}." for atom, p in self.facts.items()]
        lines += [f"?::{atom}." for atom in self.decisions]
        lines += [f"{head} :- {', '.join(body)}." for head, body in self.rules]
        lines += [f"utility({literal}, {number})." for literal, number in self.utilities]
        lines += [f"evidence({literal})." for literal in self.evidence]
        return "\n".join(lines)

    def compute_utility(self, decided: Mapping[str, bool]) -> float | None:
        """Compute the expected utility of decisions; None if the evidence is impossible."""
        total = mass = 0.0
        for signs in product((False, True), repeat=len(self.facts)):
            true = {atom for atom, sign in zip(self.facts, signs, strict=True) if sign}
            p = 1.0
            for (_, own), sign in zip(self.facts.items(), signs, strict=True):
                p *= own if sign else 1 - own
            true |= {atom for atom, taken in decided.items() if taken}
            for head, body in self.rules:  # in the order of their heads, so that bodies are complete
                if all(_holds(literal, true) for literal in body):
                    true.add(head)
            if all(_holds(literal, true) for literal in self.evidence):
                mass += p
                total += p * sum(number for literal, number in self.utilities if _holds(literal, true))
        return total / mass if mass else None


def _holds(literal: str, true: set[str]) -> bool:
    return literal[2:] not in true if literal.startswith("\\+") else literal in true


def make_decision_program(rng: Random) -> DecisionProgram:
    """Make a program with at most twelve atoms."""
    facts = {f"f{i}": rng.choice((0.1, 0.25, 0.5, 0.9)) for i in range(rng.randint(1, 4))}
    decisions = [f"d({i})" for i in range(rng.randint(1, 4))]
    known = [*facts, *decisions]
    rules = []
    for i in range(rng.randint(1, 4)):
        for _ in range(rng.randint(1, 3)):
            body = rng.sample(known, min(len(known), rng.randint(1, 3)))
            rules.append((f"h{i}", tuple(rng.choice(("", "", "\\+")) + atom for atom in body)))
        known.append(f"h{i}")
    literals = rng.sample(known, rng.randint(1, min(4, len(known))))
    utilities = [(rng.choice(("", "", "\\+")) + atom, rng.randint(-10, 10)) for atom in literals]
    evidence = [rng.choice(("", "\\+")) + known[-1]] if rng.random() < 0.3 else []
    return DecisionProgram(facts, decisions, rules, utilities, evidence)
