"""Enumerate the possible worlds of a program with clingo, and compute their measures.

Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3.2, equation 6 (the measure of a world); Balai,
Gelfond and Zhang, 2019, definitions 10 and 11 (abductive supports; by cardinality, as in plog 2.0).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from fractions import Fraction
from typing import Any, NamedTuple

import clingo

from lcorpp.errors import ProgramError
from lcorpp.reasoning.answers import format_world
from lcorpp.reasoning.conditions import ConditionViolation, compute_probabilities, list_applicable
from lcorpp.reasoning.enumeration.asp_translation import Condition, translate_program
from lcorpp.reasoning.language.arithmetic import evaluate_number
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Probability
from lcorpp.reasoning.language.traversal import as_selection, list_variables


class _Applied(NamedTuple):
    """A selection or a pr-atom whose body is true, see `RuleInstance`."""

    statement: int
    label: str
    instance: str
    value: int = -1
    number: Fraction | None = None


def enumerate_worlds(
    program: Program, do: Mapping[str, str], limit: int, observed: Sequence[Condition] = ()
) -> Iterator[tuple[dict[str, str], Fraction]]:
    """Enumerate the worlds of a program: (term -> value, sorted by term; measure, not normalised).

    With cr-rules these are the worlds of the regular program with each of its abductive supports, the
    smallest sets of instances of cr-rules that make it consistent; duplicates are dropped.

    Args:
        do: interventions besides those in the program, term -> value.
        limit: the maximum number of worlds.
        observed: observations besides those in the program.

    Raises:
        ProgramError: there are more than `limit` worlds, an operation is undefined, or a world breaks a
            condition of the language.
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
    reader = _WorldReader(program)
    known: set[object] = set()
    with control.solve(yield_=True) as models:
        optimal = (model for model in models if not program.has_cr_rules or model.optimality_proven)
        for count, model in enumerate(optimal):
            if count == limit:
                raise ProgramError(
                    f"{program.file}: more than {limit} possible worlds; raise the limit to enumerate them"
                )
            symbols = model.symbols(shown=True)
            if program.has_cr_rules:  # two supports may have the same world
                key = frozenset(symbols)
                if key in known:
                    continue
                known.add(key)
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
        self._atoms: dict[Any, tuple[str, str, Any]] = {}
        self._distributions: dict[object, Mapping[str, Fraction]] = {}

    def read(self, symbols: Iterable[Any]) -> tuple[dict[str, str], Fraction]:
        """Return the values of the terms and the measure of the world.

        Raises:
            ProgramError: the world breaks a condition of the language.
        """
        parts: dict[str, list[tuple[str, Any]]] = {"h": [], "sel": [], "pos": [], "pr": [], "drv": []}
        for symbol in symbols:
            atom = self._atoms.get(symbol)
            if atom is None:
                atom = self._atoms[symbol] = self._decode(symbol.name, symbol.arguments)
            parts[atom[0]].append(atom[1:])
        values, derived = dict(sorted(parts["h"])), dict(parts["drv"])
        atoms_of, selections_of, members_of = map(_group, (parts["pr"], parts["sel"], parts["pos"]))
        measure = Fraction(1)
        for term, selections in selections_of.items():
            atoms = atoms_of.get(term, [])
            members = frozenset(members_of.get(term, ()))
            key = term, term in derived, members, *selections, *atoms
            if key not in self._distributions:
                try:
                    distribution = self._distribute(term, selections, members, atoms, derived=term in derived)
                except ConditionViolation as found:
                    message = found.format(self._program.statements, [term])
                    raise ProgramError(f"{message}, in the world {format_world(values)}") from None
                self._distributions[key] = distribution
            measure *= self._distributions[key][values[term]]
        return values, measure

    def _decode(self, name: str, arguments: list[Any]) -> tuple[str, str, Any]:
        """Decode an atom: its name, its term, and the rest."""
        if name == "h":
            return name, str(arguments[0]), str(arguments[1])
        if name == "drv":
            return name, str(arguments[0]), None
        index, *rest = arguments[0].number, *map(str, arguments[1:])
        if name == "sel":
            label, instance, term = rest
            return name, term, _Applied(index, label, instance)
        if name == "pos":
            instance, term, value = rest
            return name, term, (index, instance, value)
        label, instance, term, value = rest
        atom = self._program.statements[index]
        assert isinstance(atom, Probability)
        bindings = dict(zip(list_variables(atom), map(str, arguments[2].arguments), strict=True))
        try:
            number = evaluate_number(atom.number, bindings)
        except SourceIssue as issue:
            raise ProgramError(str(issue)) from None
        values = self._program.attributes[atom.term.name].values
        return name, term, _Applied(index, label, instance, values.index(value), number)

    def _distribute(
        self,
        term: str,
        selections: Sequence[_Applied],
        members: Set[tuple[int, str, str]],
        atoms: Sequence[_Applied],
        *,
        derived: bool,
    ) -> Mapping[str, Fraction]:
        """Compute the probability of each value of a selected term."""
        program, first = self._program, selections[0]
        selection = as_selection(program.statements[first.statement])
        assert selection is not None
        values = program.attributes[selection.term.name].values
        possible = [
            i
            for i, value in enumerate(values)
            if not selection.range or (first.statement, first.instance, value) in members
        ]
        applicable = list_applicable(program, selections, atoms, derived=derived)
        numbers = compute_probabilities(program, values, possible, applicable)
        return {values[i]: number for i, number in zip(possible, numbers, strict=True)}


def _group(pairs: Iterable[tuple[str, Any]]) -> dict[str, list[Any]]:
    """Group what is said about each term, in program order."""
    groups: dict[str, list[Any]] = {}
    for term, item in sorted(pairs):
        groups.setdefault(term, []).append(item)
    return groups
