"""Enumerate the possible worlds of a program with clingo, and compute their measures.

Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3.2, equation 6 (the measure of a world); Balai,
Gelfond and Zhang, 2019, definitions 10 and 11 (abductive supports; by cardinality, as in plog 2.0).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Any

import clingo

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning.answers import format_world
from lcorpp.reasoning.conditions import (
    ConditionViolation,
    compute_probabilities,
    list_applicable,
    list_dynamic_range,
)
from lcorpp.reasoning.enumeration.asp_translation import decode_names, translate_program
from lcorpp.reasoning.grounding.ground_program import ASSIGN, DERIVE, RANGE, SELECT, Clause
from lcorpp.reasoning.language.arithmetic import evaluate_number
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Probability
from lcorpp.reasoning.language.traversal import list_variables
from lcorpp.reasoning.questions import list_values

KINDS = {"sel": SELECT, "pos": RANGE, "pr": ASSIGN, "drv": DERIVE}
"""The clauses about selected terms, by their predicate in the translation."""


def enumerate_worlds(program: Program, limit: int) -> Iterator[tuple[dict[str, str], Fraction]]:
    """Enumerate the worlds of a program: (term -> value, sorted by term; measure, not normalised).

    With cr-rules these are the worlds of the regular program with each of its abductive supports, the
    smallest sets of instances of cr-rules that make it consistent; duplicates are dropped.

    Args:
        limit: the maximum number of worlds.

    Raises:
        TooLargeError: there are more than `limit` worlds.
        ProgramError: an operation is undefined, or a world breaks a condition of the language.
    """
    lines, places = translate_program(program)
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
    reader = _WorldReader(program)
    known: set[object] = set()
    with control.solve(yield_=True) as models:
        optimal = (model for model in models if not program.has_cr_rules or model.optimality_proven)
        for count, model in enumerate(optimal):
            if count == limit:
                raise TooLargeError(
                    f"{program.file}: more than {limit} possible worlds; raise the limit to enumerate them"
                )
            symbols = model.symbols(shown=True)
            if program.has_cr_rules:  # two supports may have the same world
                if frozenset(symbols) in known:
                    continue
                known.add(frozenset(symbols))
            yield reader.read(symbols)


def _locate_message(messages: list[str], places: Mapping[int, Place], program: Program) -> str:
    """Format the first message of clingo with the place of its statement."""
    head, _, rest = messages[0].partition(": ")
    number = head.split(":")[1] if head.count(":") else ""
    place = places.get(int(number)) if number.isdigit() else None
    text = " ".join((rest or head).split()).removeprefix("info: ").removeprefix("error: ")
    return f"{place or program.file}: cannot be grounded: {text}"


class _WorldReader:
    """Reads answer sets; most worlds share atoms and local distributions with others, so both are cached."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._atoms: dict[Any, tuple[str, str | Clause]] = {}
        self._distributions: dict[object, Mapping[str, Fraction]] = {}

    def read(self, symbols: Iterable[Any]) -> tuple[dict[str, str], Fraction]:
        """Return the values of the terms and the measure of the world.

        Raises:
            ProgramError: the world breaks a condition of the language.
        """
        values: dict[str, str] = {}
        clauses_of: dict[str, set[Clause]] = {}
        for symbol in symbols:
            if symbol not in self._atoms:
                self._atoms[symbol] = self._decode(symbol.name, symbol.arguments)
            term, item = self._atoms[symbol]
            if isinstance(item, str):
                values[term] = item
            else:
                clauses_of.setdefault(term, set()).add(item)
        values = dict(sorted(values.items()))
        measure = Fraction(1)
        for term, clauses in sorted(clauses_of.items()):
            key = term, frozenset(clauses)
            if key not in self._distributions:
                try:
                    self._distributions[key] = self._distribute(term, clauses)
                except ConditionViolation as found:
                    message = found.format(self._program.statements, [term])
                    raise ProgramError(f"{message}, in the world {format_world(values)}") from None
            measure *= self._distributions[key][values[term]]
        return values, measure

    def _decode(self, name: str, arguments: list[Any]) -> tuple[str, str | Clause]:
        """Decode an atom: a term, and its value or a clause about it whose body is true."""
        if name == "h":
            return decode_names(str(arguments[0])), decode_names(str(arguments[1]))
        index = arguments[0].number
        label, instance, term, *value = [decode_names(str(argument)) for argument in arguments[1:]]
        number = None
        if name == "pr":
            atom = self._program.statements[index]
            assert isinstance(atom, Probability)
            bindings = dict(
                zip(
                    list_variables(atom),
                    [decode_names(str(value)) for value in arguments[2].arguments],
                    strict=True,
                )
            )
            try:
                number = evaluate_number(atom.number, bindings)
            except SourceIssue as issue:
                raise ProgramError(str(issue)) from None
        outcome = list_values(self._program, term).index(value[0]) if value else -1
        return term, Clause(KINDS[name], -1, outcome, (), index, label, (instance,), number)

    def _distribute(self, term: str, clauses: Iterable[Clause]) -> dict[str, Fraction]:
        """Compute the probability of each possible value of a selected term."""
        program, values = self._program, list_values(self._program, term)
        clauses = sorted(clauses, key=lambda clause: (clause.statement, clause.instance))
        selections = [clause for clause in clauses if clause.kind is SELECT]
        possible = list_dynamic_range(program, values, selections, clauses)
        atoms = list_applicable(program, selections, clauses)
        numbers = compute_probabilities(program, values, possible, atoms)
        return {values[i]: number for i, number in zip(possible, numbers, strict=True)}
