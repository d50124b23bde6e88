"""Makes the syntax tree while the parser runs: one method for each rule of `grammar.lark`.

As a node is made as soon as its rule is complete, no text is nested too deep to read. Terms, values and
literals begin alike in the grammar; here they are told apart.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TypeVar

from lark import Token, Transformer, v_args

from lcorpp.reasoning.arithmetic import exact, ground, variables
from lcorpp.reasoning.offence import Offence
from lcorpp.reasoning.syntax import (
    Arithmetic,
    AttributeDeclaration,
    Body,
    Comparison,
    Domain,
    DynamicRange,
    Expression,
    Interval,
    Intervention,
    Literal,
    Number,
    Observation,
    Place,
    Probability,
    Query,
    Rule,
    Selection,
    SortDefinition,
    Statement,
    Term,
    Variable,
)

DEEPEST = 100
"""How deep an expression may be nested."""

LONGEST_NUMBER = 300
"""How many digits a number may have."""

Conditions = tuple[Observation | Intervention, ...]

_Nested = TypeVar("_Nested", Term, Arithmetic)


class _Minus:
    """`-p`: a false literal if it stands alone, nothing elsewhere."""

    def __init__(self, at: Place, term: Term) -> None:
        self.at, self.term = at, term


class _Sign:
    """A relation between two expressions, before it is known what they are."""

    def __init__(self, token: Token) -> None:
        self.text = {"==": "=", "<>": "!="}.get(str(token), str(token))


_OPPOSITE = {"=": "!=", "!=": "=", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}


@v_args(inline=True)
class Builder(Transformer[Token, object]):  # type: ignore[misc]  # lark is not followed by mypy
    """Makes a node of each rule of the grammar as soon as it is complete."""

    file = "<text>"

    def _at(self, token: Token) -> Place:
        return Place(self.file, token.line or 1, token.column or 1)

    # expressions

    def integer(self, token: Token) -> Number:
        return self._number(token)

    def decimal(self, token: Token) -> Number:
        return self._number(token)

    def _number(self, token: Token) -> Number:
        if len(token) > LONGEST_NUMBER:
            raise Offence(
                self._at(token), f"a number of {len(token)} digits; at most {LONGEST_NUMBER} are read"
            )
        return Number(Fraction(str(token)), at=self._at(token))

    def variable(self, token: Token) -> Variable:
        return Variable(str(token), at=self._at(token))

    def term(self, name: Token, arguments: tuple[Expression, ...] | None) -> Term:
        return self._bounded(Term(str(name), arguments or (), at=self._at(name)))

    def arguments(self, *arguments: object) -> tuple[Expression, ...]:
        return tuple(map(self.value, arguments))

    def arithmetic(self, left: object, operator: Token, right: object) -> Arithmetic:
        first = self.value(left)
        name = str(operator).replace("\\", "mod")
        return self._bounded(Arithmetic(name, first, self.value(right), at=first.at))

    def minus(self, sign: Token, operand: object) -> Expression | _Minus:
        if isinstance(operand, Term):
            return _Minus(self._at(sign), operand)
        inner = self.value(operand)
        if isinstance(inner, Number):
            return Number(-inner.value, at=self._at(sign))
        return self._bounded(
            Arithmetic("-", Number(Fraction(0), at=self._at(sign)), inner, at=self._at(sign))
        )

    def _bounded(self, node: _Nested) -> _Nested:
        if node.depth > DEEPEST:
            raise Offence(node.at, f"an expression nested deeper than {DEEPEST}")
        return node

    def value(self, expression: object) -> Expression:
        """The expression, which must not be a false literal."""
        if isinstance(expression, _Minus):
            raise Offence(expression.at, f"'-{expression.term}' is a literal; expected a value")
        assert isinstance(expression, Number | Variable | Term | Arithmetic)
        return expression

    # literals

    def relation(self, token: Token) -> _Sign:
        return _Sign(token)

    def literal(self, left: object, sign: _Sign | None, right: object) -> Literal | Comparison:
        if sign is None:
            if isinstance(left, _Minus):
                return Literal(left.term, "=", Term("false", at=left.at), at=left.at)
            if isinstance(left, Term):
                return Literal(left, "=", Term("true", at=left.at), at=left.at)
            first = self.value(left)
            raise Offence(first.at, f"expected a literal, not {first}")
        if isinstance(left, _Minus):
            raise Offence(left.at, f"'-' before a literal with a value; write {left.term}!=...")
        first, second = self.value(left), self.value(right)
        if isinstance(first, Term):
            return Literal(first, sign.text, second, at=first.at)
        return Comparison(first, sign.text, second, at=first.at)

    def body_literal(self, negation: Token | None, literal: Literal | Comparison) -> Literal | Comparison:
        if negation is None:
            return literal
        at = self._at(negation)
        if isinstance(literal, Literal):
            return Literal(literal.term, literal.relation, literal.value, True, at=at)
        return Comparison(literal.left, _OPPOSITE[literal.relation], literal.right, at=at)

    def body(self, *literals: Literal | Comparison) -> Body:
        return literals

    def _outcome(self, literal: Literal | Comparison, where: str) -> Literal:
        if isinstance(literal, Comparison) or literal.relation != "=":
            raise Offence(literal.at, f"expected attribute=value in {where}, not {literal}")
        return literal

    def _ordinary(self, literals: Body, where: str) -> tuple[Literal, ...]:
        for literal in literals:
            if isinstance(literal, Comparison):
                raise Offence(literal.at, f"expected a literal of an attribute in {where}, not {literal}")
        return tuple(literal for literal in literals if isinstance(literal, Literal))

    # declarations

    def section(self, _: Token) -> None:
        return None

    def element(self, low: object, high: object) -> Expression | Interval:
        first = self.value(low)
        if high is None:
            return first
        last = self.value(high)
        return Interval(int(_whole(first)), int(_whole(last)), at=first.at)

    def elements(self, *elements: Expression | Interval) -> tuple[Expression | Interval, ...]:
        return elements

    def sort(self, name: object, elements: tuple[Expression | Interval, ...]) -> SortDefinition:
        term = self._name(name, "a sort")
        return SortDefinition(term.name, elements, at=term.at)

    def hash_sort(
        self, sign: Token, name: Token, elements: tuple[Expression | Interval, ...]
    ) -> SortDefinition:
        return SortDefinition(str(name), elements, at=self._at(sign))

    def _name(self, expression: object, what: str) -> Term:
        if isinstance(expression, Term) and not expression.arguments:
            return expression
        assert isinstance(expression, Number | Variable | Term | Arithmetic | _Minus)
        raise Offence(expression.at, f"expected the name of {what}")

    def sort_name(self, _: Token | None, name: Token) -> str:
        return str(name)

    def sort_names(self, *names: str | Token) -> tuple[str, ...]:
        return tuple(name for name in names if not isinstance(name, Token))

    def attribute(self, name: object, sorts: tuple[str, ...], target: str | None) -> AttributeDeclaration:
        term = self._name(name, "an attribute")
        if target is None and len(sorts) > 1:
            raise Offence(term.at, f"attribute {term} has arguments but no range; expected '-> sort'")
        arguments, target = (sorts, target) if target is not None else ((), sorts[0])
        return AttributeDeclaration(term.name, arguments, target, at=term.at)

    def domain(self, sign: Token, sort: Token, *names: Token) -> Domain:
        return Domain(str(sort), tuple(map(str, names)), at=self._at(sign))

    # statements

    def label(self, expression: object) -> Term:
        term = self.value(expression)
        if not isinstance(term, Term):
            raise Offence(term.at, f"expected a label such as r or r(X), not {term}")
        return term

    def given_range(self, variable: Token, condition: Body) -> DynamicRange:
        return DynamicRange(self.variable(variable), condition, at=self._at(variable))

    def unary_range(self, name: Token) -> DynamicRange:
        at = self._at(name)
        variable = Variable("Chosen", at=at)
        chosen = Literal(Term(str(name), (variable,), at=at), "=", Term("true", at=at), at=at)
        return DynamicRange(variable, (chosen,), at=at)

    def selection(
        self, label: Term | None, sign: Token, term: object, chosen: DynamicRange | None, body: Body | None
    ) -> Selection:
        selected = self.value(term)
        if not isinstance(selected, Term):
            raise Offence(selected.at, f"expected an attribute, not {selected}")
        return Selection(selected, chosen, body or (), label, at=label.at if label else self._at(sign))

    def probability(
        self,
        label: Term | None,
        sign: Token,
        outcome: Literal | Comparison,
        condition: Body | None,
        number: object,
    ) -> Probability:
        literal = self._outcome(outcome, "a pr-atom")
        given = self.value(number)
        if not any(variables(given)):
            given = Number(exact(given, {}), at=given.at)
        at = label.at if label else self._at(sign)
        return Probability(literal.term, literal.value, given, condition or (), label, at=at)

    def rule(self, head: Literal | Comparison, body: Body | None) -> Rule:
        literal = self._outcome(head, "the head of a rule")
        return Rule(literal, body or (), at=literal.at)

    def constraint(self, sign: Token, body: Body) -> Rule:
        return Rule(None, body, at=self._at(sign))

    def observation(self, sign: Token, literal: Literal | Comparison) -> Observation:
        return Observation(self._ordinary((literal,), "obs()")[0], at=self._at(sign))

    def intervention(self, sign: Token, literal: Literal | Comparison, value: object) -> Intervention:
        set_to = self._outcome(literal, "do()")
        if value is not None and (set_to.value.at != set_to.term.at or set_to.at != set_to.term.at):
            raise Offence(
                set_to.at, f"expected do(attribute=value) or do(attribute, value), not do({set_to}, ...)"
            )
        chosen = set_to.value if value is None else self.value(value)
        return Intervention(set_to.term, chosen, at=self._at(sign))

    def conditions(self, *conditions: Observation | Intervention) -> Conditions:
        return conditions

    def braced_question(self, body: Body, conditions: Conditions | None) -> Query:
        return _query(self._ordinary(body, "a query"), None, conditions or ())

    def open_question(self, body: Body, conditions: Conditions | None) -> Query:
        literals = self._ordinary(body, "a query")
        first = literals[0]
        written = first.value.at != first.term.at  # the value of a bare literal stands where its term does
        if len(literals) == 1 and not first.negated and first.value == Term("true") and not written:
            return _query((), first.term, conditions or ())
        return _query(literals, None, conditions or ())

    def query(self, sign: Token, query: Query) -> Query:
        return Query(
            query.literals, query.subject, query.observations, query.interventions, at=self._at(sign)
        )

    def query_text(self, _: Token | None, query: Query) -> Query:
        return query

    def program(self, *statements: Statement | None) -> tuple[Statement, ...]:
        return tuple(statement for statement in statements if statement is not None)


def _whole(expression: Expression) -> str:
    if isinstance(expression, Term):
        raise Offence(expression.at, f"expected an integer, not {expression}")
    return ground(expression)


def _query(literals: tuple[Literal, ...], subject: Term | None, conditions: Conditions) -> Query:
    observations = tuple(c for c in conditions if isinstance(c, Observation))
    interventions = tuple(c for c in conditions if isinstance(c, Intervention))
    at = subject.at if subject else literals[0].at
    return Query(literals, subject, observations, interventions, at=at)
