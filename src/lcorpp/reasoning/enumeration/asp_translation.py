"""The logical part of a program, translated into answer set programming and solved by clingo.

The only module that imports clingo. The translation follows tau(Pi) of Baral, Gelfond and Rushton (TPLP 9(1),
2009, section 3.1) and the general axioms of Balai, Gelfond and Zhang (2019, section 3.1, 17 to 22), with one
more atom for each pr-atom that speaks; no probability goes through clingo.

    s(sort,member)            the sorts
    h(term,value)             the term has the value
    rnd(k,label,I,term)       the body of selection k is true, I being the values its dynamic range depends on
    sel(k,label,I,term)       it is, and the term is not intervened with
    pos(k,I,term,value)       the value is in the dynamic range of that selection
    pr(j,label,I,term,value)  pr-atom j speaks of this outcome
    drv(k,term)               rule k gives the term a value while it is selected (2018 only)
    cr(k,I)                   an instance of cr-rule k is used; as few as possible are

k and j are positions in the program. A statement goes onto one line, so that clingo's messages can be placed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import clingo

from lcorpp.errors import ProgramError
from lcorpp.reasoning.enumeration.answer_set import AnswerSet
from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.safety import variable_sorts
from lcorpp.reasoning.language.signature import Signature, Slot
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    Comparison,
    CrRule,
    Expression,
    Intervention,
    Literal,
    Number,
    Observation,
    Place,
    Probability,
    Rule,
    Selection,
    Term,
    Variable,
)
from lcorpp.reasoning.language.traversal import iter_expressions, list_expressions, list_pr_variables


def answer_sets(
    program: Program, do: Mapping[str, str], limit: int, observed: Sequence[Literal] = ()
) -> Iterator[AnswerSet]:
    """Enumerate the answer sets of the logical part of a program.

    With cr-rules these are the answer sets of the regular program together with any of its abductive
    supports, the smallest sets of instances of cr-rules that make it consistent; each is given once.

    Args:
        do: interventions beside those in the program, term -> value.
        limit: the most answer sets that are enumerated.
        observed: what is observed beside the observations in the program.

    Raises:
        ProgramError: there are more than `limit`, or clingo finds an operation undefined.

    Source: supports, Balai, Gelfond and Zhang, 2019, definitions 10 and 11 (by cardinality, as in plog 2.0).
    """
    lines, places = translation(program, do, observed)
    messages: list[str] = []
    options = ["--models=0", *(["--opt-mode=optN"] if program.has_cr_rules else [])]
    control: Any = clingo.Control(options, logger=lambda _, message: messages.append(message))
    control.add("base", [], "\n".join(lines))
    try:
        control.ground([("base", [])])
    except RuntimeError as error:
        raise ProgramError(_placed(messages or [str(error)], places, program)) from None
    if messages:
        raise ProgramError(_placed(messages, places, program))
    read: dict[Any, tuple[str, Any]] = {}
    seen: set[object] = set()
    count = 0
    with control.solve(yield_=True) as found:
        for model in found:
            if program.has_cr_rules and not model.optimality_proven:
                continue
            count += 1
            if count > limit:
                raise ProgramError(
                    f"{program.file}: more than {limit} possible worlds; raise the limit to enumerate them"
                )
            symbols = model.symbols(shown=True)
            if program.has_cr_rules:  # two supports may give the same world
                key = frozenset(symbols)
                if key in seen:
                    continue
                seen.add(key)
            yield _answer_set(symbols, read)


def _answer_set(symbols: Iterable[Any], read: dict[Any, tuple[str, Any]]) -> AnswerSet:
    """Read an answer set; `read` keeps what each atom means, as most atoms come in many answer sets."""
    parts: dict[str, list[Any]] = {"h": [], "sel": [], "pos": [], "pr": [], "drv": []}
    for symbol in symbols:
        known = read.get(symbol)
        if known is None:
            known = read[symbol] = (symbol.name, _decode(symbol.name, symbol.arguments))
        parts[known[0]].append(known[1])
    return AnswerSet(
        dict(sorted(parts["h"])),
        tuple(sorted(parts["sel"])),
        frozenset(parts["pos"]),
        tuple(sorted(parts["pr"])),
        tuple(sorted(parts["drv"])),
    )


def _decode(name: str, arguments: list[Any]) -> tuple[Any, ...]:
    if name == "h":
        return str(arguments[0]), str(arguments[1])
    rest = [str(argument) for argument in arguments[1:]]
    if name == "pr":
        return arguments[0].number, rest[0], tuple(map(str, arguments[2].arguments)), rest[2], rest[3]
    return (arguments[0].number, *rest)


def _placed(messages: list[str], places: Mapping[int, Place], program: Program) -> str:
    """The first message of clingo, at the statement it is about."""
    head, _, rest = messages[0].partition(": ")
    number = head.split(":")[1] if head.count(":") else ""
    place = places.get(int(number)) if number.isdigit() else None
    text = " ".join((rest or head).split())
    return (
        f"{place or program.file}: cannot be grounded: {text.removeprefix('info: ').removeprefix('error: ')}"
    )


def translation(
    program: Program, do: Mapping[str, str], observed: Sequence[Literal] = ()
) -> tuple[list[str], dict[int, Place]]:
    """The ASP text of a program, line by line, and the place of the statement each line is about."""
    signature, later = program.signature, program.semantics == "2018"
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
            added = _rule(index, statement, signature, later)
        elif isinstance(statement, Selection):
            added = _selection(index, statement, signature, later)
        elif isinstance(statement, CrRule):
            added = _cr_rule(index, statement, signature, later)
        elif isinstance(statement, Probability):
            added = _probability(index, statement, signature)
        elif isinstance(statement, Observation):
            added = _observation(f"r{index}", statement.literal, signature)
        elif isinstance(statement, Intervention):
            added = _intervention(canonical_text(statement.term), canonical_text(statement.value), later)
        else:
            continue
        lines.append(added)
        places[len(lines)] = statement.at
    lines.extend(_intervention(term, value, later) for term, value in do.items())
    lines.extend(_observation(f"q{index}", literal, signature) for index, literal in enumerate(observed))
    return lines, places


def _observation(name: str, literal: Literal, signature: Signature) -> str:
    held = "; ".join(_literal(literal, 0, signature))
    return f"observed({name}) :- {held}. :- not observed({name})."


def _intervention(term: str, value: str, later: bool) -> str:
    """2009: the value is a fact. 2018: it is what the selection must give, wherever there is one."""
    if later:
        return f"do({term}). :- rnd(_,_,_,{term}), not h({term},{value})."
    return f"do({term}). h({term},{value})."


def _rule(index: int, rule: Rule, signature: Signature, later: bool, used: str = "") -> str:
    head = f"h({_text(rule.head.term)},{_text(rule.head.value)})" if rule.head else ""
    conditions = used + _conditions(rule.body, list(signature.slots(rule)), list_expressions(rule), signature)
    text = f"{head} :- {conditions}."
    if later and rule.head and rule.head.term.name in signature.selections:
        term = _text(rule.head.term)
        text += f" drv({index},{term}) :- {conditions}; selected({term})."
    return text


def _cr_rule(index: int, rule: CrRule, signature: Signature, later: bool) -> str:
    """The rule under an assumption for each of its instances, and as few assumptions as possible."""
    inner = rule.statement
    names = sorted({variable.name for e in list_expressions(inner) for variable in iter_variables(e)})
    used = f"cr({index},{_tuple([Variable(name) for name in names])})"
    guards = _conditions((), list(signature.slots(inner)), list_expressions(inner), signature)
    text = f"{{ {used} }} :- {guards}. #minimize {{ 1,{index},I : cr({index},I) }}. "
    if isinstance(inner, Rule):
        return text + _rule(index, inner, signature, later, f"{used}; ")
    return text + _selection(index, inner, signature, later, f"{used}; ")


def _selection(index: int, selection: Selection, signature: Signature, later: bool, used: str = "") -> str:
    term, label = _text(selection.term), _tuple(selection.label.arguments if selection.label else ())
    outer = list_expressions(selection)
    slots = list(signature.slots(selection))
    chosen = selection.range
    inner = list(iter_expressions(chosen.condition)) if chosen else []
    shared = {variable.name for expression in outer for variable in iter_variables(expression)}
    told = {variable.name for expression in inner for variable in iter_variables(expression)}
    instance = _tuple([Variable(name) for name in sorted(told & shared)])
    applies = f"rnd({index},{label},{instance},{term})"
    conditions = used + _conditions(selection.body, slots, outer, signature)
    range_sort = signature.attributes[selection.term.name].range
    # 2009: an intervention removes selection and range; 2018: it only removes the probability
    text = f"{applies} :- {conditions}{'' if later else f'; not do({term})'}."
    text += f" {{ h(T,V) : s({range_sort},V) }} = 1 :- rnd({index},_,_,T)."
    if chosen:
        value = chosen.variable.name
        inside = _conditions(
            chosen.condition, list(signature.range_slots(selection)), [chosen.variable, *inner], signature
        )
        text += f" pos({index},{instance},{term},{value}) :- {applies}; {inside}."
        text += f" :- rnd({index},_,I,T); h(T,V); not pos({index},I,T,V)."
    return text


def _probability(index: int, atom: Probability, signature: Signature) -> str:
    term, label = _text(atom.term), _tuple(atom.label.arguments if atom.label else ())
    instance = _tuple([Variable(name) for name in list_pr_variables(atom)])
    conditions = _conditions(atom.condition, list(signature.slots(atom)), list_expressions(atom), signature)
    return f"pr({index},{label},{instance},{term},{_text(atom.value)}) :- {conditions}; selected({term})."


def _conditions(
    body: Iterable[Literal | Comparison], slots: list[Slot], scope: list[Expression], signature: Signature
) -> str:
    """A body in which every variable and every computed argument or value is held to its sort."""
    used = [variable for expression in scope for variable in iter_variables(expression)]
    guards = [
        f"s({sort},{name})"
        for name, sorts in variable_sorts(slots, used, signature).items()
        for sort in sorts
    ]
    guards.extend(
        f"s({sort},{_text(expression)})"
        for expression, sort in slots
        if not isinstance(expression, Variable) and any(iter_variables(expression))
    )
    parts = list(dict.fromkeys(guards))
    for number, literal in enumerate(body):
        if isinstance(literal, Comparison):
            parts.append(f"{_text(literal.left)} {literal.relation} {_text(literal.right)}")
        else:
            parts.extend(_literal(literal, number, signature))
    return "; ".join(parts) or "#true"


def _literal(literal: Literal, number: int, signature: Signature) -> list[str]:
    """A literal; `a != v` needs a value of a, so `not a != v` says that a has no value but v."""
    negation = "not " if literal.negated else ""
    if signature.is_sort(literal):
        return [f"{negation}s({literal.term.name},{_text(literal.term.arguments[0])})"]
    term, value = _text(literal.term), _text(literal.value)
    if literal.relation == "=":
        return [f"{negation}h({term},{value})"]
    fresh = f"_V{number}"
    if literal.negated:
        sort = signature.attributes[literal.term.name].range
        return [f"not h({term},{fresh}) : s({sort},{fresh}), {fresh} {literal.relation} {value}"]
    return [f"h({term},{fresh})", f"{fresh} {literal.relation} {value}"]


def _tuple(expressions: Iterable[Expression]) -> str:
    arguments = ",".join(map(_text, expressions))
    return f"i({arguments})" if arguments else "i"


def _text(expression: Expression) -> str:
    if isinstance(expression, Arithmetic):
        operator = "\\" if expression.operator == "mod" else expression.operator
        return f"({_text(expression.left)}{operator}{_text(expression.right)})"
    if isinstance(expression, Number) and expression.value < 0:
        return f"({expression})"
    if isinstance(expression, Term) and expression.arguments:
        return f"{expression.name}({','.join(map(_text, expression.arguments))})"
    return str(expression)
