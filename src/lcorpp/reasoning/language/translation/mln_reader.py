"""Read Markov logic networks, in the syntax of Alchemy and pracmln, and files of evidence.

    person = {Anna, Bob}              a domain
    Smokes(person)                    a predicate
    Friends(person, person)
    1.5 Smokes(x) => Cancer(x)        a formula with its weight
    Friends(x, y) => Friends(y, x).   a hard formula

Names that begin with a small letter are variables in formulas, all others constants. A formula is about all
values of its free variables; each instance has the weight. ``!`` after a type in a declaration of a predicate
makes its values exclusive: ``Place(person, room!)`` has one room for each person. ``*`` before an atom of a
formula stands for two formulas, with the atom and with its negation.

Source: Richardson and Domingos, "Markov logic networks", Machine Learning 62, 2006; the manual of Alchemy.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from math import isfinite, log
from typing import NamedTuple

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.translation.markov_formulas import (
    Argument,
    Constant,
    Formula,
    MarkovLogic,
    Predicate,
    Variable,
    WeightedFormula,
    expand,
    join,
    negate,
)

MAX_WEIGHT = 600.0
"""Maximum absolute weight of a formula; a larger one is a hard formula."""

MAX_RANGE = 100_000
"""Maximum number of integers of a range of a domain."""

MAX_DEPTH = 60
"""Maximum nesting of a formula."""

_TOKEN = re.compile(
    r'(?P<space>\s+)|(?P<number>[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)|(?P<string>"[^"\n]*")'
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_'-]*)|(?P<sign><=>|=>|!=|\.\.\.|[-=^!(){},.*+?@#:])|(?P<other>.)"
)

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)

_CONTINUED = ("=>", "<=>", "^", "v", ",", "!", "=", "!=")
"""A line that ends with one of these goes on in the next."""

QUANTIFIERS = ("EXIST", "EXISTS", "FORALL")


class Token(NamedTuple):
    """A token: its kind, its text and its place."""

    kind: str
    text: str
    at: Place


class Fact(NamedTuple):
    """A literal of a file of evidence."""

    name: str
    arguments: tuple[str, ...]
    is_true: bool
    at: Place


def read_mln(text: str, file: str) -> MarkovLogic:
    """Read a network.

    Raises:
        SourceIssue: the text has an error, or a construct that is not translated, which is named.
    """
    network = MarkovLogic()
    for tokens in _list_statements(text, file):
        _Statement(tokens, network).read()
    return network


def read_facts(text: str, file: str) -> list[Fact]:
    """Read the literals of a file of evidence, ``Smokes(Anna)`` or ``!Smokes(Bob)``, one a line."""
    facts = []
    for tokens in _list_statements(text, file):
        statement = _Statement(tokens, MarkovLogic())
        is_true = not statement.accept("!")
        name = statement.expect_name("a predicate")
        statement.expect("(")
        arguments = [statement.read_constant()]
        while statement.accept(","):
            arguments.append(statement.read_constant())
        statement.expect(")")
        statement.expect_end()
        facts.append(Fact(name.text, tuple(arguments), is_true, name.at))
    return facts


def _list_statements(text: str, file: str) -> Iterator[list[Token]]:
    """Yield the tokens of each statement: a line, and those in which it goes on."""
    text = _COMMENT.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    tokens: list[Token] = []
    depth = 0
    for number, line in enumerate(text.split("\n"), 1):
        for match in _TOKEN.finditer(line.rstrip("\r")):
            at = Place(file, number, match.start() + 1)
            if match.lastgroup == "space":
                continue
            if match.lastgroup == "other":
                raise SourceIssue(at, f"unexpected {match[0]!r}; expected a formula of Markov logic")
            tokens.append(Token(match.lastgroup or "", match[0], at))
            depth += (match[0] in "({") - (match[0] in ")}")
        if tokens and depth <= 0 and tokens[-1].text not in _CONTINUED:
            yield tokens
            tokens, depth = [], 0
    if tokens:
        yield tokens


class _Statement:
    """Reads one statement."""

    def __init__(self, tokens: Sequence[Token], network: MarkovLogic) -> None:
        self._tokens, self._network, self._position = tokens, network, 0
        self._depth = 0

    @property
    def token(self) -> Token:
        """The next token; behind the last one a token without text."""
        if self._position < len(self._tokens):
            return self._tokens[self._position]
        last = self._tokens[-1]
        return Token("end", "", last.at._replace(column=last.at.column + len(last.text)))

    def accept(self, *texts: str) -> Token | None:
        """Take the next token if it is one of these."""
        token = self.token
        if token.kind == "end" or token.text not in texts:
            return None
        self._position += 1
        return token

    def expect(self, text: str) -> Token:
        """Take the next token, which must be this."""
        token = self.accept(text)
        if token is None:
            raise self._fail(f"expected {text!r}")
        return token

    def expect_name(self, what: str) -> Token:
        """Take the next token, which must be a name."""
        token = self.token
        if token.kind != "name":
            raise self._fail(f"expected {what}")
        self._position += 1
        return token

    def expect_end(self) -> None:
        """Check that the statement ends here."""
        if self.token.kind != "end":
            raise self._fail("expected the end of the line")

    def _fail(self, expected: str) -> SourceIssue:
        found = f"{self.token.text!r}" if self.token.text else "the end of the line"
        return SourceIssue(self.token.at, f"unexpected {found}; {expected}")

    def read(self) -> None:
        """Read the statement into the network."""
        first, second = self.token, self._tokens[1].text if len(self._tokens) > 1 else ""
        if first.text == "#":
            raise SourceIssue(first.at, "#include and other directives are not read; expected one file")
        is_name = first.kind == "name" and first.text not in QUANTIFIERS
        if is_name and second == "=" and self._tokens[2:3] and self._tokens[2].text == "{":
            self._read_domain()
        elif (
            is_name
            and second == "("
            and first.text not in self._network.predicates
            and self._is_declaration()
        ):
            self._read_declaration()
        else:
            self._read_weighted(first)

    def _is_declaration(self) -> bool:
        """Whether the statement is a single atom of small names, without weight or full stop."""
        inside = self._tokens[2:-1]
        return self._tokens[-1].text == ")" and all(
            token.text in (",", "!", "?", "*") or (token.kind == "name" and token.text[0].islower())
            for token in inside
        )

    def _read_domain(self) -> None:
        kind = self.expect_name("a type").text
        self.expect("=")
        self.expect("{")
        while True:
            if self.token.text == "..." and self._network.domains.get(kind):
                self._position += 1
                self.accept(",")
                first, last = self._network.domains[kind][-1], self.read_constant()
                is_range = all(re.fullmatch("[0-9]{1,9}", end) for end in (first, last))
                if not is_range or not int(first) < int(last) <= int(first) + MAX_RANGE:
                    raise self._fail(f"expected two integers around '...', not {first} and {last}")
                for number in range(int(first) + 1, int(last) + 1):
                    self._network.add_constant(kind, str(number))
            else:
                self._network.add_constant(kind, self.read_constant())
            if not self.accept(","):
                break
        self.expect("}")
        self.expect_end()

    def _read_declaration(self) -> None:
        name = self.expect_name("a predicate")
        self.expect("(")
        types: list[str] = []
        is_exclusive = False
        while True:
            if is_exclusive:
                raise self._fail("only the last argument of a predicate may have '!'; expected ')'")
            types.append(self.expect_name("a type").text)
            if self.accept("?"):
                raise SourceIssue(name.at, f"{name.text} has '?', at most one value, which is not translated")
            is_exclusive = self.accept("!") is not None or self.accept("*") is not None
            if not self.accept(","):
                break
        self.expect(")")
        self.expect_end()
        self._network.predicates[name.text] = Predicate(tuple(types), is_exclusive, name.at)

    def _read_weighted(self, first: Token) -> None:
        weight = self._read_weight()
        is_hard = self._tokens[-1].text == "."
        if weight is None and not is_hard:
            if first.kind == "name" and first.text not in QUANTIFIERS:
                self._network.find_predicate(first.text, first.at)
            raise SourceIssue(
                first.at, "a formula without weight; expected a number before it, or '.' after it"
            )
        formula = self._read_formula()
        if weight is not None and self.token.text == ".":
            raise self._fail("expected a weight or '.', not both")
        if is_hard:
            self.expect(".")
        self.expect_end()
        for own in expand(formula):
            self._network.formulas.append(WeightedFormula(own, weight, first.at))

    def _read_weight(self) -> float | None:
        """Read the weight before a formula: a number, or the logarithm of one."""
        start, token = self._position, self.token
        sign = -1.0 if self.accept("-") else 1.0
        if self.token.text in ("log", "ln", "logx") and self._tokens[self._position + 1 :][:1]:
            self._position += 1
            self.expect("(")
            number = self._read_number()
            self.expect(")")
            if number <= 0:
                raise SourceIssue(token.at, f"the logarithm of {number:g}; expected a positive number")
            weight = sign * log(number)
        elif self.token.kind == "number":
            weight = sign * self._read_number()
        elif self._position > start or self.token.text.lower() in ("nan", "inf", "infinity"):
            raise self._fail("expected a number as the weight")
        else:
            return None
        if not isfinite(weight) or abs(weight) > MAX_WEIGHT:
            raise SourceIssue(
                token.at,
                f"the weight {weight:g}; expected at most {MAX_WEIGHT:g}, or a hard formula with '.'",
            )
        return weight

    def _read_number(self) -> float:
        token = self.token
        if token.kind != "number":
            raise self._fail("expected a number")
        self._position += 1
        return float(token.text)

    def read_constant(self) -> str:
        """Read a constant."""
        token = self.token
        if token.kind == "string" and len(token.text) > 2:
            self._position += 1
            return token.text[1:-1]
        if token.kind in ("name", "number") and "." not in token.text:
            self._position += 1
            return token.text
        raise self._fail("expected a constant")

    # formulas, from the weakest connective to the strongest

    def _read_formula(self) -> Formula:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self._fail(f"a formula of more than {MAX_DEPTH} levels")
        left = self._read_implication()
        while sign := self.accept("<=>"):
            right = self._read_implication()
            both = join("and", sign.at, left, right)
            neither = join("and", sign.at, negate(left), negate(right))
            left = join("or", sign.at, both, neither)
        self._depth -= 1
        return left

    def _read_implication(self) -> Formula:
        parts = [self._read_disjunction()]
        signs = []
        while sign := self.accept("=>"):
            signs.append(sign)
            parts.append(self._read_disjunction())
        right = parts.pop()
        while signs:
            right = join("or", signs.pop().at, negate(parts.pop()), right)
        return right

    def _read_disjunction(self) -> Formula:
        parts = [self._read_conjunction()]
        while self.accept("v"):
            parts.append(self._read_conjunction())
        return join("or", parts[0].at, *parts)

    def _read_conjunction(self) -> Formula:
        parts = [self._read_unary()]
        while self.accept("^"):
            parts.append(self._read_unary())
        return join("and", parts[0].at, *parts)

    def _read_unary(self) -> Formula:
        token = self.token
        if self.accept("!"):
            self._depth += 1
            if self._depth > MAX_DEPTH:
                raise self._fail(f"a formula of more than {MAX_DEPTH} levels")
            inner = self._read_unary()
            self._depth -= 1
            return negate(inner)
        if self.accept("("):
            inner = self._read_formula()
            self.expect(")")
            return inner
        if quantifier := self.accept(*QUANTIFIERS):
            names = [self.expect_name("a variable").text]
            while self.accept(","):
                names.append(self.expect_name("a variable").text)
            inner = self._read_unary() if self.token.text == "(" else self._read_formula()
            bound = tuple(names)
            if quantifier.text == "FORALL":
                return negate(Formula("exist", token.at, parts=(negate(inner),), variables=bound))
            return Formula("exist", token.at, parts=(inner,), variables=bound)
        return self._read_atom()

    def _read_atom(self) -> Formula:
        is_both = self.accept("*") is not None
        if self.token.text == "+":
            raise self._fail("a weight for each constant, '+', is not translated; expected one weight")
        token = self.token
        if (
            token.kind == "name"
            and self._tokens[self._position + 1 :][:1]
            and self._tokens[self._position + 1].text == "("
        ):
            self._position += 1
            return self._read_arguments(token, is_both)
        left = self._read_argument()
        sign = self.accept("=", "!=")
        if sign is None or is_both:
            raise self._fail("expected '=' or '!=' between two terms, or a predicate with arguments")
        equation = Formula("equal", token.at, arguments=(left, self._read_argument()))
        return equation if sign.text == "=" else negate(equation)

    def _read_arguments(self, name: Token, is_both: bool) -> Formula:
        self._network.find_predicate(name.text, name.at)
        self.expect("(")
        arguments = [self._read_argument()]
        while self.accept(","):
            arguments.append(self._read_argument())
        self.expect(")")
        predicate = self._network.find_predicate(name.text, name.at, len(arguments))
        for argument, kind in zip(arguments, predicate.types, strict=True):
            if isinstance(argument, Constant):
                self._network.add_constant(kind, argument.name)
        return Formula("atom", name.at, name.text, tuple(arguments), is_both=is_both)

    def _read_argument(self) -> Argument:
        if self.token.text == "+":
            raise self._fail("a weight for each constant, '+', is not translated; expected one weight")
        token = self.token
        name = self.read_constant()
        if self.token.text == "(":
            raise SourceIssue(token.at, f"{name}(...) is a function, which is not translated")
        is_variable = token.kind == "name" and token.text[0].islower()
        return Variable(name) if is_variable else Constant(name)
