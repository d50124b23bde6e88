"""Translate Markov logic networks to P-log.

Each ground atom is a random term with equal probabilities. A formula of weight w is an attribute that is true
where it holds, with an observation whose probability is e^w times as large there: a likelihood. So the
measure of a world is that of Markov logic, e to the sum of the weights of the formulas that hold, but for a
factor. Subformulas are attributes of their own, so that the translation keeps the variables of the formula.

    1.5 Smokes(x) => Cancer(x)        formula'1(X) :- not 'Smokes'(X).   formula'1(X) :- 'Cancer'(X).
                                      random(weight'1(X)).  pr(weight'1(X) | formula'1(X)) = 1.
                                      pr(weight'1(X) | -formula'1(X)) = 0.2231...  :- not weight'1(X).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from decimal import Decimal

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.translation.markov_formulas import (
    Constant,
    Formula,
    MarkovLogic,
    Variable,
    WeightedFormula,
    compute_share,
)
from lcorpp.reasoning.language.translation.mln_reader import Fact
from lcorpp.reasoning.quoting import make_name_text, make_value_text, write_name


def translate_mln(network: MarkovLogic) -> tuple[str, dict[str, str]]:
    """Translate a network to the text of a P-log program, and the names of it that are not of the network.

    Raises:
        SourceIssue: a domain is empty, or a variable has no type or two.
    """
    translation = _Translation(network)
    return translation.translate(), translation.names


def add_constants(network: MarkovLogic, facts: Sequence[Fact]) -> None:
    """Add the constants of evidence to the domains.

    Raises:
        SourceIssue: a predicate is not declared, or has another number of arguments.
    """
    for fact in facts:
        predicate = network.find_predicate(fact.name, fact.at, len(fact.arguments))
        for name, kind in zip(fact.arguments, predicate.types, strict=True):
            network.add_constant(kind, name)


def list_observations(network: MarkovLogic, facts: Sequence[Fact]) -> list[str]:
    """List the observations of a query that the literals of a file of evidence are."""
    observed = []
    for fact in facts:
        arguments = [write_name(make_value_text(name)) for name in fact.arguments]
        name = write_name(make_name_text(fact.name))
        if network.predicates[fact.name].is_exclusive:
            sign = "=" if fact.is_true else "!="
            *given, value = arguments
            observed.append(f"obs({name}{_parenthesize(given)}{sign}{value})")
        else:
            observed.append(f"obs({'' if fact.is_true else '-'}{name}{_parenthesize(arguments)})")
    return observed


class _Translation:
    def __init__(self, network: MarkovLogic) -> None:
        self._network = network
        self._lines: list[str] = []
        taken = set(network.predicates) | {"boolean"}
        self._sort_of: dict[str, str] = {}
        for kind in network.domains:
            name = re.sub(r"\W", "_", kind)
            if make_name_text(name) != name:  # reserved
                name += "_"
            while name in taken:
                name += "_"
            taken.add(name)
            self._sort_of[kind] = name
        self.names: dict[str, str] = {}
        self._n_parts = 0

    def translate(self) -> str:
        network = self._network
        used = {kind: p.at for p in network.predicates.values() for kind in p.types}
        for kind, at in used.items():
            if not network.domains.get(kind):
                raise SourceIssue(
                    at,
                    f"the domain {kind} has no constant; expected '{kind} = {{...}}', or evidence with some",
                )
        for kind in used:
            names = [write_name(make_value_text(name)) for name in network.domains[kind]]
            self._lines.append(f"{self._sort_of[kind]} = {{{', '.join(names)}}}.")
        for name, predicate in network.predicates.items():
            sorts = [self._sort_of[kind] for kind in predicate.types]
            target = sorts.pop() if predicate.is_exclusive else "boolean"
            head = write_name(make_name_text(name))
            self._lines.append(f"{head} : {', '.join(sorts)}{' -> ' if sorts else ''}{target}.")
            variables = [f"X{i}" for i in range(len(sorts))]
            self._lines.append(f"random({head}{_parenthesize(variables)}).")
        for number, formula in enumerate(network.formulas, 1):
            self._add_formula(number, formula)
        return "\n".join([*self._lines, ""])

    def _add_formula(self, number: int, weighted: WeightedFormula) -> None:
        if weighted.weight == 0:
            return
        types: dict[str, str] = {}
        self._find_types(weighted.formula, types)
        free = sorted(self._list_free(weighted.formula))
        for variable in free:
            if variable not in types:
                raise SourceIssue(
                    weighted.at, f"{variable} is in no predicate, so that its domain is unknown; expected one"
                )
        sorts = [self._sort_of[types[variable]] for variable in free]
        body = self._list_sorts(free, types)
        where = f"line {weighted.at.line}"
        holds = self._define(self._name(f"formula'{number}", where), weighted.formula, free, types)
        if weighted.weight is None:
            self._lines.append(f":- {', '.join([f'not {holds}', *body])}.")
            return
        self._lines.append(f"-{holds} :- {', '.join([f'not {holds}', *body])}.")
        name = self._name(f"weight'{number}", where)
        term = f"{name}{_parenthesize(self._write_variables(free))}"
        high, low = compute_share(weighted.weight)
        self._lines += [
            f"{name} : {', '.join(sorts)}{' -> ' if sorts else ''}boolean. random({term}).",
            f"pr({term} | {holds}) = {_write_number(high)}. pr({term} | -{holds}) = {_write_number(low)}.",
            f":- {', '.join([f'not {term}', *body])}.",
        ]

    def _define(self, name: str, formula: Formula, free: Sequence[str], types: Mapping[str, str]) -> str:
        """Define an attribute that is true where a formula holds; return its term."""
        sorts = [self._sort_of[types[variable]] for variable in free]
        self._lines.append(f"{name} : {', '.join(sorts)}{' -> ' if sorts else ''}boolean.")
        term = f"{name}{_parenthesize(self._write_variables(free))}"
        if formula.kind == "or":
            bodies = [[self._write(part, types)] for part in formula.parts]
        elif formula.kind == "and":
            bodies = [[self._write(part, types) for part in formula.parts]]
        elif formula.kind == "exist":
            bodies = [[self._write(formula.parts[0], types)]]
        else:
            bodies = [[self._write(formula, types)]]
        bound = sorted({*free, *formula.variables})
        for body in bodies:
            self._lines.append(f"{term} :- {', '.join([*body, *self._list_sorts(bound, types)])}.")
        return term

    def _write(self, formula: Formula, types: Mapping[str, str]) -> str:
        """Write a formula as a literal; of one with connectives, define an attribute."""
        if formula.kind == "not":
            inner = formula.parts[0]
            if inner.kind == "equal":
                return " != ".join(map(self._write_argument, inner.arguments))
            return f"not {self._write(inner, types)}"
        if formula.kind == "equal":
            return " = ".join(map(self._write_argument, formula.arguments))
        if formula.kind == "atom":
            arguments = list(map(self._write_argument, formula.arguments))
            name = write_name(make_name_text(formula.name))
            if self._network.predicates[formula.name].is_exclusive:
                value = arguments.pop()
                return f"{name}{_parenthesize(arguments)} = {value}"
            return f"{name}{_parenthesize(arguments)}"
        self._n_parts += 1
        free = sorted(self._list_free(formula))
        name = self._name(f"part'{self._n_parts}", f"line {formula.at.line}")
        return self._define(name, formula, free, types)

    def _name(self, name: str, where: str) -> str:
        """Name an attribute that is not of the network."""
        kind, _, number = name.partition("'")
        self.names[name] = f"[{kind} {number}, {where}]"
        return name

    def _list_sorts(self, variables: Sequence[str], types: Mapping[str, str]) -> list[str]:
        pairs = zip(variables, self._write_variables(variables), strict=True)
        return [f"{self._sort_of[types[variable]]}({written})" for variable, written in pairs]

    def _write_variables(self, variables: Sequence[str]) -> list[str]:
        return [f"V_{variable.replace('-', '__').replace(chr(39), '_q')}" for variable in variables]

    def _write_argument(self, argument: Constant | Variable) -> str:
        if isinstance(argument, Variable):
            return self._write_variables([argument.name])[0]
        return write_name(make_value_text(argument.name))

    def _list_free(self, formula: Formula) -> set[str]:
        free = {argument.name for argument in formula.arguments if isinstance(argument, Variable)}
        return free.union(*map(self._list_free, formula.parts)) - set(formula.variables)

    def _find_types(self, formula: Formula, types: dict[str, str]) -> None:
        """Find the type of each variable by the predicates that have it."""
        if formula.kind == "atom":
            for argument, kind in zip(
                formula.arguments, self._network.predicates[formula.name].types, strict=True
            ):
                if not isinstance(argument, Variable):
                    continue
                if types.setdefault(argument.name, kind) != kind:
                    raise SourceIssue(
                        formula.at,
                        f"{argument.name} has the type {types[argument.name]} before and {kind} here;"
                        " expected one (names of constants begin with a capital letter)",
                    )
        for part in formula.parts:
            self._find_types(part, types)
        for variable in formula.variables:
            if variable not in types:
                raise SourceIssue(
                    formula.at, f"{variable} is in no predicate below its quantifier; expected one"
                )


def _parenthesize(arguments: Sequence[str]) -> str:
    return f"({', '.join(arguments)})" if arguments else ""


def _write_number(number: float) -> str:
    return format(Decimal(repr(number)), "f")
