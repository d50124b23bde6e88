"""ProbLog to P-log: each probabilistic choice becomes a random selection, each clause a rule.

`0.4::edge(a,b).` becomes `random(edge(a,b)). pr(edge(a,b)) = 0.4.` if only such clauses have the predicate.
In general the choice is an attribute of its own, with the variables of the clause as arguments, as ProbLog
chooses once for each instance. `0.3::p(X); 0.5::q(X) :- r(X,Y), s(Y).` at line 7, column 1, becomes, if r is
certain,

    random(choice'7_1(X,Y)) :- r(X,Y).
    pr(choice'7_1(X,Y)=1) = 0.3.  pr(choice'7_1(X,Y)=2) = 0.5.  pr(choice'7_1(X,Y)=0) = 0.2.
    p(X) :- r(X,Y), s(Y), choice'7_1(X,Y)=1.
    q(X) :- r(X,Y), s(Y), choice'7_1(X,Y)=2.

The selection does not depend on s, as s may depend on p; where s(Y) is false the choice has no effect.
Where ProbLog has a well-founded model with two values it is the only stable model. It refuses programs with a
ground cycle through a negation; here all stable models are possible worlds, as in P-log.

Source: Fierens et al., TPLP 15(3), 2015, section 3.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, product
from math import prod

from lcorpp.reasoning.language.arithmetic import evaluate_number, find_variables
from lcorpp.reasoning.language.expressions import is_bare_term, parse_literal, parse_sum, require_value
from lcorpp.reasoning.language.inference import Inference
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import END, Cursor
from lcorpp.reasoning.language.overloads import resolve_overloads
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    Body,
    BodyLiteral,
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
from lcorpp.reasoning.language.traversal import iter_expressions, list_literals

MAX_INSTANCES = 10_000
"""Maximal number of instances of a query with variables."""

_SIGNS = {"=<": "<=", "\\==": " !=", "\\=": "!=", "=\\=": " !=", "=:=": " ==", "\\+": "\\ "}
"""Signs of Prolog, and as many characters that P-log's lexer reads."""

_SIGN = re.compile("|".join(map(re.escape, sorted(_SIGNS, key=len, reverse=True))))  # longest first

_COMMENT = re.compile(r"%[^\r\n]*|/\*.*?\*/", re.DOTALL)

_RESERVED = {
    "attributes", "boolean", "do", "false", "mod", "not", "obs", "pr", "random", "sorts", "statements", "true"
}  # fmt: skip
"""Names that P-log reserves; a predicate gets an apostrophe, which ProbLog's names do not have."""

_UNSUPPORTED = {
    "[": "a list",
    "is": "the arithmetic of 'is'",
    "-": "an if-then or a negative atom",
    "!": "a cut",
    "'": "a quoted name",
    '"': "a string",
    ":-": "a directive",
    ";": "a disjunction in a body",
    "->": "if-then-else",
    "?": "a decision (DTProbLog)",
    "(": "a nested goal",
    ":": "a probability that is not a number",
}
"""Tokens at which reading stops, and the constructs of ProbLog that they begin."""


@dataclass(frozen=True)
class _Clause:
    """`p1::a1; p2::a2 :- body.`; a probability is None if it is not written."""

    heads: tuple[tuple[Fraction | None, Literal], ...]
    body: Body
    at: Place

    @property
    def is_random(self) -> bool:
        return self.heads[0][0] is not None

    @property
    def variables(self) -> set[str]:
        return find_variables(*iter_expressions([*(head for _, head in self.heads), *self.body]))


