"""Programs as tables: the Bayesian network that a program is, if it is one."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np

from lcorpp.errors import ProgramError, check_type, expected_one_of
from lcorpp.reasoning.factors.division import Division, divide_program
from lcorpp.reasoning.factors.factor_graph import FactorGraph, build_factor_graph
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork, ProbabilityTable
from lcorpp.reasoning.language.networks.table_writer import write_csv, write_toml
from lcorpp.reasoning.language.program import Program

WRITERS = {"csv": write_csv, "toml": write_toml}
"""The forms of tables."""


def table_text(program: Program, form: str = "csv") -> str:
    """Write a program as tables, as `read_plog` reads them.

    Args:
        form: "csv" or "toml".

    Raises:
        ProgramError: the program is no network: an attribute has arguments, depends on itself or may have no
            value, or there are constraints, observations or cr-rules; the message names it.

    Examples:
        >>> from lcorpp import parse_plog
        >>> from lcorpp.reasoning import table_text
        >>> text = "rain, wet : boolean. random(rain). pr(rain) = 1/5. wet :- rain. -wet :- -rain."
        >>> print(table_text(parse_plog(text)), end="")
        rain = true,rain = false
        0.2,0.8
        <BLANKLINE>
        rain,wet = true,wet = false
        true,1,0
        false,0,1
    """
    check_type(program, Program, "program", ProgramError)
    if form not in WRITERS:
        raise ProgramError(f"form={form!r}; {expected_one_of(WRITERS)}")
    return WRITERS[form](tabulate(program))


def tabulate(program: Program) -> BayesianNetwork:
    """Return the Bayesian network with the distribution of a program.

    Each attribute gets a table over the attributes in the bodies of its rules, selections and pr-atoms. Rows
    for values that a parent never has get equal probabilities.

    Raises:
        ProgramError: as `table_text`.
    """
    if isinstance(program, BayesianNetwork):
        return program
    if program.has_cr_rules:
        raise ProgramError(f"{program.file}: a program with cr-rules is no table")
    for name, attribute in program.signature.attributes.items():
        if attribute.arguments:
            raise ProgramError(f"{attribute.at}: {name} has arguments; the attribute of a table has none")
    names = list(program.attributes)
    division = divide_program(ground_program(program, {}), names, {})
    if division is None:
        raise ProgramError(f"{program.file}: its tables would be too large")
    _check(program, division)
    if not division.has_worlds:
        raise ProgramError(f"{program.file}: no possible world, so that no attribute has a distribution")
    graph = build_factor_graph(division, {})
    if graph is None:
        raise ProgramError(f"{program.file}: a world may break a condition of P-log, so it is no table")
    tables = {}
    for factor in graph.factors:
        name = graph.program.names[graph.terms[factor.scope[-1]]]
        if factor.child < 0:
            at = program.attributes[name].at
            raise ProgramError(f"{at}: {name} has no distribution for some values of its parents")
        tables[name] = _complete(program, graph, factor.scope, factor.list_fractions())
    values = {name: program.attributes[name].values for name in names}
    places = {name: program.attributes[name].at for name in names}
    return BayesianNetwork(program.file, values, {name: tables[name] for name in names}, places)


def _check(program: Program, division: Division) -> None:
    """Raise `ProgramError` if a program is no network."""
    names = division.program.names
    for part in [part for block in division.blocks for part in block.parts]:
        if not part.is_table and part.terms:
            own = ", ".join([names[term] for term in part.terms])
            raise ProgramError(f"{program.file}: {own} depend on each other, or on too many others")
    if division.constraints:
        constraint = next(iter(division.constraints.values()))[0]
        at = program.statements[constraint.statement].at if constraint.statement >= 0 else program.file
        raise ProgramError(f"{at}: a constraint or an observation is no table")


def _complete(
    program: Program, graph: FactorGraph, scope: tuple[int, ...], fractions: list[Fraction]
) -> ProbabilityTable:
    """Complete a factor, which has only possible outcomes, to a table over all values."""
    names = [graph.program.names[graph.terms[v]] for v in scope]
    sizes = [len(program.attributes[name].values) for name in names]
    known = dict(zip(product(*[graph.outcomes[v] for v in scope]), fractions, strict=True))
    rows = []
    for given in product(*map(range, sizes[:-1])):
        if known.get((*given, sizes[-1])):
            at = program.attributes[names[-1]].at
            raise ProgramError(
                f"{at}: {names[-1]} has no value in some worlds; the attribute of a table has one"
            )
        is_known = all(code in graph.outcomes[v] for v, code in zip(scope[:-1], given, strict=True))
        other = Fraction(0) if is_known else Fraction(1, sizes[-1])
        rows.append([known.get((*given, code), other) for code in range(sizes[-1])])
    numbers = np.array([[float(number) for number in row] for row in rows]).reshape(sizes)
    return ProbabilityTable(tuple(names[:-1]), numbers, program.attributes[names[-1]].at, rows)
