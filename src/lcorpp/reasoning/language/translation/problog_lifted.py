"""ProbLog to P-log clause by clause: a probabilistic choice becomes a random selection, a clause a rule.

`0.4::edge(a,b).` becomes `random(edge(a,b)). pr(edge(a,b)) = 0.4.` if only such clauses have the predicate.
In general the choice is an attribute of its own, with the variables of the clause as arguments, as ProbLog
chooses once for each instance. `0.3::p(X); 0.5::q(X) :- r(X,Y), s(Y).` at line 7, column 1, becomes, if r is
certain,

    random(choice'7_1(X,Y)) :- r(X,Y).
    pr(choice'7_1(X,Y)=1) = 0.3.  pr(choice'7_1(X,Y)=2) = 0.5.  pr(choice'7_1(X,Y)=0) = 0.2.
    p(X) :- r(X,Y), s(Y), choice'7_1(X,Y)=1.
    q(X) :- r(X,Y), s(Y), choice'7_1(X,Y)=2.

The selection does not depend on s, as s may depend on p; where s(Y) is false the choice has no effect.
Where ProbLog has a well-founded model with two values it is the only stable model. A predicate that depends
on its own negation is left to `problog_grounded`, as ProbLog refuses atoms that do.

Source: Fierens et al., TPLP 15(3), 2015, section 3.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, product
from math import prod

from lcorpp.reasoning.language.arithmetic import MAX_INTEGER, find_variables
from lcorpp.reasoning.language.inference import Inference
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.overloads import resolve_overloads
from lcorpp.reasoning.language.syntax import (
    Body,
    ComparisonLiteral,
    Expression,
    Literal,
    Number,
    Observation,
    Probability,
    Query,
    Rule,
    Selection,
    Statement,
    Term,
    Variable,
)
from lcorpp.reasoning.language.translation.dependencies import find_dependents, has_negative_cycle
from lcorpp.reasoning.language.translation.names import (
    Translation,
    describe_choice,
    has_plain_letters,
    is_plain_name,
    make_choice_name,
)
from lcorpp.reasoning.language.translation.problog_clauses import Goal, PrologClause
from lcorpp.reasoning.language.translation.prolog_arithmetic import compute_probability
from lcorpp.reasoning.language.translation.prolog_terms import (
    Compound,
    PrologTerm,
    PrologVariable,
    Real,
    format_term,
    iter_term_variables,
)

MAX_INSTANCES = 10_000
"""Maximal number of instances of a query with variables."""

_COMPARISONS = {"=": "=", "==": "=", "\\=": "!=", "\\==": "!="}
"""Comparisons of terms, which mean the same in P-log if both sides are constants."""

_ASKED = (("query", 1), ("evidence", 1), ("evidence", 2))

_Predicate = tuple[str, int]


def is_liftable(clauses: Sequence[PrologClause]) -> bool:
    """Whether all clauses mean the same in P-log: constants and variables, without arithmetic."""
    defined = {head.key for clause in clauses for _, head in clause.heads}
    return all(_is_liftable(clause, defined) for clause in clauses) and not has_negative_cycle(clauses)


def _is_liftable(clause: PrologClause, defined: set[_Predicate]) -> bool:
    if len(clause.alternatives) != 1:
        return False
    (body,) = clause.alternatives
    if clause.heads[0][1].key in _ASKED:
        return not body and _is_liftable_question(clause.heads[0][1], defined)
    if not all(_is_liftable_goal(goal, defined) for goal in body):
        return False
    if not all(_is_flat(head) for _, head in clause.heads):
        return False
    given = [probability for probability, _ in clause.heads if probability is not None]
    if any(next(iter_term_variables(probability), None) for probability in given):
        return False
    if sum((compute_probability(probability, clause.at) for probability in given), Fraction(0)) > 1:
        return False
    # an earlier positive goal binds each variable, so that the order of goals does not matter
    bound: set[PrologVariable] = set()
    for term, binds in [
        *((goal.term, not goal.negated and goal.term.name not in _COMPARISONS) for goal in body),
        *((head, False) for _, head in clause.heads),
    ]:
        if binds:
            bound.update(iter_term_variables(term))
        elif not bound.issuperset(iter_term_variables(term)):
            return False
    return True


def _is_liftable_question(question: Compound, defined: set[_Predicate]) -> bool:
    atom = question.arguments[0]
    if isinstance(atom, Compound) and atom.key == ("\\+", 1):
        atom = atom.arguments[0]
    is_given = len(question.arguments) == 1 or str(question.arguments[1]) in ("true", "false")
    is_atom = isinstance(atom, Compound) and atom.key in defined and _is_flat(atom)
    return is_given and is_atom and (question.name == "query" or question.is_ground)


def _is_liftable_goal(goal: Goal, defined: set[_Predicate]) -> bool:
    if goal.term.name in _COMPARISONS and len(goal.term.arguments) == 2:
        sides = goal.term.arguments
        has_variable = any(isinstance(side, PrologVariable) for side in sides)
        return not goal.negated and has_variable and all(map(_is_simple, sides))
    return goal.term.key in defined and _is_flat(goal.term)


def _is_flat(atom: Compound) -> bool:
    return has_plain_letters(atom.name) and all(map(_is_simple, atom.arguments))


def _is_simple(term: PrologTerm) -> bool:
    if isinstance(term, Compound):
        return not term.arguments and is_plain_name(term.name)
    return isinstance(term, PrologVariable) or (not isinstance(term, Real) and abs(term) <= MAX_INTEGER)


# translating


@dataclass(frozen=True)
class _Clause:
    """A clause in the syntax of P-log; a probability is None if it is not written."""

    heads: tuple[tuple[Fraction | None, Literal], ...]
    body: Body
    variables: tuple[Variable, ...]
    at: Place

    @property
    def is_random(self) -> bool:
        return self.heads[0][0] is not None


def translate_clauses(clauses: Sequence[PrologClause]) -> Translation:
    """Translate the clauses of a program for which `is_liftable` is true.

    Raises:
        SourceIssue: a query has too many instances.
    """
    own = [_convert_clause(clause) for clause in clauses if clause.heads[0][1].key not in _ASKED]
    questions = [_convert_question(clause) for clause in clauses if clause.heads[0][1].key in _ASKED]
    uncertain = _find_uncertain(own)
    plain = _find_plain(own, uncertain)
    statements = list(chain.from_iterable(_translate(clause, uncertain, plain) for clause in own))
    inference = Inference([*statements, *questions])
    inference.add_missing(Term("none"))  # of predicates that are always false
    instances = chain.from_iterable(_instantiate(question, inference) for question in questions)
    names = {make_choice_name(clause.at): describe_choice(clause.at) for clause in own}
    predicates = {literal.term.name for clause in own for _, literal in clause.heads}
    names |= {name: name.rstrip("'") for name in predicates if name.endswith("'")}
    return Translation(tuple(resolve_overloads([*inference.declare([]), *statements, *instances])), names)


def _convert_clause(clause: PrologClause) -> _Clause:
    at = clause.at
    heads = [
        (None if probability is None else compute_probability(probability, at), _convert_atom(head))
        for probability, head in clause.heads
    ]
    body: list[Literal | ComparisonLiteral] = []
    for goal in clause.alternatives[0]:
        if goal.term.name in _COMPARISONS:
            left, right = (_convert(x, goal.at) for x in goal.term.arguments)
            if isinstance(left, Term):  # P-log expects the variable on the left
                left, right = right, left
            body.append(ComparisonLiteral(left, _COMPARISONS[goal.term.name], right, at=goal.at))
        else:
            body.append(replace(_convert_atom(goal.term), negated=goal.negated, at=goal.at))
    variables = tuple([_convert_variable(x, at) for x in clause.variables])
    return _Clause(tuple(heads), tuple(body), tuple(sorted(variables, key=str)), at)


def _convert_atom(atom: Compound) -> Literal:
    name = atom.name if is_plain_name(atom.name) else f"{atom.name}'"
    term = Term(name, tuple([_convert(x, atom.at) for x in atom.arguments]), at=atom.at)
    return Literal(term, "=", Term("true", at=atom.at), at=atom.at)


def _convert(term: PrologTerm, at: Place) -> Expression:
    if isinstance(term, PrologVariable):
        return _convert_variable(term, at)
    return Term(term.name, at=term.at) if isinstance(term, Compound) else Number(Fraction(term), at=at)


def _convert_variable(variable: PrologVariable, at: Place) -> Variable:
    name, apostrophe, number = variable.name.partition("'")
    if apostrophe:
        name = f"_Any{number}"
    return Variable(name if name.lstrip("_")[:1].isupper() else f"V'{name}", at=at)


def _convert_question(clause: PrologClause) -> Query | Observation:
    question = clause.heads[0][1]
    atom, negated = question.arguments[0], False
    assert isinstance(atom, Compound)
    written = format_term(atom)
    if atom.key == ("\\+", 1):
        atom, negated = atom.arguments[0], True
        assert isinstance(atom, Compound)
    if len(question.arguments) == 2 and str(question.arguments[1]) == "false":
        negated = not negated
    formula = ((replace(_convert_atom(atom), negated=negated),),)
    if question.name == "query":
        return Query(formula, written=written, at=atom.at)
    return Observation(formula, at=clause.at)


def _find_uncertain(clauses: Sequence[_Clause]) -> set[_Predicate]:
    """Return the predicates that depend on chance."""
    heads = [(clause, _predicate(head)) for clause in clauses for _, head in clause.heads]
    users: dict[_Predicate, set[_Predicate]] = {}  # predicate -> the heads of clauses that use it
    for clause, name in heads:
        for part in _literals(clause.body):
            users.setdefault(_predicate(part), set()).add(name)
    return find_dependents((name for clause, name in heads if clause.is_random), users)


def _predicate(literal: Literal) -> _Predicate:
    return literal.term.name, len(literal.term.arguments)


def _literals(body: Body) -> Iterator[Literal]:
    return (part for part in body if isinstance(part, Literal))


def _find_plain(clauses: Sequence[_Clause], uncertain: set[_Predicate]) -> set[_Predicate]:
    """Return the predicates whose atoms are themselves the choices, one for each atom."""
    by_name: dict[_Predicate, list[_Clause]] = {}
    for clause in clauses:
        for _, head in clause.heads:
            by_name.setdefault(_predicate(head), []).append(clause)
    plain = set()
    for name, group in by_name.items():
        terms = {clause.heads[0][1].term for clause in group}
        facts = len(terms) == len(group) and not any(clause.body for clause in group)
        certain = all(_predicate(part) not in uncertain for part in _literals(group[0].body))
        names = {variable.name for variable in group[0].variables}
        rule = len(group) == 1 and certain and names <= find_variables(*terms)
        if (facts or rule) and all(clause.is_random and len(clause.heads) == 1 for clause in group):
            plain.add(name)
    return plain


def _translate(clause: _Clause, uncertain: set[_Predicate], plain: set[_Predicate]) -> Iterator[Statement]:
    at, heads = clause.at, clause.heads
    if not clause.is_random:
        yield Rule(heads[0][1], clause.body, at=at)
        return
    numbers = [Number(probability or Fraction(0), at=at) for probability, _ in heads]
    term = heads[0][1].term
    if _predicate(heads[0][1]) in plain:
        yield Selection(term, None, clause.body, at=at)
        yield Probability(term, Term("true", at=at), numbers[0], at=at)
        return
    choice = Term(make_choice_name(at), clause.variables, at=at)
    parts = clause.body
    certain = [p for p in parts if not isinstance(p, Literal) or _predicate(p) not in uncertain]
    yield Selection(choice, None, tuple(certain), at=at)
    for index, number in enumerate(numbers, start=1):
        value = Number(Fraction(index), at=at)
        yield Probability(choice, value, number, at=at)
        yield Rule(heads[index - 1][1], (*parts, Literal(choice, "=", value, at=at)), at=at)
    rest = 1 - sum((number.value for number in numbers), Fraction(0))
    if rest:
        yield Probability(choice, Number(Fraction(0), at=at), Number(rest, at=at), at=at)


def _instantiate(question: Query | Observation, inference: Inference) -> Iterator[Query | Observation]:
    """Iterate over the instances of a query with variables."""
    ((literal,),) = question.formula
    arguments = literal.term.arguments
    names = sorted(find_variables(*arguments))
    if isinstance(question, Observation) or not names:
        yield question
        return
    positions = {e.name: index for index, e in enumerate(arguments) if isinstance(e, Variable)}
    attribute = (literal.term.name, len(arguments))
    members = [list(inference.get_uses(attribute, positions[name]).values()) for name in names]
    if (count := prod(map(len, members))) > MAX_INSTANCES:
        raise SourceIssue(question.at, f"the query has {count} instances; expected at most {MAX_INSTANCES}")
    predicate, sign = literal.term.name.rstrip("'"), "\\+" if literal.negated else ""
    for values in product(*members):
        chosen: Mapping[str, Expression] = dict(zip(names, values, strict=True))
        ground = tuple(chosen[e.name] if isinstance(e, Variable) else e for e in arguments)
        literals = (replace(literal, term=replace(literal.term, arguments=ground)),)
        yield Query((literals,), written=f"{sign}{Term(predicate, ground)}", at=question.at)
