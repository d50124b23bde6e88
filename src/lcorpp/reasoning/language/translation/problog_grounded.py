"""ProbLog to P-log by instances: the ground clauses on which queries and evidence depend.

    box(1). box(2). box(3). 0.5::full(X) :- box(X). q(X) :- full(X), 1 =:= X / 2. query(q(2)).

becomes `random(full(2)). pr(full(2)) = 0.5. q(2) :- full(2). ?{q(2)}.` A choice with several heads, or whose
atom has other derivations, is an attribute of its own, as in `problog_lifted`. Predicates and constants that
are not names of P-log get names with an apostrophe, which names of ProbLog do not have.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from lcorpp.reasoning.language.arithmetic import absorb_rounding
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.overloads import resolve_overloads
from lcorpp.reasoning.language.sorts import BOOLEAN, SortDefinition, SortSet
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    Expression,
    Literal,
    Number,
    Observation,
    Probability,
    Query,
    Rule,
    Selection,
    Statement,
    Term,
)
from lcorpp.reasoning.language.translation.dependencies import find_dependents
from lcorpp.reasoning.language.translation.names import (
    NameTable,
    Translation,
    describe_case,
    describe_choice,
    is_made_name,
    make_choice_name,
)
from lcorpp.reasoning.language.translation.problog_clauses import PrologClause
from lcorpp.reasoning.language.translation.prolog_builtins import BUILTINS
from lcorpp.reasoning.language.translation.prolog_terms import (
    Compound,
    PrologTerm,
    PrologVariable,
    abbreviate,
    format_atom,
    unquote,
)
from lcorpp.reasoning.language.translation.tables import Choice, Derivation, GroundLiteral, Table
from lcorpp.reasoning.language.translation.tabling import Evaluation


def translate_instances(clauses: Sequence[PrologClause]) -> Translation:
    """Translate a program to the ground clauses on which its queries and evidence depend.

    A program without queries is translated as if all its predicates were queried.

    Raises:
        SourceIssue: the evaluation fails, see `tabling.Evaluation.solve`, or a query or evidence is wrong.
    """
    evaluation = Evaluation(clauses)
    queries = list(list_asked(evaluation, "query"))
    asked: list[tuple[GroundLiteral, Place]] = []
    for atom, negated, at in queries:
        table = evaluation.solve(atom, at)
        answers = table.select_answers(atom) or [atom]
        asked.extend((GroundLiteral(table, answer, negated), at) for answer in answers)
    observed = [
        (GroundLiteral(evaluation.solve(atom, at), atom, negated), at)
        for atom, negated, at in list_asked(evaluation, "evidence")
    ]
    required = [*asked, *observed]
    if not required:
        _solve_all(evaluation, clauses)
    writer = InstanceWriter(evaluation, clauses)
    for literal, at in required:
        writer.require(literal, at)
    if not required:
        for literal in writer.list_answers():
            writer.require(literal, literal.atom.at)
    statements = list(writer.iter_statements())
    for literal, at in observed:
        statements.append(Observation(((writer.make_literal(literal, at),),), at=at))
    for literal, at in asked:
        written = ("\\+" if literal.negated else "") + format_atom(literal.atom)
        statements.append(Query(((writer.make_literal(literal, at),),), written=written, at=at))
    return Translation(tuple(resolve_overloads([*writer.declare(), *statements])), writer.list_names())


def _solve_all(evaluation: Evaluation, clauses: Sequence[PrologClause]) -> None:
    heads = {head.key: head for clause in clauses for _, head in clause.heads}
    heads = {key: head for key, head in heads.items() if not is_made_name(head.name)}
    for (name, count), head in heads.items():
        variables = tuple([PrologVariable(f"V{i}") for i in range(count)])
        evaluation.solve(Compound(name, variables, head.at), head.at)


def list_asked(evaluation: Evaluation, kind: str) -> Iterator[tuple[Compound, bool, Place]]:
    """Iterate over the atoms of `query(a)`, `evidence(a)`, `evidence(a, false)`: (atom, negated, place)."""
    for count in (1, 2) if kind == "evidence" else (1,):
        for answer in list_certain(evaluation, kind, count):
            atom, negated, at = read_literal(answer, kind)
            if count == 2:
                value = str(answer.arguments[1])
                if value not in ("true", "false"):
                    raise SourceIssue(
                        at, f"evidence({atom},{value}) is not translated; expected true or false"
                    )
                negated ^= value == "false"
            if not atom.is_ground and (negated or kind == "evidence"):
                raise SourceIssue(at, f"{kind}({atom}) with a variable is not translated")
            yield atom, negated, at


def list_certain(evaluation: Evaluation, name: str, count: int) -> list[Compound]:
    """List the answers of a predicate; none if it has no clause.

    Raises:
        SourceIssue: an answer depends on chance.
    """
    if not evaluation.defines((name, count)):
        return []
    variables = tuple([PrologVariable(f"V{i}") for i in range(count)])
    table = evaluation.solve(Compound(name, variables), Place("", 1, 1))
    for answer, is_certain in table.answers.items():
        if not is_certain:
            at = next(iter(table.derivations[answer])).at
            raise SourceIssue(at, f"{name.rstrip(chr(39))}(...) that depends on chance is not translated")
    return list(table.answers)


def read_literal(answer: Compound, kind: str) -> tuple[Compound, bool, Place]:
    """Return the atom that is the first argument of an answer, perhaps negated: (atom, negated, place)."""
    atom, negated = answer.arguments[0], False
    at = atom.at if isinstance(atom, Compound) else answer.at
    while isinstance(atom, Compound) and atom.key in (("\\+", 1), ("not", 1)):
        atom, negated = atom.arguments[0], not negated
    if not isinstance(atom, Compound) or atom.name in (".", ",", ";", "[]") or atom.key in BUILTINS:
        raise SourceIssue(at, f"{kind}({atom}) is not translated; expected an atom")
    return Compound(unquote(atom.name), atom.arguments, atom.at), negated, at


# writing


class InstanceWriter:
    """Writes the answers that were evaluated as attributes, and their derivations as statements.

    Answers of different calls are one atom, unless the calls are modal, see `Table`.
    """

    def __init__(self, evaluation: Evaluation, clauses: Sequence[PrologClause]) -> None:
        self._clauses = clauses
        self._modal = _find_modal(evaluation)
        # answer -> the modal calls that have it, and None for all others, each with the name of its atom
        self._atoms: dict[Compound, dict[Table | None, Compound]] = {}
        self._certain: set[Compound] = set()
        self._derivations: dict[Compound, dict[Derivation, None]] = {}
        self._answers: list[GroundLiteral] = []
        for table in evaluation.tables.values():
            for answer, is_certain in table.answers.items():
                self._answers.append(GroundLiteral(table, answer, False))
                atom = self._name_answer(table, answer)
                if is_certain:
                    self._certain.add(atom)
                else:
                    self._derivations.setdefault(atom, {}).update(table.derivations[answer])
        self._required: dict[Compound, list[Derivation]] = {}
        self._names = NameTable()
        # attribute -> the values of its arguments and its own, in the order of their use
        self._uses: dict[str, dict[int, list[dict[str, Expression]]]] = {}

    def _name_answer(self, table: Table, answer: Compound) -> Compound:
        """Return the atom of an answer, whose predicate has a number if modal calls have the answer, too."""
        atoms = self._atoms.setdefault(answer, {})
        key = table if table in self._modal else None
        if key not in atoms:
            name = f"{answer.name}'{len(atoms) + 1}" if atoms else answer.name
            atoms[key] = Compound(name, answer.arguments, answer.at)
        return atoms[key]

    def list_answers(self) -> list[GroundLiteral]:
        """List all ground answers but those of negated conjunctions."""
        return [one for one in self._answers if one.atom.is_ground and not is_made_name(one.atom.name)]

    def require(self, literal: GroundLiteral, at: Place) -> None:
        """Add the atom of an answer, and those on which it depends.

        Raises:
            SourceIssue: the atom is true, but has a variable.
        """
        atom = self._name_answer(literal.table, literal.atom)
        if not atom.is_ground and (atom in self._certain or atom in self._derivations):
            raise SourceIssue(at, f"the query has the answer {abbreviate(literal.atom)} with a variable")
        waiting = [atom]
        while waiting:
            atom = waiting.pop()
            if atom not in self._required:
                own = [] if atom in self._certain else self._list_derivations(atom)
                self._required[atom] = own
                needed = [other for derivation in own for other in derivation.literals]
                waiting += [self._name_answer(other.table, other.atom) for other in needed][::-1]

    def _list_derivations(self, atom: Compound) -> list[Derivation]:
        """List the derivations of an atom without the literals that are decided."""
        found: dict[Derivation, None] = {}
        for derivation in self._derivations.get(atom, ()):
            values = [(literal, self._decide(literal)) for literal in derivation.literals]
            if all(value is not False for _, value in values):
                kept = tuple([literal for literal, value in values if value is None])
                found[Derivation(kept, derivation.choice, derivation.at)] = None
        return list(found)

    def _decide(self, literal: GroundLiteral) -> bool | None:
        """Return whether a literal is certainly true or false, None if that depends on chance."""
        atom = self._name_answer(literal.table, literal.atom)
        if atom in self._certain:
            return not literal.negated
        return None if atom in self._derivations else literal.negated

    def iter_statements(self) -> Iterator[Statement]:
        """Iterate over the selections, pr-atoms and rules of the required atoms."""
        groups: dict[tuple[int, tuple[PrologTerm, ...]], dict[int, Choice]] = {}
        users: dict[Choice, int] = {}
        for derivations in self._required.values():
            for choice in (derivation.choice for derivation in derivations if derivation.choice):
                groups.setdefault((choice.clause, choice.values), {})[choice.head] = choice
                users[choice] = users.get(choice, 0) + 1
        written: set[tuple[int, tuple[PrologTerm, ...]]] = set()
        for atom, derivations in self._required.items():
            if atom in self._certain:
                yield Rule(self._make_atom(atom, atom.at), at=atom.at)
            for own in derivations:
                if own.choice is None:
                    yield self._make_rule(atom, own, ())
                    continue
                key = own.choice.clause, own.choice.values
                heads = groups[key]
                if len(derivations) == len(heads) == users[own.choice] == 1 and not own.literals:
                    literal = self._make_atom(atom, own.at)
                    yield from self._make_selection(literal, [own.choice])
                    continue
                literal = self._make_choice(own.choice, own.choice.head + 1, own.at)
                if key not in written:
                    written.add(key)
                    yield from self._make_selection(literal, [heads[number] for number in sorted(heads)])
                yield self._make_rule(atom, own, (literal,))

    def _make_rule(self, atom: Compound, derivation: Derivation, more: tuple[Literal, ...]) -> Rule:
        at = derivation.at
        body = [self.make_literal(literal, at) for literal in derivation.literals]
        return Rule(self._make_atom(atom, at), (*body, *more), at=at)

    def _make_selection(self, literal: Literal, choices: Sequence[Choice]) -> Iterator[Statement]:
        """Make the selection of a choice and its pr-atoms; `literal` is its atom, or a value of its own."""
        term, at = literal.term, literal.at
        yield Selection(term, None, (), at=at)
        total = sum((choice.probability for choice in choices), Fraction(0))
        if total > 1 and not absorb_rounding(total, "the clause", at):
            raise SourceIssue(at, f"the probabilities sum to {float(total):.7g}; expected at most 1")
        if isinstance(literal.value, Term):  # the atom itself
            yield Probability(term, literal.value, Number(total, at=at), at=at)
            return
        numbers = {choice.head + 1: choice.probability / max(total, Fraction(1)) for choice in choices}
        if total < 1:
            numbers[0] = 1 - total
        for value, number in numbers.items():
            made = self._make_choice(choices[0], value, at)
            yield Probability(term, made.value, Number(number, at=at), at=at)

    def _make_choice(self, choice: Choice, value: int, at: Place) -> Literal:
        """Make the literal that a choice has a value: the number of a head from 1, 0 for none of them."""
        name = make_choice_name(self._clauses[choice.clause].at)
        return self._make_literal(name, choice.values, Number(Fraction(value), at=at), at)

    def make_literal(self, literal: GroundLiteral, at: Place) -> Literal:
        """Make the literal that an answer is true, or its negation."""
        made = self._make_atom(self._name_answer(literal.table, literal.atom), at)
        return replace(made, negated=literal.negated)

    def _make_atom(self, atom: Compound, at: Place) -> Literal:
        name = self._names.name_predicate(atom.name)
        return self._make_literal(name, atom.arguments, Term("true", at=at), at)

    def _make_literal(
        self, name: str, arguments: Iterable[PrologTerm], value: Expression, at: Place
    ) -> Literal:
        values = [self._names.name_value(argument, at) for argument in arguments]
        uses = self._uses.setdefault(name, {}).setdefault(len(values), [{} for _ in (*values, value)])
        for known, expression in zip(uses, (*values, value), strict=True):
            known.setdefault(str(expression), expression)
        return Literal(Term(name, tuple(values), at=at), "=", value, at=at)

    def list_names(self) -> dict[str, str]:
        """List the names that differ from those of the source, see `Translation`."""
        choices = {make_choice_name(clause.at): describe_choice(clause.at) for clause in self._clauses}
        cases = {name: describe_case(name) for name in self._uses if is_made_name(name)}
        return choices | cases | self._names.list_names()

    def declare(self) -> Iterator[Statement]:
        """Iterate over the declarations of the attributes in the literals made so far."""
        for name, by_count in self._uses.items():
            for count, uses in sorted(by_count.items()):
                own = name if count == min(by_count) else f"{name}_{count}"
                sorts = []
                for index, values in enumerate(uses, start=1):
                    if values.keys() <= {"true", "false"}:
                        sorts.append(BOOLEAN)
                        continue
                    sorts.append(f"{own}_sort_{index}")
                    while sorts[-1] in self._uses:
                        sorts[-1] += "'"
                    yield SortDefinition(sorts[-1], SortSet(tuple(values.values())))
                yield AttributeDeclaration(name, tuple(sorts[:-1]), sorts[-1])


def _find_modal(evaluation: Evaluation) -> set[Table]:
    """Find the tables that are modal, or depend on one that is."""
    users: dict[Table, list[Table]] = {}
    for table in evaluation.tables.values():
        for used in table.uses:
            users.setdefault(used, []).append(table)
    return find_dependents((table for table in evaluation.tables.values() if table.is_modal), users)
