"""Name resolution: the terms, evidence and queries of users in the canonical names of a program."""

from __future__ import annotations

import reprlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import product
from math import prod
from numbers import Integral
from typing import TYPE_CHECKING

from lcorpp.errors import ParseError, ProgramError, TooLargeError, check_type, expected_one_of
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.parser import parse_query, parse_term
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Expression, Intervention, Literal, Observation, Query, Term
from lcorpp.reasoning.questions import QUERY_TERM, list_terms, name_joint

if TYPE_CHECKING:
    from lcorpp.values import Label, Likelihood

MAX_INPUTS = 100_000
"""Maximal number of terms of an attribute that is named without its arguments."""

MAX_RESOLVED = 10_000
"""The terms of at most this many names are cached for a program."""

MAX_WORLDS = 100_000
"""At most this many worlds are listed."""


def resolve_term(program: Program, name: str) -> Term:
    """Parse the name of a term, such as ``time`` or ``roll(d1)``.

    Raises:
        ProgramError: the program has no such term.
    """
    known = program.resolved_terms
    if not isinstance(name, str) or name not in known:
        term = Term(name) if program.has_term(name) else _resolve_names(program, (name,))[0]
        if len(known) >= MAX_RESOLVED:
            known.clear()
        known[name] = term
    return known[name]


def _resolve_names(program: Program, names: Sequence[str]) -> tuple[Term, ...]:
    terms = []
    for name in names:
        if not isinstance(name, str):
            raise ProgramError(f"expected the name of an attribute, not {name!r}")
        try:
            term = Term(name) if program.has_term(name) else parse_term(name, "<term>", program.quoted_names)
            if not isinstance(term, Term):
                raise ProgramError(
                    f"{name!r} is not an attribute; {expected_one_of(list(program.attributes))}"
                )
            terms.append(term)
            query = program.resolve_query(Query(subjects=tuple(terms)))
        except (ParseError, SourceIssue) as error:
            raise ProgramError(f"{name!r}: {error.message}") from None
    return query.subjects


def resolve_inputs(program: Program, inputs: Iterable[str]) -> list[str]:
    """List the terms that evidence may name, each once; an attribute without its arguments is all its terms.

    Raises:
        ProgramError: the program has no such term.
        TooLargeError: an attribute has more than `MAX_INPUTS` terms.
    """
    check_type(inputs, Iterable, "inputs", ProgramError)
    if isinstance(inputs, str):
        raise ProgramError(f"inputs is {inputs!r}; expected a sequence of terms, such as [{inputs!r}]")
    return list(dict.fromkeys(term for name in inputs for term in _list_terms(program, name)))


def _list_terms(program: Program, name: str) -> list[str]:
    attribute = program.attributes.get(name) if isinstance(name, str) else None
    if attribute is None or not attribute.arguments:
        return [canonical_text(resolve_term(program, name))]
    sorts = [program.signature.sorts[sort] for sort in attribute.arguments]
    count = prod(map(len, sorts))
    if count > MAX_INPUTS:
        raise TooLargeError(
            f"{program.file}: {name} has {count} terms; at most {MAX_INPUTS} can be inputs,"
            " so name those that are needed"
        )
    return [f"{name}({','.join(arguments)})" for arguments in product(*sorts)]


def resolve_subject(program: Program, attribute: str | Sequence[str]) -> str:
    """Return the canonical name of a queried term, or of the joint of several, see `questions`.

    Raises:
        ProgramError: the program has no such term, or one is named twice.
    """
    if isinstance(attribute, str) and not attribute.startswith(QUERY_TERM):
        return canonical_text(resolve_term(program, attribute))
    terms = list_terms(attribute) if isinstance(attribute, str) else []
    if terms and len(set(terms)) == len(terms) and all(map(program.has_term, terms)):
        return attribute  # type: ignore[return-value]  # a text
    if isinstance(attribute, str):
        query = _parse_query(program, attribute, attribute)
        if query != Query(subjects=query.subjects):
            raise ProgramError(f"{attribute!r}: expected names of attributes only, such as '?a, b'")
        return name_joint(query.subjects)
    if not isinstance(attribute, Sequence) or isinstance(attribute, bytes) or not attribute:
        raise ProgramError(f"expected the name of an attribute, not {attribute!r}")
    return name_joint(_resolve_names(program, attribute))


def resolve_queries(program: Program, query: str | Iterable[str | Sequence[str]]) -> tuple[str, ...]:
    """Return the canonical names of a question or several, see `resolve_subject`."""
    check_type(query, (str, Iterable), "query", ProgramError)
    return tuple(resolve_subject(program, name) for name in ([query] if isinstance(query, str) else query))


