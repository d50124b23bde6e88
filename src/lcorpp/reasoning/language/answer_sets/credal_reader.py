"""Answer sets with probabilistic facts (PASTA, credal semantics): read as rules of clingo, and their choices.

    0.4::bird(1..2).          {lcorpp'fact(1,A)} :- A is bird(1..2).  bird(X) :- lcorpp'fact(1,bird(X)).
    0.2::a; 0.3::b.           an experiment with the values a, b and none
    query(fly(1)).            a query

A total choice of all of them may have several answer sets. Source: Cozman and Maua, "The joy of probabilistic
answer set programming", International Journal of Approximate Reasoning 125, 2020.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

from clingo.ast import AST, ASTType, parse_string

from lcorpp.reasoning.language.answer_sets.asp_grounding import ground_answer_sets
from lcorpp.reasoning.language.answer_sets.asp_translation import AnswerSetWriter
from lcorpp.reasoning.language.answer_sets.asp_weights import evaluate_number
from lcorpp.reasoning.language.answer_sets.plingo_reader import (
    HIDDEN,
    PREFIX,
    RewrittenProgram,
    check_letters,
    rewrite_plingo,
)
from lcorpp.reasoning.language.issues import Place, SourceIssue

_END = re.compile(r"(?<=[^.\d\s;])\.(?!\.)|(?<=\d)\.(?![.\d])")
"""The point after a statement: not that of an interval or a decimal number."""

_REFUSED = (
    (re.compile(r"^\s*abducible\s+[a-z]"), "an abducible atom (PASTA)"),
    (re.compile(r"^\s*decision\s+[a-z]"), "a decision with answer sets (PASTA)"),
    (re.compile(r"^\s*utility\s*\("), "a utility with answer sets"),
    (re.compile(r"^\s*map\s+[\d.]"), "a fact of a MAP query, 'map' (PASTA),"),
    (re.compile(r"^\s*\(.*\|.*\)\s*\["), "a conditional, (a | b)[0.6,1] (PASTA),"),
    (re.compile(r"^\s*optimizable\b"), "an optimizable fact (PASTA)"),
    (re.compile(r"^\s*\[.*\]\s*::"), "an interval as a probability (PASTA)"),
    (re.compile(r"^\s*[\d.]+\s*:-"), "a constraint with a probability (PASTA)"),
    (re.compile(r"^\s*[a-z]\w*\s*(?:\([^()]*\))?\s*:\s*[a-z]\w*\s*\("), "a density (PASTA)"),
    (re.compile(r"\b(?:above|below|between|outside)\s*\("), "a comparison with a density (PASTA)"),
    (re.compile(r"^\s*#program\s*\("), "#program of a learning problem (PASTA)"),
    (re.compile(r"^\s*evidence\s*\("), "evidence(a); expected a query with obs(a): it"),
    (re.compile(r"^\s*t\s*\(.*\)\s*::"), "a learnable probability, t(_)"),
    (re.compile(r"^\s*\?\s*::"), "a decision, ?::, with answer sets"),
)

_QUERY = re.compile(r"\s*query\s*\((.*)\)\s*\.\s*", re.DOTALL)

_HEAD = re.compile(r"\s*([\d.eE+*/() -]+?)\s*::\s*(.*)", re.DOTALL)


class CredalTranslation(NamedTuple):
    """A program whose choices are inputs.

    text, names: as of `translate_answer_sets`; in the text choices have equal probabilities.
    choices: the term of a choice -> its values with their probabilities.
    """

    text: str
    names: dict[str, str]
    choices: dict[str, dict[str, Fraction]]


def has_answer_sets(text: str) -> bool:
    """Whether a text has probabilistic facts and rules that ProbLog has not, or constructs of PASTA."""
    own = [pattern for pattern, words in _REFUSED if "PASTA" in words]
    if any(pattern.search(statement) for statement, _ in _split(text, "") for pattern in own):
        return True
    bare = HIDDEN.sub("", text)
    return "::" in bare and re.search(r"[{}#]", bare) is not None


def translate_credal(text: str, file: str) -> CredalTranslation:
    """Translate a program with probabilistic facts and rules of clingo.

    Raises:
        SourceIssue: a construct has no translation, or a probability depends on chance.
    """
    check_letters(text, file)
    program = RewrittenProgram()
    numbers: dict[int, list[Fraction]] = {}
    plain = []
    for statement, at in _split(text, file):
        for pattern, words in _REFUSED:
            if pattern.search(statement):
                raise SourceIssue(at, f"{words} is not translated")
        query = _QUERY.fullmatch(statement)
        if query is not None:
            _name_variables(query[1], at)
            program.add(at, f"{PREFIX}query({len(program.lines)},{query[1]}).")
        elif "::" in HIDDEN.sub("", statement):
            numbers[len(numbers) + 1] = _add_choice(program, len(numbers) + 1, statement, at)
        else:
            plain.append(statement.replace("\\+", " not "))
            continue
        plain.append(re.sub(r"[^\n]", " ", statement))
    rewritten = rewrite_plingo("".join(plain), file, program)
    writer = AnswerSetWriter(rewritten, ground_answer_sets(rewritten.lines, rewritten.places))
    written, names = writer.write()
    choices = {}
    for index, values, term in writer.list_choices():
        own = numbers[index]
        rest = [1 - sum(own, Fraction(0))] * (len(values) - len(own))
        choices[term] = dict(zip(values, [*own, *rest], strict=True))
    return CredalTranslation(written, names, choices)


def _split(text: str, file: str) -> Iterator[tuple[str, Place]]:
    """Split a text into statements with their places; comments are blank."""
    hidden = HIDDEN.sub(lambda m: re.sub(r"[^\n]", " ", m[0]) if m[0][0] == "%" else m[0], text)
    bare = HIDDEN.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), text)
    begin = 0
    for match in [*_END.finditer(bare), None]:
        end = len(text) if match is None else match.end()
        statement = hidden[begin:end]
        start = begin + len(statement) - len(statement.lstrip())
        if statement.strip():
            line = text.count("\n", 0, start) + 1
            yield statement, Place(file, line, start - (text.rfind("\n", 0, start) + 1) + 1)
        elif match is None:
            yield statement, Place(file, 1, 1)
        begin = end


def _name_variables(head: str, at: Place) -> str:
    """Return an atom of the same predicate with a variable for each argument."""
    nodes: list[AST] = []
    try:
        parse_string(f"{head}.", nodes.append, logger=lambda *_: None)
        (symbol,) = [node.head.atom.symbol for node in nodes if node.ast_type == ASTType.Rule]
    except (RuntimeError, AttributeError, ValueError):
        raise SourceIssue(at, f"{head!r} is no atom") from None
    sign = ""
    if symbol.ast_type not in (ASTType.UnaryOperation, ASTType.Pool, ASTType.Function):
        raise SourceIssue(at, f"{head!r} is no atom")
    if symbol.ast_type == ASTType.UnaryOperation:
        sign, symbol = "-", symbol.argument
    if symbol.ast_type == ASTType.Pool:
        symbol = symbol.arguments[0]
    variables = ",".join([f"X{i}" for i in range(len(symbol.arguments))])
    return f"{sign}{symbol.name}({variables})" if variables else f"{sign}{symbol.name}"


def _add_choice(program: RewrittenProgram, index: int, statement: str, at: Place) -> list[Fraction]:
    """Add a probabilistic fact or an annotated disjunction; return the probabilities of its heads."""
    written, _, body = statement.strip().removesuffix(".").partition(":-")
    heads, numbers = list[str](), list[Fraction]()
    for part in written.split(";"):
        match = _HEAD.fullmatch(part)
        if match is None:
            raise SourceIssue(at, "a disjunction needs a probability for each head, or for none")
        try:
            numbers.append(evaluate_number(match[1]))
        except ValueError as error:
            raise SourceIssue(at, str(error)) from None
        if not 0 <= numbers[-1] <= 1:
            raise SourceIssue(at, f"the probability {match[1].strip()} is not between 0 and 1")
        heads.append(match[2].strip())
    if sum(numbers) > 1:
        raise SourceIssue(at, f"the probabilities sum to {float(sum(numbers)):g}; expected at most 1")
    condition = f" :- {body}" if body else ""
    if len(heads) == 1:
        fact = f"{PREFIX}fact({index},A)"
        atoms = f"{PREFIX}atom({index},{heads[0]}){condition}."
        program.add(at, atoms, f"{{ {fact} }} :- {PREFIX}atom({index},A).")
        derived = _name_variables(heads[0], at)
        program.add(at, f"{derived} :- {PREFIX}fact({index},{derived}).")
        return numbers
    if body:
        raise SourceIssue(at, "an annotated disjunction with a body is not translated with answer sets")
    # a value is the number of a head, not the head itself, which other rules may derive
    for number, head in enumerate(heads, 1):
        _name_variables(head, at)
        program.add(at, f"{head} :- {PREFIX}value(choice({index}),{number}).")
    size = len(heads) + (sum(numbers) < 1)
    value = f"{PREFIX}value(choice({index}),1..{size})"
    program.add(at, f"{PREFIX}range(choice({index}),1..{size}). {{ {value} }}.")
    return numbers
