"""Decision problems of ProbLog (DTProbLog) to P-log: decisions are random, utilities are attributes.

    ?::umbrella.                      0.5::decision'(umbrella).  umbrella :- decision'(umbrella).
    utility(broken, -40).             utility'1 :- broken.  -utility'1 :- not utility'1.

The instances on which they depend are translated as in `problog_grounded`. Given values of all decisions, the
others have the probabilities of ProbLog.

Source: Van den Broeck, Thon, van Otterlo and De Raedt, "DTProbLog: a decision-theoretic probabilistic
Prolog", AAAI 2010.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from math import isfinite
from typing import NamedTuple

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.overloads import resolve_overloads
from lcorpp.reasoning.language.sorts import BOOLEAN
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    Literal,
    Observation,
    Rule,
    Statement,
    Term,
)
from lcorpp.reasoning.language.translation.names import Translation
from lcorpp.reasoning.language.translation.problog_clauses import make_clauses
from lcorpp.reasoning.language.translation.problog_grounded import (
    InstanceWriter,
    list_asked,
    list_certain,
    read_literal,
)
from lcorpp.reasoning.language.translation.prolog_arithmetic import compute
from lcorpp.reasoning.language.translation.prolog_reader import PrologReader, list_tokens
from lcorpp.reasoning.language.translation.prolog_terms import (
    Compound,
    PrologTerm,
    PrologVariable,
    Real,
    format_atom,
    unquote,
)
from lcorpp.reasoning.language.translation.tables import GroundLiteral
from lcorpp.reasoning.language.translation.tabling import Evaluation

_MARK = re.compile(r"(?:^|[^\w)\]])\?\s*::|(?:^|\.)\s*(?:decision|utility)\s*\(", re.MULTILINE)

_DECISION, _UTILITY = "decision'", "utility'"


class Utility(NamedTuple):
    """What a strategy earns where a literal is true.

    term: the attribute of the translation. literal: as it is written. number: in units of utility.
    """

    term: str
    literal: str
    number: float


class TranslatedDecisions(NamedTuple):
    """A decision problem; decisions: an atom as it is written -> the term of the translation."""

    translation: Translation
    decisions: dict[str, str]
    utilities: tuple[Utility, ...]


def has_decisions(text: str) -> bool:
    """Whether a text may have decisions or utilities of ProbLog."""
    return _MARK.search(text) is not None


def translate_decisions(text: str, file: str) -> TranslatedDecisions:
    """Translate a decision problem.

    Raises:
        SourceIssue: the program has an error, or a construct without translation, which the message names.
    """
    statements = PrologReader(text, file, list_tokens(text)).read_clauses()
    clauses = make_clauses([own for at, term in statements for own in _rewrite(at, term)])
    evaluation = Evaluation(clauses)
    utilities, decided = list(_iter_utilities(evaluation)), list(_iter_decisions(evaluation))
    observed = [
        (GroundLiteral(evaluation.solve(atom, at), atom, negated), at)
        for atom, negated, at in list_asked(evaluation, "evidence")
    ]
    writer = InstanceWriter(evaluation, clauses)
    for literal, at in [*decided, *observed, *[(literal, at) for literal, _, at in utilities]]:
        writer.require(literal, at)
    written = [*writer.iter_statements()]
    for literal, at in observed:
        written.append(Observation(((writer.make_literal(literal, at),),), at=at))
    own = []
    for index, (literal, number, at) in enumerate(utilities, 1):
        name = f"{_UTILITY}{index}"
        written += _define(name, writer.make_literal(literal, at), at)
        shown = ("\\+" if literal.negated else "") + format_atom(literal.atom)
        own.append(Utility(name, shown, number))
    decisions = {}
    for literal, at in decided:
        atom = literal.atom.arguments[0]
        assert isinstance(atom, Compound)
        decisions[format_atom(atom)] = str(writer.make_literal(literal, at).term)
    names = {**writer.list_names(), **{each.term: f"[utility of {each.literal}]" for each in own}}
    every = tuple(resolve_overloads([*writer.declare(), *written]))
    return TranslatedDecisions(Translation(every, names), decisions, tuple(own))


def _iter_utilities(evaluation: Evaluation) -> Iterator[tuple[GroundLiteral, float, Place]]:
    """Iterate over the utilities: a literal, its number, and the place."""
    for answer in list_certain(evaluation, _UTILITY, 2):
        atom, negated, at = read_literal(answer, "utility")
        number = float(compute(answer.arguments[1], at))
        if not isfinite(number):
            raise SourceIssue(at, f"utility({atom}) is {number}; expected a finite number")
        if not atom.is_ground:
            raise SourceIssue(at, f"utility({atom}) with a variable is not translated")
        yield GroundLiteral(evaluation.solve(atom, at), atom, negated), number, at


def _iter_decisions(evaluation: Evaluation) -> Iterator[tuple[GroundLiteral, Place]]:
    """Iterate over the decisions: the atom of the choice, and the place.

    Raises:
        SourceIssue: whether there is a decision depends on chance.
    """
    if not evaluation.defines((_DECISION, 1)):
        return
    table = evaluation.solve(Compound(_DECISION, (PrologVariable("V0"),)), Place("", 1, 1))
    for answer in table.answers:
        derivations = list(table.derivations.get(answer, ()))
        if len(derivations) != 1 or derivations[0].literals or not answer.is_ground:
            at, atom = derivations[0].at if derivations else answer.at, answer.arguments[0]
            raise SourceIssue(at, f"the decision {atom} depends on chance, or is there twice")
        yield GroundLiteral(table, answer, False), derivations[0].at


def _define(name: str, literal: Literal, at: Place) -> Iterator[Statement]:
    """Define an attribute that is true where a literal is, and else false."""
    true, term = Term("true", at=at), Term(name, at=at)
    yield AttributeDeclaration(name, (), BOOLEAN, at=at)
    yield Rule(Literal(term, "=", true, at=at), (literal,), at=at)
    own = Literal(term, "=", true, negated=True, at=at)
    yield Rule(Literal(term, "=", Term("false", at=at), at=at), (own,), at=at)


def _rewrite(at: Place, term: PrologTerm) -> Sequence[tuple[Place, PrologTerm]]:
    """Rewrite a statement about decisions or utilities to statements of ProbLog."""
    head, body = term, None
    if isinstance(term, Compound) and term.key in ((":-", 2), ("<-", 2)):
        head, body = term.arguments
    if not isinstance(head, Compound):
        return [(at, term)]
    if head.key == ("utility", 2):
        return [(at, _make_clause(Compound(_UTILITY, head.arguments, head.at), body))]
    if head.key == (";", 2) and any(_find_decision(part) for part in head.arguments):
        raise SourceIssue(at, "a disjunction of decisions is not translated; expected a decision for each")
    decided = _find_decision(head)
    if decided is None:
        return [(at, term)]
    atom = Compound(unquote(decided.name), decided.arguments, decided.at)
    choice = Compound(_DECISION, (atom,), at)
    chosen = Compound("::", (Real(0.5), choice), at)
    if atom.is_ground:
        both: PrologTerm = choice if body is None else Compound(",", (choice, body), at)
        return [(at, chosen), (at, _make_clause(atom, both))]
    return [(at, _make_clause(chosen, body)), (at, _make_clause(atom, choice))]


def _find_decision(term: PrologTerm) -> Compound | None:
    """Return the atom of `?::a` or `decision(a)`."""
    if not isinstance(term, Compound):
        return None
    if term.key == ("::", 2) and term.arguments[0] == Compound("?"):
        term = term.arguments[1]
    elif term.key == ("decision", 1):
        term = term.arguments[0]
    else:
        return None
    return term if isinstance(term, Compound) else None


def _make_clause(head: PrologTerm, body: PrologTerm | None) -> PrologTerm:
    return head if body is None else Compound(":-", (head, body))