def name_value(value: object) -> object:
    """Return the name of a value given as an integer or a truth value: ``3`` for 3, ``true`` for True."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(int(value)) if isinstance(value, Integral) else value


def make_unknown_value_error(
    value: object, term: str, values: Collection[str], where: str = ""
) -> ProgramError:
    """Make the error for evidence that is not a value of a term; `where` is the beginning of the message."""
    hint = "; leave out what is not observed" if value is None else ""
    return ProgramError(
        f"{where}{reprlib.repr(value)} is not a value of {term}; {expected_one_of(values)}{hint}"
    )


def resolve_evidence(program: Program, evidence: Mapping[str, str]) -> dict[str, str]:
    """Return evidence with canonical names, term -> value; see `name_value`.

    Raises:
        ProgramError: a term or value is unknown, or a term has two values.
    """
    check_type(evidence, Mapping, "evidence", ProgramError)
    facts: dict[str, str] = {}
    for name, given in evidence.items():
        term = resolve_term(program, name)
        values = program.attributes[term.name].values
        value = name_value(given)
        if not isinstance(value, str) or value not in values:
            raise make_unknown_value_error(given, str(term), values)
        key = canonical_text(term)
        if facts.setdefault(key, value) != value:
            raise ProgramError(f"the evidence gives {name} two values, {facts[key]} and {value}")
    return facts


def resolve_labels(
    program: Program, evidence: Mapping[str, Label]
) -> tuple[dict[str, str], dict[str, Likelihood]]:
    """Return evidence with canonical names, split into values and likelihoods.

    Raises:
        ProgramError: as `resolve_evidence`, or a term has a likelihood and another condition.
    """
    check_type(evidence, Mapping, "evidence", ProgramError)
    if all(isinstance(value, str) for value in evidence.values()):
        return resolve_evidence(program, evidence), {}  # type: ignore[arg-type]
    from lcorpp.values import Likelihood  # imports numpy

    likelihoods: dict[str, Likelihood] = {}
    hard = {name: value for name, value in evidence.items() if not isinstance(value, Likelihood)}
    facts = resolve_evidence(program, hard)
    for name, value in evidence.items():
        if isinstance(value, Likelihood):
            term = canonical_text(resolve_term(program, name))
            if term in facts or term in likelihoods:
                raise ProgramError(f"the evidence gives {term} twice; expected a value or a likelihood")
            likelihoods[term] = value
    return facts, likelihoods


def resolve_interventions(program: Program, do: Mapping[str, str]) -> dict[str, str]:
    """Return interventions with canonical names, term -> value.

    Raises:
        ProgramError: as `resolve_evidence`, or a term has no random selection.
    """
    check_type(do, Mapping, "do", ProgramError)
    for name in do:
        if not program.is_random(resolve_term(program, name)):
            raise ProgramError(f"do({name}=...): {name} has no random selection in {program.file}")
    return resolve_evidence(program, do)


def resolve_query(program: Program, query: Query) -> Query:
    """Return a query with resolved names after checking it against the program.

    Raises:
        ProgramError: a name or value is unknown, or the query sets a term to two values.
    """
    check_type(query, Query, "query", ProgramError)
    try:
        query = program.resolve_query(query)
    except SourceIssue as issue:
        raise ProgramError(str(issue)) from None
    do: dict[str, str] = {}
    for item in query.interventions:
        term, value = canonical_text(item.term), canonical_text(item.value)
        if do.setdefault(term, value) != value:
            raise ProgramError(f"{item.at}: do({term}) sets two values, {do[term]} and {value}")
    return query


def make_query(program: Program, question: str, facts: Mapping[str, str], do: Mapping[str, str]) -> Query:
    """Make the query for a question, "" for none, with resolved evidence and interventions."""
    terms = {name: resolve_term(program, name) for name in (*facts, *do)}
    return Query(
        subjects=_resolve_names(program, list_terms(question)) if question else (),
        observations=tuple(
            [Observation(((Literal(terms[t], "=", parse_label(program, v)),),)) for t, v in facts.items()]
        ),
        interventions=tuple([Intervention(terms[t], parse_label(program, v)) for t, v in do.items()]),
    )


def parse_label(program: Program, value: str) -> Expression:
    """Parse a value of a program, given as its text."""
    return Term(value) if value in program.quoted_names else parse_term(value, "<value>")


def resolve_expectation(program: Program, expression: str) -> Query:
    """Return the query for the expectation of a number, such as `roll(d1)+roll(d2)`.

    Raises:
        ProgramError: the text is not an expression of attributes with integers as values.
    """
    check_type(expression, str, "expression", ProgramError)
    return _parse_query(program, f"E[{expression}\n]", expression)  # a comment ends before the bracket


def _parse_query(program: Program, text: str, given: str) -> Query:
    try:
        return parse_query(text, program)
    except ParseError as error:
        raise ProgramError(f"{given!r}: {error.message}") from None


def check_at_least(number: int, lowest: int, what: str) -> None:
    """Check an integer argument."""
    check_type(number, int, what, ProgramError)
    if number < lowest:
        raise ProgramError(f"{what} is {number}; expected at least {lowest}")


def check_count(count: int) -> None:
    """Check a number of worlds or values."""
    check_type(count, int, "count", ProgramError)
    if not 1 <= count <= MAX_WORLDS:
        raise ProgramError(f"expected 1 to {MAX_WORLDS} worlds, not {count}")


def check_rng(rng: object) -> None:
    """Check that an argument is a numpy random generator."""
    from numpy.random import Generator

    check_type(rng, Generator, "rng", ProgramError)
