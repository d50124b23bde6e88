"""Learnt knowledge as text: the program with its intervals, and what a report states of it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from lcorpp.model_learning.knowledge.knowledge import Knowledge
from lcorpp.model_learning.knowledge.program import list_atoms, list_declarations

NOT_IDENTIFIABLE = "not identifiable from these data"

MIN_EDGE = 0.05
"""Edges that are less probable and not in the program are left out of the report."""


def format_program(knowledge: Knowledge) -> str:
    """Return the program as P-log, with the interval of each number as a comment."""
    cases, edges = knowledge.cases, knowledge.edges
    lines = [
        f"% Learnt from {cases.count:g} records. Comments have 95 % intervals and the number of records to",
        "% which a rule applies. The last value of an attribute has the remaining probability.",
        "",
        *list_declarations(cases),
    ]
    numbers = zip(list_atoms(cases, knowledge.rules), knowledge.fitted.numbers, strict=True)
    for j, group in groupby(numbers, lambda pair: pair[0].attribute):
        parents = ", ".join(f"{cases.names[i]} ({edges[i, j]:.2f})" for i in knowledge.list_parents(j))
        on = f"on {parents}; probability of each edge in brackets" if parents else "on no other attribute"
        lines += ["", f"% {cases.names[j]} depends {on}."]
        for atom, number in group:
            interval = NOT_IDENTIFIABLE
            if number.interval is not None:
                interval = "{:.3g} to {:.3g}".format(*number.interval)
            left = f"{atom.left_side} = {number.statement.number}."
            lines.append(f"{left:<60} % {interval}; {number.cases:.0f} records")
    return "\n".join(lines) + "\n"


def describe_knowledge(knowledge: Knowledge) -> Iterator[str]:
    """Yield the lines of a report: which attributes depend on which, and what is not identifiable."""
    cases, edges = knowledge.cases, knowledge.edges
    names, n = cases.names, len(cases.names)
    yield (
        f"{cases.count:g} records of {n} attributes. The structure is the most probable one (BDeu"
        " score); the probability of an edge is averaged over all structures. Where both directions are"
        " probable, the data do not determine which is right."
    )
    if not cases.is_complete:
        yield ""
        yield (
            "Unknown values are completed by the program; the probabilities of edges are those given the"
            " completed records."
        )
    pairs = [(i, j) for i in range(n) for j in range(n) if i != j]
    shown = [(i, j) for i, j in pairs if i in knowledge.list_parents(j) or edges[i, j] >= MIN_EDGE]
    if shown:
        yield from ("", "| from | to | probability | in the program |", "|---|---|---|---|")
    for i, j in shown:
        is_kept = "yes" if i in knowledge.list_parents(j) else "no"
        yield f"| {names[i]} | {names[j]} | {edges[i, j]:.3f} | {is_kept} |"
    if unknown := list(_list_unknown(knowledge)):
        yield from ("", f"### {NOT_IDENTIFIABLE.capitalize()}", "")
        yield from (f"- {text}" for text in unknown)


def _list_unknown(knowledge: Knowledge) -> Iterator[str]:
    """Yield what the records do not determine."""
    cases = knowledge.cases
    for name, value in cases.constants.items():
        yield f"{name}: it is {value} in all records"
    for j, name in enumerate(cases.names):
        seen = {int(v) for v in cases.rows[:, j]}
        never = [value for v, value in enumerate(cases.values[j]) if v not in seen]
        if never:
            yield f"{name}: no record has {', '.join(never)}"
    atoms, numbers = list(list_atoms(cases, knowledge.rules)), knowledge.fitted.numbers
    open_ones = [atom for atom, own in zip(atoms, numbers, strict=True) if own.interval is None]
    for j in dict.fromkeys(atom.attribute for atom in open_ones):
        own = [atom.left_side for atom in open_ones if atom.attribute == j]
        is_all = len(own) == sum(atom.attribute == j for atom in atoms)
        yield f"{cases.names[j]}: {'all its numbers' if is_all else ', '.join(own)}"
    if knowledge.fitted.n_undetermined:
        yield (
            f"{knowledge.fitted.n_undetermined} degrees of freedom of the numbers are open: what they state"
            " of the observed attributes is determined, the numbers themselves are not"
        )