def translate_problog(cursor: Cursor) -> tuple[Statement, ...]:
    """Translate a ProbLog program, given by its text in the cursor.

    Raises:
        SourceIssue: the program has an error, or a construct without translation, which the message names.
    """
    text = _COMMENT.sub(lambda comment: re.sub(r"[^\r\n]", " ", comment.group()), cursor.text)
    reader = Cursor(_SIGN.sub(lambda sign: _SIGNS[sign.group()], text), cursor.file)
    clauses: list[_Clause] = []
    questions: list[Query | Observation] = []
    try:
        while reader.kind != END:
            reader.anonymous_count = 0
            if reader.word in ("query", "evidence") and reader.second_kind == "(":
                questions.append(_parse_question(reader))
            else:
                clauses.append(_parse_clause(reader))
    except SourceIssue:
        if construct := _UNSUPPORTED.get(reader.word):
            raise SourceIssue(reader.at, f"{construct} is not translated") from None
        raise
    uncertain = _find_uncertain(clauses, questions)
    plain = _find_plain(clauses, uncertain)
    statements = list(chain.from_iterable(_translate(clause, uncertain, plain) for clause in clauses))
    inference = Inference([*statements, *questions])
    inference.add_missing(Term("none"))  # of predicates that are always false
    instances = chain.from_iterable(_instantiate(question, inference) for question in questions)
    return tuple(resolve_overloads([*inference.declare([]), *statements, *instances]))


# reading


def _parse_clause(reader: Cursor) -> _Clause:
    at = reader.at
    heads = reader.parse_list(_parse_head, ";")
    body = reader.parse_list(_parse_condition) if reader.accept(":-") else ()
    reader.expect(".")
    given = [probability for probability, _ in heads if probability is not None]
    if len(given) < len(heads) and len(heads) > 1:
        raise SourceIssue(at, "a disjunction in a head without probabilities is not translated")
    if sum(given) > 1 or any(probability < 0 for probability in given):
        raise SourceIssue(at, f"the probabilities {', '.join(map(str, given))} are negative or exceed 1")
    _check_bindings(heads, body)
    return _Clause(tuple(heads), tuple(body), at)


def _check_bindings(heads: Iterable[tuple[Fraction | None, Literal]], body: Iterable[BodyLiteral]) -> None:
    """Check that an earlier positive goal binds each variable, so that the order of goals does not matter."""
    bound: set[str] = set()
    for part in (*body, *(replace(head, negated=True) for _, head in heads)):
        names = find_variables(*iter_expressions([part]))
        if isinstance(part, Literal) and not part.negated:
            bound |= names
        elif names - bound:
            name = min(names - bound).replace("_Any", "_")
            raise SourceIssue(part.at, f"the variable {name} must occur in a positive goal to the left")


def _parse_head(reader: Cursor) -> tuple[Fraction | None, Literal]:
    left = require_value(parse_sum(reader))
    if reader.kind != ":" or reader.second_kind != ":" or find_variables(left):
        return None, _make_atom(left)
    reader.take()
    reader.take()
    return evaluate_number(left, {}), _make_atom(require_value(parse_sum(reader)))


def _make_atom(expression: Expression) -> Literal:
    if not isinstance(expression, Term):
        raise SourceIssue(expression.at, f"expected an atom, not {expression}")
    for argument in expression.arguments:
        if isinstance(argument, Arithmetic) or (isinstance(argument, Term) and argument.arguments):
            raise SourceIssue(argument.at, f"the compound term {argument} is not translated")
    if expression.name in _RESERVED:
        expression = replace(expression, name=f"{expression.name}'")
    return Literal(expression, "=", Term("true", at=expression.at), at=expression.at)


def _parse_condition(reader: Cursor) -> BodyLiteral:
    at = reader.at
    if reader.accept("\\"):
        return replace(_make_atom(require_value(parse_sum(reader))), negated=True, at=at)
    literal = parse_literal(reader)
    if not isinstance(literal, Literal):
        return literal
    if not is_bare_term(literal):
        raise SourceIssue(at, f"the comparison {literal} of a constant; expected the variable on the left")
    return _make_atom(literal.term)


