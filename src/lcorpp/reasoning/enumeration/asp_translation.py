"""Translate the logical part of a program to answer set programming and solve it with clingo.

The translation follows tau(Pi) of Baral, Gelfond and Rushton (TPLP 9(1), 2009, section 3.1) and the general
axioms of Balai, Gelfond and Zhang (2019, section 3.1, 17 to 22), with one more atom for each pr-atom that
applies. clingo computes no probabilities. The atoms:

    s(sort,member)            the sorts
    h(term,value)             the term has the value
    rnd(k,label,I,term)       the body of selection k is true; I: the variables that its dynamic range reads
    sel(k,label,I,term)       ... and no intervention sets the term
    pos(k,I,term,value)       the value is in the dynamic range of this selection
    pr(j,label,I,term,value)  pr-atom j applies to this outcome
    drv(k,term)               rule k derives a value of a selected term (2018 only)
    cr(k,I)                   an instance of cr-rule k is used; clingo minimises their number

k and j are indexes of statements. Each statement is one line, so that clingo's messages give its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import clingo

from lcorpp.errors import ProgramError
from lcorpp.reasoning.enumeration.answer_set import AnswerSet
from lcorpp.reasoning.language.arithmetic import canonical_text, find_variables, iter_variables
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.safety import find_variable_sorts
from lcorpp.reasoning.language.signature import ArgumentSlot, Signature
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    BodyLiteral,
    ComparisonLiteral,
    CrRule,
    Expression,
    Intervention,
    Literal,
    Number,
    Observation,
    Probability,
    Rule,
    Selection,
    Term,
    Variable,
)
from lcorpp.reasoning.language.traversal import iter_expressions, list_expressions, list_variables


def enumerate_answer_sets(
    program: Program, do: Mapping[str, str], limit: int, observed: Sequence[Literal] = ()
) -> Iterator[AnswerSet]:
    """Enumerate the answer sets of the logical part of a program.

    With cr-rules these are the answer sets of the regular program with each of its abductive supports, the
    smallest sets of instances of cr-rules that make it consistent; duplicates are dropped.

    Args:
        do: interventions besides those in the program, term -> value.
        limit: the maximum number of answer sets.
        observed: literals that are observed, besides the observations in the program.

    Raises:
        ProgramError: there are more than `limit` answer sets, or clingo reports an undefined operation.

    Source: supports, Balai, Gelfond and Zhang, 2019, definitions 10 and 11 (by cardinality, as in plog 2.0).
    """
    lines, places = translate_program(program, do, observed)
    messages: list[str] = []
    options = ["--models=0", *(["--opt-mode=optN"] if program.has_cr_rules else [])]
    control: Any = clingo.Control(options, logger=lambda _, message: messages.append(message))
    control.add("base", [], "\n".join(lines))
    try:
        control.ground([("base", [])])
    except RuntimeError as error:
        raise ProgramError(_locate_message(messages or [str(error)], places, program)) from None
    if messages:
        raise ProgramError(_locate_message(messages, places, program))
    decoded: dict[Any, tuple[str, Any]] = {}
    known: set[object] = set()
    count = 0
    with control.solve(yield_=True) as models:
        for model in models:
            if program.has_cr_rules and not model.optimality_proven:
                continue
            count += 1
            if count > limit:
                raise ProgramError(
                    f"{program.file}: more than {limit} possible worlds; raise the limit to enumerate them"
                )
            symbols = model.symbols(shown=True)
            if program.has_cr_rules:  # two supports may have the same world
                key = frozenset(symbols)
                if key in known:
                    continue
                known.add(key)
            yield _read_answer_set(symbols, decoded)


def _read_answer_set(symbols: Iterable[Any], decoded: dict[Any, tuple[str, Any]]) -> AnswerSet:
    """Convert an answer set; `decoded` caches the atoms, as most of them are in many answer sets."""
    parts: dict[str, list[Any]] = {"h": [], "sel": [], "pos": [], "pr": [], "drv": []}
    for symbol in symbols:
        atom = decoded.get(symbol)
        if atom is None:
            atom = decoded[symbol] = (symbol.name, _decode_atom(symbol.name, symbol.arguments))
        parts[atom[0]].append(atom[1])
    return AnswerSet(
        dict(sorted(parts["h"])),
        tuple(sorted(parts["sel"])),
        frozenset(parts["pos"]),
        tuple(sorted(parts["pr"])),
        tuple(sorted(parts["drv"])),
    )


def _decode_atom(name: str, arguments: list[Any]) -> tuple[Any, ...]:
    if name == "h":
        return str(arguments[0]), str(arguments[1])
    rest = [str(argument) for argument in arguments[1:]]
    if name == "pr":
        return arguments[0].number, rest[0], tuple(map(str, arguments[2].arguments)), rest[2], rest[3]
    return (arguments[0].number, *rest)


def _locate_message(messages: list[str], places: Mapping[int, Place], program: Program) -> str:
    """Format the first message of clingo with the place of its statement."""
    head, _, rest = messages[0].partition(": ")
    number = head.split(":")[1] if head.count(":") else ""
    place = places.get(int(number)) if number.isdigit() else None
    text = " ".join((rest or head).split())
    return (
        f"{place or program.file}: cannot be grounded: {text.removeprefix('info: ').removeprefix('error: ')}"
    )


def translate_program(
    program: Program, do: Mapping[str, str], observed: Sequence[Literal] = ()
) -> tuple[list[str], dict[int, Place]]:
    """Translate a program: (lines of ASP text, line number -> place of the statement)."""
    signature, is_2018 = program.signature, program.semantics == "2018"
    lines = [
        "#defined h/2. #defined rnd/4. #defined sel/4. #defined pos/4. #defined pr/5. #defined do/1."
        " #defined selected/1. #defined drv/2.",
        "#show h/2. #show sel/4. #show pos/4. #show pr/5. #show drv/2.",
        "valued(T) :- h(T,_).  :- valued(T), #count { V : h(T,V) } > 1.",
        "sel(K,L,I,T) :- rnd(K,L,I,T), not do(T).  selected(T) :- sel(_,_,_,T).",
    ]
    for sort in signature.sorts:
        lines.append(" ".join(f"s({sort},{member})." for member in signature.sorts[sort]))
    places: dict[int, Place] = {}
    for index, statement in enumerate(program.statements):
        if isinstance(statement, Rule):
            added = _translate_rule(index, statement, signature, is_2018)
        elif isinstance(statement, Selection):
            added = _translate_selection(index, statement, signature, is_2018)
        elif isinstance(statement, CrRule):
            added = _translate_cr_rule(index, statement, signature, is_2018)
        elif isinstance(statement, Probability):
            added = _translate_probability(index, statement, signature)
        elif isinstance(statement, Observation):
            added = _translate_observation(f"r{index}", statement.literal, signature)
        elif isinstance(statement, Intervention):
            added = _translate_intervention(
                canonical_text(statement.term), canonical_text(statement.value), is_2018
            )
        else:
            continue
        lines.append(added)
        places[len(lines)] = statement.at
    lines.extend(_translate_intervention(term, value, is_2018) for term, value in do.items())
    lines.extend(
        _translate_observation(f"q{index}", literal, signature) for index, literal in enumerate(observed)
    )
    return lines, places


def _translate_observation(name: str, literal: Literal, signature: Signature) -> str:
    conditions = "; ".join(_translate_literal(literal, 0, signature))
    return f"observed({name}) :- {conditions}. :- not observed({name})."


def _translate_intervention(term: str, value: str, is_2018: bool) -> str:
    """Translate an intervention. 2009: the value is a fact. 2018: a selection of the term must select it."""
    if is_2018:
        return f"do({term}). :- rnd(_,_,_,{term}), not h({term},{value})."
    return f"do({term}). h({term},{value})."


def _translate_rule(index: int, rule: Rule, signature: Signature, is_2018: bool, used: str = "") -> str:
    head = f"h({_write_expression(rule.head.term)},{_write_expression(rule.head.value)})" if rule.head else ""
    conditions = used + _translate_body(
        rule.body, list(signature.iter_slots(rule)), list_expressions(rule), signature
    )
    text = f"{head} :- {conditions}."
    if is_2018 and rule.head and rule.head.term.name in signature.selections:
        term = _write_expression(rule.head.term)
        text += f" drv({index},{term}) :- {conditions}; selected({term})."
    return text


def _translate_cr_rule(index: int, rule: CrRule, signature: Signature, is_2018: bool) -> str:
    """Translate to the rule under one abducible per instance, and minimise the number of abducibles."""
    inner = rule.statement
    used = f"cr({index},{_write_tuple([Variable(name) for name in list_variables(inner)])})"
    guards = _translate_body((), list(signature.iter_slots(inner)), list_expressions(inner), signature)
    text = f"{{ {used} }} :- {guards}. #minimize {{ 1,{index},I : cr({index},I) }}. "
    if isinstance(inner, Rule):
        return text + _translate_rule(index, inner, signature, is_2018, f"{used}; ")
    return text + _translate_selection(index, inner, signature, is_2018, f"{used}; ")


def _translate_selection(
    index: int, selection: Selection, signature: Signature, is_2018: bool, used: str = ""
) -> str:
    term, label = (
        _write_expression(selection.term),
        _write_tuple(selection.label.arguments if selection.label else ()),
    )
    outer = list_expressions(selection)
    slots = list(signature.iter_slots(selection))
    chosen = selection.range
    inner = list(iter_expressions(chosen.condition)) if chosen else []
    shared = find_variables(*outer) & find_variables(*inner)
    instance = _write_tuple([Variable(name) for name in sorted(shared)])
    applies = f"rnd({index},{label},{instance},{term})"
    conditions = used + _translate_body(selection.body, slots, outer, signature)
    range_sort = signature.attributes[selection.term.name].range
    # 2009: an intervention removes selection and range; 2018: it only removes the probability
    text = f"{applies} :- {conditions}{'' if is_2018 else f'; not do({term})'}."
    text += f" {{ h(T,V) : s({range_sort},V) }} = 1 :- rnd({index},_,_,T)."
    if chosen:
        value = chosen.variable.name
        inside = _translate_body(
            chosen.condition,
            list(signature.iter_range_slots(selection)),
            [chosen.variable, *inner],
            signature,
        )
        text += f" pos({index},{instance},{term},{value}) :- {applies}; {inside}."
        text += f" :- rnd({index},_,I,T); h(T,V); not pos({index},I,T,V)."
    return text


def _translate_probability(index: int, atom: Probability, signature: Signature) -> str:
    term, label = _write_expression(atom.term), _write_tuple(atom.label.arguments if atom.label else ())
    instance = _write_tuple([Variable(name) for name in list_variables(atom)])
    conditions = _translate_body(
        atom.condition, list(signature.iter_slots(atom)), list_expressions(atom), signature
    )
    value = _write_expression(atom.value)
    return f"pr({index},{label},{instance},{term},{value}) :- {conditions}; selected({term})."


def _translate_body(
    body: Iterable[BodyLiteral],
    slots: list[ArgumentSlot],
    scope: list[Expression],
    signature: Signature,
) -> str:
    """Translate a body, with sort conditions for each variable and each computed argument or value."""
    used = [variable for expression in scope for variable in iter_variables(expression)]
    guards = [
        f"s({sort},{name})"
        for name, sorts in find_variable_sorts(slots, used, signature).items()
        for sort in sorts
    ]
    guards.extend(
        f"s({sort},{_write_expression(expression)})"
        for expression, sort in slots
        if not isinstance(expression, Variable) and any(iter_variables(expression))
    )
    parts = list(dict.fromkeys(guards))
    for number, literal in enumerate(body):
        if isinstance(literal, ComparisonLiteral):
            parts.append(
                f"{_write_expression(literal.left)} {literal.relation} {_write_expression(literal.right)}"
            )
        else:
            parts.extend(_translate_literal(literal, number, signature))
    return "; ".join(parts) or "#true"


def _translate_literal(literal: Literal, number: int, signature: Signature) -> list[str]:
    """Translate a literal. `a != v` needs a value of a: `not a != v` is true if a has none other than v."""
    negation = "not " if literal.negated else ""
    if signature.is_sort(literal):
        return [f"{negation}s({literal.term.name},{_write_expression(literal.term.arguments[0])})"]
    term, value = _write_expression(literal.term), _write_expression(literal.value)
    if literal.relation == "=":
        return [f"{negation}h({term},{value})"]
    fresh = f"_V{number}"
    if literal.negated:
        sort = signature.attributes[literal.term.name].range
        return [f"not h({term},{fresh}) : s({sort},{fresh}), {fresh} {literal.relation} {value}"]
    return [f"h({term},{fresh})", f"{fresh} {literal.relation} {value}"]


def _write_tuple(expressions: Iterable[Expression]) -> str:
    arguments = ",".join(map(_write_expression, expressions))
    return f"i({arguments})" if arguments else "i"


def _write_expression(expression: Expression) -> str:
    if isinstance(expression, Arithmetic):
        operator = "\\" if expression.operator == "mod" else expression.operator
        return f"({_write_expression(expression.left)}{operator}{_write_expression(expression.right)})"
    if isinstance(expression, Number) and expression.value < 0:
        return f"({expression})"
    if isinstance(expression, Term) and expression.arguments:
        return f"{expression.name}({','.join(map(_write_expression, expression.arguments))})"
    return str(expression)
