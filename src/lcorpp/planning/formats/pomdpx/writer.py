"""Writing PomdpX, so that reading gives the same problem bit for bit; APPL's tools read it, too."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from lcorpp.errors import ModelError
from lcorpp.files import write_atomically
from lcorpp.planning.factored.model import Factored
from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.variables import AFTER, Variable
from lcorpp.planning.formats.pomdpx.entries import entries
from lcorpp.planning.pomdp import Pomdp

_LETTERS = {"StateVar": "s", "ActionVar": "a", "ObsVar": "o"}


def write_pomdpx(problem: Factored | Pomdp, path: str | Path) -> None:
    """Write a .pomdpx file; reading it gives the same problem exactly.

    Args:
        problem: with its variables; a flat one has one for the state, the action and the observation each.
        path: the file.

    Raises:
        FileError: the file cannot be written.
        ModelError: a name cannot stand in the format, such as one with a space.
    """
    # characters beyond ASCII as references: the readers of APPL know no other way
    write_atomically(path, format_pomdpx(problem).encode("ascii", "xmlcharrefreplace"))


def format_pomdpx(problem: Factored | Pomdp) -> str:
    """The text of a problem in PomdpX format, version 1.0.

    Raises:
        ModelError: a name cannot stand in the format.
    """
    factored = Factored.of_pomdp(problem) if isinstance(problem, Pomdp) else problem
    return "\n".join(_lines(factored)) + "\n"


def _lines(problem: Factored) -> Iterator[str]:
    names = _names(problem)
    yield '<?xml version="1.0" encoding="ISO-8859-1"?>'
    yield (
        '<pomdpx version="1.0" id="lcorpp" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
        ' xsi:noNamespaceSchemaLocation="pomdpx.xsd">'
    )
    yield f"<Discount>{problem.discount!r}</Discount>"
    yield "<Variable>"
    for variable in problem.states:
        before, after = (quoteattr(names[variable.name + sign]) for sign in ("", AFTER))
        observed = "true" if variable.observed else "false"
        yield f'<StateVar vnamePrev={before} vnameCurr={after} fullyObs="{observed}">'
        yield from _values("StateVar", variable)
    for kind, variables in (("ObsVar", problem.observations), ("ActionVar", problem.actions)):
        for variable in variables:
            yield f"<{kind} vname={quoteattr(variable.name)}>"
            yield from _values(kind, variable)
    for name in problem.reward:
        yield f"<RewardVar vname={quoteattr(name)}/>"
    yield "</Variable>"
    for section, tables in (
        ("InitialStateBelief", problem.start),
        ("StateTransitionFunction", problem.transition),
        ("ObsFunction", problem.observation),
    ):
        if tables:
            yield f"<{section}>"
            for table in tables:
                yield from _function(
                    "CondProb", [names[name] for name in table.children], table, problem, names
                )
            yield f"</{section}>"
    yield "<RewardFunction>"
    for name, table in problem.reward.items():
        yield from _function("Func", [name], table, problem, names)
    yield "</RewardFunction>"
    yield "</pomdpx>"


def _values(kind: str, variable: Variable) -> Iterator[str]:
    if variable.values == tuple(f"{_LETTERS[kind]}{i}" for i in range(len(variable.values))):
        yield f"<NumValues>{len(variable.values)}</NumValues>"
    else:
        yield f"<ValueEnum>{_text(variable.values)}</ValueEnum>"
    yield f"</{kind}>"


def _function(
    kind: str, children: Sequence[str], table: Table, problem: Factored, names: dict[str, str]
) -> Iterator[str]:
    title = "ProbTable" if kind == "CondProb" else "ValueTable"
    yield f"<{kind}>"
    yield f"<Var>{_text(children)}</Var>"
    yield f"<Parent>{_text([names[name] for name in table.parents] or ['null'])}</Parent>"
    yield '<Parameter type="TBL">'
    for instance, numbers in entries(table, problem.scope):
        yield f"<Entry><Instance>{_text(instance)}</Instance><{title}>{numbers}</{title}></Entry>"
    yield "</Parameter>"
    yield f"</{kind}>"


def _names(problem: Factored) -> dict[str, str]:
    """The names of the file by ours: ``x_0`` and ``x_1`` for x before and after an action.

    Raises:
        ModelError: a name means something else in the format.
    """
    plain = [variable.name for variable in (*problem.actions, *problem.observations)]
    states = [variable.name for variable in problem.states]
    for name in (*plain, *states, *problem.reward):
        if name == "null":
            raise ModelError(
                "the name 'null' cannot be written into a .pomdpx file, where it means no parents"
            )
    signs = {"": "_0", AFTER: "_1"}
    theirs = {*plain, *problem.reward, *(name + end for name in states for end in signs.values())}
    if len(theirs) < len(plain) + len(problem.reward) + 2 * len(states) or theirs.intersection(states):
        signs = {"": "", AFTER: AFTER}  # never the end of a name, so that these are always different
    return {
        **{name: name for name in plain},
        **{name + ours: name + end for name in states for ours, end in signs.items()},
    }


def _text(words: Sequence[str]) -> str:
    return escape(" ".join(words))
