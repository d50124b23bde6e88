"""Translate the logical part of a program to answer set programming.

The translation follows tau(Pi) of Baral, Gelfond and Rushton (TPLP 9(1), 2009, section 3.1) and the general
axioms of Balai, Gelfond and Zhang (2019, section 3.1, 17 to 22), with one more atom for each pr-atom that
applies. clingo computes no probabilities. The atoms:

    s(sort,member)            the sorts
    h(term,value)             the term has the value
    rnd(k,label,I,term)       the body of selection k is true; I: the variables that its dynamic range reads
    sel(k,label,I,term)       ... and no intervention sets the term
    pos(k,label,I,term,value) the value is in the dynamic range of this selection
    pr(j,label,I,term,value)  pr-atom j applies to this outcome
    drv(k,i,i,term)           rule k derives a value of a selected term (2018 only)
    cr(k,I)                   an instance of cr-rule k is used; clingo minimises their number

k and j are indexes of statements. Each statement is one line, so that clingo's messages give its place.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from lcorpp.reasoning.language.arithmetic import (
    canonical_text,
    find_variables,
    iter_variables,
    split_record,
)
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.safety import find_variable_sorts
from lcorpp.reasoning.language.signature import ArgumentSlot
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    BodyLiteral,
    ComparisonLiteral,
    Expression,
    Intervention,
    Literal,
    Number,
    Observation,
    Probability,
    Rule,
    Selection,
    Statement,
    Term,
    Variable,
)
from lcorpp.reasoning.language.traversal import iter_expressions, list_expressions, list_variables
from lcorpp.reasoning.quoting import is_quoted

_ENCODED = re.compile(r"\bq'([0-9a-f]+)(?![A-Za-z0-9_'])")
"""A name that is written in quotes, see `encode_name`."""


def translate_program(program: Program) -> tuple[list[str], dict[int, Place]]:
    """Translate the logical part of a program.

    Returns:
        (lines of ASP text, number of a line -> place of its statement).
    """
    translator = _Translator(program)
    lines = [
        "#defined h/2. #defined rnd/4. #defined sel/4. #defined pos/5. #defined pr/5. #defined do/1."
        " #defined selected/1. #defined drv/4. #defined observed/1.",
        "#show h/2. #show sel/4. #show pr/5. #show drv/4.",
        "#show pos(K,L,I,T,V) : pos(K,L,I,T,V), sel(K,L,I,T).",
        "valued(T) :- h(T,_).  :- valued(T), #count { V : h(T,V) } > 1.",
        "sel(K,L,I,T) :- rnd(K,L,I,T), not do(T).  selected(T) :- sel(_,_,_,T).",
    ]
    for sort, members in program.signature.sorts.items():
        lines.append(" ".join(f"s({sort},{_write_text(member)})." for member in members))
    places: dict[int, Place] = {}
    for index, statement in enumerate(program.statements):
        text = translator.translate_statement(index, statement)
        if text:
            lines.append(text)
            places[len(lines)] = statement.at
    return lines, places


class _Translator:
    """Translates the statements of a program."""

    def __init__(self, program: Program) -> None:
        self._program, self._signature = program, program.signature
        self._is_2018 = program.semantics == "2018"

    def translate_statement(self, index: int, statement: Statement) -> str:
        """Translate a statement; "" if it is a declaration or a query."""
        match statement:
            case Rule() | Selection():
                return self._translate_clause(index, statement)
            case Probability():
                return self._translate_probability(index, statement)
            case Observation():
                return self._translate_observation(index, statement)
            case Intervention(term=term, value=value):
                return self._translate_intervention(*map(_write_text, map(canonical_text, (term, value))))
        return ""

    def _translate_observation(self, index: int, observation: Observation) -> str:
        """Demand that one of the cases is true."""
        rules = [f":- not observed({index})."]
        for case in observation.formula:
            atoms = [atom for i, literal in enumerate(case) for atom in self._translate_literal(literal, i)]
            rules.append(f"observed({index}) :- {'; '.join(atoms)}.")
        return " ".join(rules)

    def _translate_intervention(self, term: str, value: str) -> str:
        """2009: the value is a fact. 2018: a selection of the term must select the value."""
        if self._is_2018:
            return f"do({term}). :- rnd(_,_,_,{term}), not h({term},{value})."
        return f"do({term}). h({term},{value})."

    def _translate_clause(self, index: int, clause: Rule | Selection) -> str:
        """Translate a cr-rule with one abducible per instance in its body, and minimise their number."""
        text = abducible = ""
        if clause.is_cr_rule:
            abducible = f"cr({index},{_write_variables(list_variables(clause))})"
            text = f"{{ {abducible} }} :- {self._translate_body(clause, ())}. "
            text += f"#minimize {{ 1,{index},I : cr({index},I) }}. "
            abducible += "; "
        if isinstance(clause, Rule):
            return text + self._translate_rule(index, clause, abducible)
        return text + self._translate_selection(index, clause, abducible)

    def _translate_rule(self, index: int, rule: Rule, abducible: str) -> str:
        conditions = abducible + self._translate_body(rule, rule.body)
        if rule.head is None:
            return f" :- {conditions}."
        term = _write_expression(rule.head.term)
        text = f"h({term},{_write_expression(rule.head.value)}) :- {conditions}."
        if self._is_2018 and rule.head.term.name in self._signature.selections:
            text += f" drv({index},i,i,{term}) :- {conditions}; selected({term})."
        return text

    def _translate_selection(self, index: int, selection: Selection, abducible: str) -> str:
        term = _write_expression(selection.term)
        label = _write_tuple(selection.label.arguments if selection.label else ())
        dynamic = selection.range
        conditions = list(iter_expressions(dynamic.condition)) if dynamic else []
        shared = find_variables(*list_expressions(selection)) & find_variables(*conditions)
        instance = _write_variables(sorted(shared))
        applies = f"rnd({index},{label},{instance},{term})"
        body = abducible + self._translate_body(selection, selection.body)
        range_sort = self._signature.attributes[selection.term.name].range
        # 2009: an intervention removes selection and range; 2018: it only removes the probability
        text = f"{applies} :- {body}{'' if self._is_2018 else f'; not do({term})'}."
        text += f" {{ h(T,V) : s({range_sort},V) }} = 1 :- rnd({index},_,_,T)."
        if dynamic:
            slots = self._signature.iter_range_slots(selection)
            inside = self._guard_body(dynamic.condition, list(slots), [dynamic.variable, *conditions])
            text += f" pos({index},{label},{instance},{term},{dynamic.variable.name}) :- {applies}; {inside}."
            text += f" :- rnd({index},L,I,T); h(T,V); not pos({index},L,I,T,V)."
        return text

    def _translate_probability(self, index: int, atom: Probability) -> str:
        term, label = _write_expression(atom.term), _write_tuple(atom.label.arguments if atom.label else ())
        instance = _write_variables(list_variables(atom))
        conditions, value = self._translate_body(atom, atom.body), _write_expression(atom.value)
        return f"pr({index},{label},{instance},{term},{value}) :- {conditions}; selected({term})."

    def _translate_body(self, statement: Rule | Selection | Probability, body: Iterable[BodyLiteral]) -> str:
        """Translate a body, with sort conditions for the variables and arguments of the whole statement."""
        return self._guard_body(
            body, list(self._signature.iter_slots(statement)), list_expressions(statement)
        )

    def _guard_body(
        self, body: Iterable[BodyLiteral], slots: list[ArgumentSlot], scope: list[Expression]
    ) -> str:
        """Translate a body, with sort conditions for each variable and each computed argument or value."""
        used = [variable for expression in scope for variable in iter_variables(expression)]
        guards = [
            f"s({sort},{name})"
            for name, sorts in find_variable_sorts(slots, used, self._signature).items()
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
                left, right = _write_expression(literal.left), _write_expression(literal.right)
                parts.append(f"{left} {literal.relation} {right}")
            else:
                parts.extend(self._translate_literal(literal, number))
        return "; ".join(parts) or "#true"

    def _translate_literal(self, literal: Literal, number: int) -> list[str]:
        """`a != v` needs a value of a; `not a != v` is true if a has none other than v."""
        negation = "not " if literal.negated else ""
        if self._signature.is_sort(literal):
            return [f"{negation}s({literal.term.name},{_write_expression(literal.term.arguments[0])})"]
        term, value = _write_expression(literal.term), _write_expression(literal.value)
        if literal.relation == "=":
            return [f"{negation}h({term},{value})"]
        fresh = f"_V{number}"
        if literal.negated:
            sort = self._signature.attributes[literal.term.name].range
            return [f"not h({term},{fresh}) : s({sort},{fresh}), {fresh} {literal.relation} {value}"]
        return [f"h({term},{fresh})", f"{fresh} {literal.relation} {value}"]


def _write_variables(names: Iterable[str]) -> str:
    return _write_tuple([Variable(name) for name in names])


def _write_tuple(expressions: Iterable[Expression]) -> str:
    arguments = ",".join(map(_write_expression, expressions))
    return f"i({arguments})" if arguments else "i"


def _write_expression(expression: Expression) -> str:
    if isinstance(expression, Arithmetic):
        operator = "\\" if expression.operator == "mod" else expression.operator
        return f"({_write_expression(expression.left)}{operator}{_write_expression(expression.right)})"
    if isinstance(expression, Number) and expression.value < 0:
        return f"({expression})"
    if isinstance(expression, Term):
        name, arguments = (
            encode_name(str(expression.name)),
            ",".join(map(_write_expression, expression.arguments)),
        )
        return f"{name}({arguments})" if arguments else name
    return str(expression)


def _write_text(text: str) -> str:
    """Write a term or value that is given by its text."""
    name, arguments = split_record(text)
    return f"{encode_name(name)}({','.join(map(_write_text, arguments))})" if arguments else encode_name(name)


def encode_name(text: str) -> str:
    """Return a name, given its text, in letters that ASP systems read; `decode_names` is the inverse."""
    return f"q'{text.encode().hex()}" if is_quoted(text) else text


def decode_names(text: str) -> str:
    """Decode the names in a text."""
    return _ENCODED.sub(lambda found: bytes.fromhex(found[1]).decode(), text) if "q'" in text else text