def _parse_question(reader: Cursor) -> Query | Observation:
    """Parse `query(atom).`, `evidence(atom).` or `evidence(atom, false).`"""
    at, kind = reader.at, reader.take()
    reader.expect("(")
    literal = _parse_condition(reader)
    if not isinstance(literal, Literal):
        raise SourceIssue(at, f"{kind}({literal}) is not translated")
    if kind == "evidence" and reader.accept(",") and not reader.accept("true"):
        if not reader.accept("false"):
            raise reader.make_unexpected_error()
        literal = replace(literal, negated=not literal.negated)
    reader.expect(")")
    reader.expect(".")
    return Query(((literal,),), at=at) if kind == "query" else Observation(((literal,),), at=at)


# translating


def _find_uncertain(clauses: Sequence[_Clause], questions: Iterable[Query | Observation]) -> set[str]:
    """Return the predicates that depend on chance; check that all predicates have clauses."""
    heads = [(clause, _predicate(head)) for clause in clauses for _, head in clause.heads]
    defined = {name for _, name in heads}
    asked = (literal for question in questions for literal in list_literals(question))
    for literal in chain(*(_literals(clause.body) for clause in clauses), asked):
        if _predicate(literal) not in defined:
            words = "has no clause; builtin and library predicates are not translated"
            raise SourceIssue(literal.at, f"{_predicate(literal)} {words}")
    users: dict[str, set[str]] = {}  # predicate -> the heads of clauses that use it
    for clause, name in heads:
        for part in _literals(clause.body):
            users.setdefault(_predicate(part), set()).add(name)
    reached = [name for clause, name in heads if clause.is_random]
    uncertain: set[str] = set()
    while reached:
        if (name := reached.pop()) not in uncertain:
            uncertain.add(name)
            reached.extend(users.get(name, ()))
    return uncertain


def _predicate(literal: Literal) -> str:
    return f"{literal.term.name}/{len(literal.term.arguments)}"


def _literals(body: Body) -> Iterator[Literal]:
    return (part for part in body if isinstance(part, Literal))


def _find_plain(clauses: Sequence[_Clause], uncertain: set[str]) -> set[str]:
    """Return the predicates whose atoms are themselves the choices, one for each atom."""
    by_name: dict[str, list[_Clause]] = {}
    for clause in clauses:
        for _, head in clause.heads:
            by_name.setdefault(_predicate(head), []).append(clause)
    plain = set()
    for name, group in by_name.items():
        terms = {clause.heads[0][1].term for clause in group}
        facts = len(terms) == len(group) and not any(clause.body for clause in group)
        certain = all(_predicate(part) not in uncertain for part in _literals(group[0].body))
        rule = len(group) == 1 and certain and group[0].variables <= find_variables(*terms)
        if (facts or rule) and all(clause.is_random and len(clause.heads) == 1 for clause in group):
            plain.add(name)
    return plain


def _translate(clause: _Clause, uncertain: set[str], plain: set[str]) -> Iterator[Statement]:
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
    variables = tuple(Variable(name, at=at) for name in sorted(clause.variables))
    choice = Term(f"choice'{at.line}_{at.column}", variables, at=at)
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
    (literal,) = list_literals(question)
    arguments = literal.term.arguments
    names = sorted(find_variables(*arguments))
    if not names:
        yield question
        return
    if isinstance(question, Observation):
        raise SourceIssue(question.at, f"evidence with the variable {names[0]} is not translated")
    positions = {e.name: index for index, e in enumerate(arguments) if isinstance(e, Variable)}
    attribute = (literal.term.name, len(arguments))
    members = [list(inference.get_uses(attribute, positions[name]).values()) for name in names]
    if (count := prod(map(len, members))) > MAX_INSTANCES:
        raise SourceIssue(question.at, f"the query has {count} instances; expected at most {MAX_INSTANCES}")
    for values in product(*members):
        chosen = dict(zip(names, values, strict=True))
        ground = tuple(chosen[e.name] if isinstance(e, Variable) else e for e in arguments)
        literals = (replace(literal, term=replace(literal.term, arguments=ground)),)
        yield Query((literals,), at=question.at)
