"""The rules of a grounded program by their heads; sums and disjunctions become plain rules."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

from lcorpp.reasoning.language.answer_sets.asp_grounding import GroundAnswerSets, SumRule
from lcorpp.reasoning.language.issues import Place, SourceIssue

MAX_PARTS = 200_000
"""Maximum number of partial sums of all aggregates."""

Body = tuple[int, ...]
"""The literals of a body: atoms, negated if they are negative."""


class RuleTable:
    """The rules of a program.

    bodies: atom -> the bodies of its rules. choices: atom -> the bodies of its choices.
    constraints: bodies that are false in each answer set.

    Raises:
        SourceIssue: an aggregate is too large, or the heads of a disjunction depend on each other.
    """

    def __init__(self, ground: GroundAnswerSets, at: Place) -> None:
        self.bodies: dict[int, dict[Body, None]] = defaultdict(dict)
        self.choices: dict[int, dict[Body, None]] = defaultdict(dict)
        self.constraints: dict[Body, None] = {}
        self._symbols, self._at = ground.symbols, at
        self._next = max([*ground.symbols, *_iter_atoms(ground)], default=0) + 1
        self._add_rules(ground)

    def _add_rules(self, ground: GroundAnswerSets) -> None:
        disjunctions = list[tuple[Body, Body]]()
        for rule in ground.rules:
            body = tuple(sorted(set(rule.body)))
            if len(rule.heads) > 1 and not rule.is_choice:
                disjunctions.append((rule.heads, body))
            else:
                self._add_rule(rule.heads, body, is_choice=rule.is_choice)
        n_parts = 0
        for own in ground.sums:
            part, n_made = self._add_sum(own)
            n_parts += n_made
            if n_parts > MAX_PARTS:
                raise SourceIssue(self._at, f"the aggregates have more than {MAX_PARTS} partial sums")
            if len(own.heads) > 1 and not own.is_choice:
                disjunctions.append((own.heads, (part,)))
            else:
                self._add_rule(own.heads, (part,), is_choice=own.is_choice)
        needs: dict[int, set[int]] = defaultdict(set)  # head -> the positive literals of its bodies
        for head, bodies in (*self.bodies.items(), *self.choices.items()):
            needs[head].update(literal for body in bodies for literal in body if literal > 0)
        for heads, body in disjunctions:
            for head in heads:
                needs[head].update(literal for literal in body if literal > 0)
        for heads, body in disjunctions:
            self._shift(heads, body, needs)

    def _add_rule(self, heads: Sequence[int], body: Body, *, is_choice: bool) -> None:
        if any(-literal in body for literal in body):
            return
        if not heads:
            self.constraints[body] = None
        for head in heads:
            if not is_choice and head in body:
                continue
            (self.choices if is_choice else self.bodies)[head][body] = None

    def _add_sum(self, rule: SumRule) -> tuple[int, int]:
        """Add that a sum is large enough: atoms that the literals from the i-th on reach a bound.

        Returns:
            The atom of the whole sum, and the number of atoms.
        """
        made: dict[tuple[int, int], int] = {}
        waiting = [(0, rule.bound)]
        while waiting:
            index, bound = key = waiting.pop()
            if key in made:
                continue
            made[key] = self._next
            self._next += 1
            if bound > 0 and index < len(rule.literals):
                waiting += [(index + 1, bound), (index + 1, bound - rule.literals[index][1])]
            if len(made) > MAX_PARTS:
                raise SourceIssue(self._at, f"an aggregate has more than {MAX_PARTS} partial sums")
        for (index, bound), atom in made.items():
            if bound <= 0:
                self.bodies[atom][()] = None
            elif index < len(rule.literals):
                literal, weight = rule.literals[index]
                self.bodies[atom][made[index + 1, bound],] = None
                self.bodies[atom][tuple(sorted({literal, made[index + 1, bound - weight]}))] = None
        return made[0, rule.bound], len(made)

    def _shift(self, heads: Sequence[int], body: Body, needs: Mapping[int, set[int]]) -> None:
        """Replace a disjunction by rules, one for each head where the others are false.

        Raises:
            SourceIssue: two of its heads depend on each other.
        """
        reached = {head: _find_needed(head, needs) for head in heads}
        if any(a in reached[b] and b in reached[a] for a, b in combinations(heads, 2)):
            names = " ; ".join(str(self._symbols.get(own, "...")) for own in heads)
            raise SourceIssue(
                self._at, f"the heads of the disjunction {names} depend on each other; expected a choice"
            )
        for head in heads:
            others = {-other for other in heads if other != head}
            self._add_rule((head,), tuple(sorted({*body, *others})), is_choice=False)


def _find_needed(head: int, needs: Mapping[int, set[int]]) -> set[int]:
    """Find the atoms that an atom needs, through any rules."""
    reached, waiting = set[int](), [head]
    while waiting:
        new = needs.get(waiting.pop(), set()) - reached
        reached |= new
        waiting += new
    return reached


def _iter_atoms(ground: GroundAnswerSets) -> Iterable[int]:
    for rule in ground.rules:
        yield from rule.heads
        yield from map(abs, rule.body)
    for own in ground.sums:
        yield from own.heads
        yield from (abs(literal) for literal, _ in own.literals)
