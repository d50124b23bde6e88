"""Write PomdpX so that reading it back gives the same bits; APPL's tools read it, too."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from lcorpp.errors import ModelError
from lcorpp.files import write_atomically
from lcorpp.planning.factored.model import Factored
from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.variables import AFTER, Variable
from lcorpp.planning.formats.pomdpx.compact_entries import compact_entries
from lcorpp.planning.formats.pomdpx.declarations import VALUE_PREFIXES
from lcorpp.planning.pomdp import Pomdp


def write_pomdpx(problem: Factored | Pomdp, path: str | Path) -> None:
    """Write a .pomdpx file; reading it back gives the same problem exactly.

    Args:
        problem: a factored problem; a flat one gets one variable each for state, action and observation.

    Raises:
        FileError: the file cannot be written.
        ModelError: the format does not allow a name, such as one with a space.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_pomdpx, write_pomdpx
        >>> pomdp = load_domain("intention").pomdp
        >>> write_pomdpx(pomdp, "intention.pomdpx")
        >>> read_pomdpx("intention.pomdpx").fingerprint == pomdp.fingerprint
        True
    """
    # non-ASCII characters as references: APPL's readers support nothing else
    write_atomically(path, format_pomdpx(problem).encode("ascii", "xmlcharrefreplace"))


def format_pomdpx(problem: Factored | Pomdp) -> str:
    """Return the text of a problem in PomdpX format, version 1.0.

    Raises:
        ModelError: the format does not allow a name.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import format_pomdpx
        >>> print(format_pomdpx(load_domain("intention").pomdp))
        <?xml version="1.0" encoding="ISO-8859-1"?>
        ...
    """
    factored = Factored.of_pomdp(problem) if isinstance(problem, Pomdp) else problem
    return "\n".join(_format_lines(factored)) + "\n"


def _format_lines(problem: Factored) -> Iterator[str]:
    names = _make_names(problem)
    yield '<?xml version="1.0" encoding="ISO-8859-1"?>'
    yield (
        '<pomdpx version="1.0" id="lcorpp" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
        ' xsi:noNamespaceSchemaLocation="pomdpx.xsd">'
    )
    yield f"<Discount>{problem.discount!r}</Discount>"
    yield "<Variable>"
    for variable in problem.states:
        before, after = (quoteattr(names[variable.name + suffix]) for suffix in ("", AFTER))
        observed = "true" if variable.observed else "false"
        yield f'<StateVar vnamePrev={before} vnameCurr={after} fullyObs="{observed}">'
        yield from _format_values("StateVar", variable)
    for kind, variables in (("ObsVar", problem.observations), ("ActionVar", problem.actions)):
        for variable in variables:
            yield f"<{kind} vname={quoteattr(variable.name)}>"
            yield from _format_values(kind, variable)
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
                children = [names[name] for name in table.children]
                yield from _format_function("CondProb", children, table, problem, names)
            yield f"</{section}>"
    yield "<RewardFunction>"
    for name, table in problem.reward.items():
        yield from _format_function("Func", [name], table, problem, names)
    yield "</RewardFunction>"
    yield "</pomdpx>"


def _format_values(kind: str, variable: Variable) -> Iterator[str]:
    if variable.values == tuple(f"{VALUE_PREFIXES[kind]}{i}" for i in range(len(variable.values))):
        yield f"<NumValues>{len(variable.values)}</NumValues>"
    else:
        yield f"<ValueEnum>{_format_text(variable.values)}</ValueEnum>"
    yield f"</{kind}>"


def _format_function(
    kind: str, children: Sequence[str], table: Table, problem: Factored, names: dict[str, str]
) -> Iterator[str]:
    title = "ProbTable" if kind == "CondProb" else "ValueTable"
    yield f"<{kind}>"
    yield f"<Var>{_format_text(children)}</Var>"
    yield f"<Parent>{_format_text([names[name] for name in table.parents] or ['null'])}</Parent>"
    yield '<Parameter type="TBL">'
    for instance, numbers in compact_entries(table, problem.scope):
        yield f"<Entry><Instance>{_format_text(instance)}</Instance><{title}>{numbers}</{title}></Entry>"
    yield "</Parameter>"
    yield f"</{kind}>"


def _make_names(problem: Factored) -> dict[str, str]:
    """Return our name -> name in the file: ``x_0`` and ``x_1`` for x before and after an action."""
    plain = [variable.name for variable in (*problem.actions, *problem.observations)]
    states = [variable.name for variable in problem.states]
    if "null" in (*plain, *states, *problem.reward):
        raise ModelError("the name 'null' cannot be written into a .pomdpx file, where it means no parents")
    suffixes = {"": "_0", AFTER: "_1"}
    written = {*plain, *problem.reward, *(name + end for name in states for end in suffixes.values())}
    if len(written) < len(plain) + len(problem.reward) + 2 * len(states) or written.intersection(states):
        suffixes = {"": "", AFTER: AFTER}  # no name ends like this, so all are different
    return {
        **{name: name for name in plain},
        **{name + ours: name + end for name in states for ours, end in suffixes.items()},
    }


def _format_text(words: Sequence[str]) -> str:
    return escape(" ".join(words))
