"""Path rules, transitive or symmetric: most of their instances are redundant.

    way(X,Z) :- way(X,Y), way(Y,Z), X != Z.
    way(X,Y) :- way(Y,X).
    way(X,Y) :- door(X,Y), open(X,Y).

derive the pairs of places with a path of doors between them. Each path is a step and a shorter path, so those
instances of the first rule suffice in which `way(X,Y)` is a step: the head of another rule, or its reverse.
Only these need to be reversed, too. For n places with few doors each there are n^2 such instances, not n^3.
The others derive nothing else in any world: each pair has a path that visits no place twice, so the guards
``X != Y``, ``Y != Z`` and ``X != Z`` exclude none of the instances for it.

Source: Zhang, Yu and Troy, "Necessary and sufficient conditions to linearize doubly recursive programs in
logic databases", ACM Transactions on Database Systems 15(3), 1990.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations, permutations
from typing import NamedTuple

from lcorpp.reasoning.language.arithmetic import canonical_text, find_variables
from lcorpp.reasoning.language.signature import Signature
from lcorpp.reasoning.language.syntax import ComparisonLiteral, Expression, Literal, Rule, Selection, Variable

Arguments = tuple[Expression, ...]
IndexedClause = tuple[int, Rule | Selection]


class PathRule(NamedTuple):
    """A transitive or symmetric rule.

    step: the arguments of the literal that needs to be true for steps only.
    shape: the positions of the arguments that are the ends of a path, and the value of head and literals.
    """

    step: Arguments
    is_transitive: bool
    shape: tuple[int, int, Expression]


def stage_clauses(
    clauses: list[IndexedClause], signature: Signature
) -> tuple[dict[int, PathRule], list[list[IndexedClause]]]:
    """Find path rules of the same shape among the clauses of an attribute, and stage the clauses.

    There are none if the attribute is random.

    Returns:
        (paths, stages): index -> path rule; its steps are heads of the stages before its own.
    """
    rules = [(index, clause) for index, clause in clauses if isinstance(clause, Rule)]
    found = {i: path for i, rule in rules if rule.body and (path := match_path_rule(rule, signature))}
    if not found or len(rules) < len(clauses):
        return {}, [clauses]  # condition 1 concerns each instance of a rule for a random term
    shape = next(iter(found.values())).shape
    paths = {index: path for index, path in found.items() if path.shape == shape}
    stages: list[list[IndexedClause]] = [[], [], [], []]  # steps, symmetric, transitive, other values
    for index, rule in rules:
        path = paths.get(index)
        values = [rule.head.value if rule.head else shape[-1], shape[-1]]
        is_other = len({canonical_text(value) for value in values if not find_variables(value)}) == 2
        stages[1 + path.is_transitive if path else 3 * is_other].append((index, rule))
    return paths, stages


def match_path_rule(rule: Rule, signature: Signature) -> PathRule | None:
    """Match a rule with the forms above; None if it has neither.

    Arguments besides the ends may be arbitrary expressions, and so the value, but the same in head and body.
    """
    literals = [x for x in rule.body if isinstance(x, Literal)]
    head = rule.head
    if not head or not 1 <= len(literals) <= 2:
        return None
    same = head.term.name, "=", head.value, False
    if any((x.term.name, x.relation, x.value, x.negated) != same for x in literals):
        return None
    arguments, sorts = head.term.arguments, signature.attributes[head.term.name].arguments
    guards = [x for x in rule.body if isinstance(x, ComparisonLiteral)]
    for first, last in combinations(range(len(arguments)), 2):
        others = [x for i, x in enumerate(arguments) if i not in (first, last)]
        for step, *rest in permutations([x.term.arguments for x in literals]):
            middle = step[last]
            if rest:
                expected = [_replace(arguments, {last: middle}), _replace(arguments, {first: middle})]
            else:
                expected = [_replace(arguments, {first: arguments[last], last: arguments[first]})]
            places = {arguments[first], middle, arguments[last]}
            names = {x.name for x in places if isinstance(x, Variable)}
            if (
                [step, *rest] == expected
                and len(names) == len(literals) + 1
                and names.isdisjoint(find_variables(*others, head.value))
                and all(x.relation == "!=" and {str(x.left), str(x.right)} <= names for x in guards)
                # a path may visit all places that the arguments admit
                and sorts[first] == sorts[last]
                and all(signature.domains.get(name, sorts[first]) == sorts[first] for name in names)
            ):
                return PathRule(step, bool(rest), (first, last, head.value))
    return None


def _replace(arguments: Arguments, changes: Mapping[int, Expression]) -> Arguments:
    return tuple([changes.get(i, argument) for i, argument in enumerate(arguments)])
