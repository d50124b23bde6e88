"""Programs of ProbLog with numbers to be learnt, `t(_)::a`, for `lcorpp fit`.

    t(_)::rain.  wet :- rain.       random(rain). pr(rain) = 0.5. wet :- rain. -wet :- not wet.

Atoms that rules derive are false where they are not derived, so that records may say so. Clauses with
variables share their number over all instances, as in ProbLog.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.sorts import BOOLEAN
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    Literal,
    Probability,
    Rule,
    Selection,
    Statement,
    Term,
    Variable,
)
from lcorpp.reasoning.language.translation.names import Translation
from lcorpp.reasoning.language.translation.problog_clauses import make_clauses
from lcorpp.reasoning.language.translation.problog_grounded import translate_instances
from lcorpp.reasoning.language.translation.problog_lifted import is_liftable, translate_clauses
from lcorpp.reasoning.language.translation.prolog_arithmetic import compute_probability
from lcorpp.reasoning.language.translation.prolog_reader import PrologReader, list_tokens
from lcorpp.reasoning.language.translation.prolog_terms import Compound, PrologTerm, PrologVariable, Real

_MARK = re.compile(r"\bt\s*\([^()]*\)\s*::")

START = 0.5
"""The number from which a search begins, without one in `t(_)`."""


class LearnableTranslation(NamedTuple):
    """A translated program.

    fixed: the lines of the clauses whose numbers are not learnt.
    """

    translation: Translation
    fixed: frozenset[int]


def has_learnable(text: str) -> bool:
    """Whether a text may be a program of ProbLog with numbers to be learnt."""
    return _MARK.search(text) is not None


def translate_learnable(text: str, file: str) -> LearnableTranslation:
    """Translate a program; its queries are left out.

    Raises:
        SourceIssue: the program has an error, or a construct without translation, which the message names.
    """
    terms = PrologReader(text, file, list_tokens(text)).read_clauses()
    learnt: set[tuple[int, int]] = set()
    statements = [(at, _rewrite(at, term, learnt)) for at, term in terms if not _is_query(term)]
    clauses = make_clauses(statements)
    translated = translate_clauses(clauses) if is_liftable(clauses) else translate_instances(clauses)
    numbers = [s for s in translated.statements if isinstance(s, Probability)]
    own = [s for s in numbers if (s.at.line, s.at.column) in learnt]
    seen: dict[tuple[int, int], Probability] = {}
    for atom in own:
        if seen.setdefault((atom.at.line, atom.at.column), atom) is not atom:
            words = "a learnable probability of a clause whose instances are computed is not translated"
            raise SourceIssue(atom.at, words)
    fixed = {s.at.line for s in numbers if (s.at.line, s.at.column) not in learnt}
    for atom in own:
        if atom.at.line in fixed:
            raise SourceIssue(atom.at, "a learnable clause needs a line of its own")
    every = (*translated.statements, *_iter_closures(translated.statements))
    return LearnableTranslation(Translation(every, translated.names), frozenset(fixed))


def replace_learnt(text: str, atoms: Sequence[Probability]) -> str:
    """Replace each `t(_)` by the number of the pr-atom of its clause."""
    lines = text.splitlines(keepends=True)
    for atom in sorted(atoms, key=lambda own: own.at.column, reverse=True):
        shown, start = lines[atom.at.line - 1], atom.at.column - 1
        lines[atom.at.line - 1] = shown[:start] + _MARK.sub(f"{atom.number}::", shown[start:], count=1)
    return "".join(lines)


def _is_query(term: PrologTerm) -> bool:
    head = term.arguments[0] if isinstance(term, Compound) and term.key == (":-", 2) else term
    return isinstance(head, Compound) and head.key == ("query", 1)


def _rewrite(at: Place, term: PrologTerm, learnt: set[tuple[int, int]]) -> PrologTerm:
    """Replace a learnable probability by the number from which the search begins, and note its place."""
    head, body = term, None
    if isinstance(term, Compound) and term.key in ((":-", 2), ("<-", 2)):
        head, body = term.arguments
    if not isinstance(head, Compound):
        return term
    if head.key == (";", 2) and _MARK.search(str(head)):
        raise SourceIssue(at, "a learnable probability in a disjunction is not translated")
    if head.key != ("::", 2) or not isinstance(head.arguments[0], Compound) or head.arguments[0].name != "t":
        return term
    parameter, atom = head.arguments
    assert isinstance(parameter, Compound)
    if len(parameter.arguments) != 1:
        raise SourceIssue(at, f"the learnable probability {parameter} is not translated; expected t(_)")
    start = parameter.arguments[0]
    number = Real(START) if isinstance(start, PrologVariable) else Real(float(compute_probability(start, at)))
    if not 0 < number < 1:
        raise SourceIssue(at, f"the search cannot begin from {parameter}; expected a number between 0 and 1")
    learnt.add((at.line, at.column))
    made = Compound("::", (number, atom), head.at)
    return made if body is None else Compound(":-", (made, body))


def _iter_closures(statements: Sequence[Statement]) -> Iterator[Rule]:
    """Iterate over rules by which the atoms that rules derive are false where they are not derived."""
    selected = {s.term.name for s in statements if isinstance(s, Selection)}
    derived = {s.head.term.name for s in statements if isinstance(s, Rule) and s.head is not None}
    for statement in statements:
        if not isinstance(statement, AttributeDeclaration) or statement.range != BOOLEAN:
            continue
        if statement.name in derived - selected:
            at = statement.at
            variables = tuple([Variable(f"V{i}", at=at) for i in range(len(statement.arguments))])
            term = Term(statement.name, variables, at=at)
            true = Literal(term, "=", Term("true", at=at), negated=True, at=at)
            yield Rule(Literal(term, "=", Term("false", at=at), at=at), (true,), at=at)
