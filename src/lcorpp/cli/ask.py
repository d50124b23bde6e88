"""`lcorpp ask`: a query to a P-log program."""

from __future__ import annotations

import logging
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.errors import ProgramError

if TYPE_CHECKING:
    from lcorpp.reasoning.explanation import Result
    from lcorpp.reasoning.language.program import Program
    from lcorpp.reasoning.language.syntax import Query
    from lcorpp.reasoning.reasoner import Answer


def ask(
    file: Annotated[Path, typer.Argument(metavar="FILE.plog", help="The program.")],
    query: Annotated[
        str | None,
        typer.Argument(
            metavar="QUERY",
            help="E.g. 'intention', 'intention=interested | obs(time=morning), do(location=library)';"
            " the program's own queries by default.",
        ),
    ] = None,
    exact: Annotated[bool, typer.Option("--exact", help="Print fractions.")] = False,
    lenient: Annotated[
        bool,
        typer.Option(
            "--lenient",
            help="Leave out statements with constants outside of their sorts, as other systems do.",
        ),
    ] = False,
    why: Annotated[
        bool,
        typer.Option(
            "--why",
            help="Also: the answer without each condition, the most probable worlds, their rules.",
        ),
    ] = False,
) -> None:
    """Ask a P-log program for a probability, or for the distribution of an attribute."""
    from lcorpp.reasoning.language.parser import parse_query, read_plog

    told = logging.getLogger("lcorpp.reasoning")
    if not told.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("lcorpp: %(message)s"))
        told.addHandler(handler)
        told.setLevel(logging.INFO)
    program = read_plog(file, strict=not lenient)
    queries = [parse_query(query, program)] if query is not None else list(program.queries)
    if not queries:
        raise ProgramError(
            f"{file}: the program has no query of its own; give one, such as 'attribute=value'"
        )
    for each in queries:
        _say(str(each), "1")
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            if why:
                _why(program, each, exact)
            else:
                _answer(_ask(program, each, exact), exact)
        for warning in said:
            typer.echo(f"lcorpp: {warning.message}", err=True)


def _ask(program: Program, query: Query, exact: bool) -> Result:
    from lcorpp.reasoning.reasoner import Reasoner

    return Reasoner(program).ask(query, exact=exact)


def _answer(answer: Result, exact: bool) -> None:
    if not isinstance(answer, dict):
        _say(f"  {_number(answer, exact)}")
        return
    width = max(map(len, answer))
    for value, probability in answer.items():
        _say(f"  {value:<{width}}  {_number(probability, exact)}  {_bar(float(probability))}")


def _why(program: Program, query: Query, exact: bool) -> None:
    from lcorpp.errors import UndefinedError
    from lcorpp.reasoning.explanation import explain

    found = explain(program, query)
    if found.answer is not None:
        _answer(found.answer, exact)
    for condition, answer in found.without:
        _say(f"\n  without {condition}:")
        if isinstance(answer, str):
            _say(f"  {answer}")
        else:
            _answer(answer, exact)
    for number, (world, fired) in enumerate(found.worlds, start=1):
        _say(f"\n  world {number}, probability {_number(world.measure, exact)}:", "1")
        _say(f"  {', '.join(f'{term}={value}' for term, value in world.values.items())}")
        width = max((len(rule.says) for rule in fired), default=0)
        for rule in fired:
            _say(f"    line {rule.at.line:<4} {rule.says:<{width}}  {rule.statement}")
    if found.answer is None:
        raise UndefinedError(f"{program.file}: no possible world of positive measure has the evidence")


def _number(probability: Answer, exact: bool) -> str:
    error = getattr(probability, "error", None)
    if error is not None:
        return f"{float(probability):.6f} ± {1.96 * error:.6f}"
    if exact:
        return str(probability)
    small = 0 < probability < 5e-7  # what is possible is not shown as 0
    return f"{float(probability):.6g}" if small else f"{float(probability):.6f}"


def _bar(share: float, width: int = 30) -> str:
    """A probability as a bar; rich would draw it as well, but takes longer to load than the answer."""
    eighths = round(share * width * 8)
    blocks = "█" * (eighths // 8) + (" ▏▎▍▌▋▊▉"[eighths % 8] if eighths % 8 else "")
    return typer.style(blocks, fg="cyan")


def _say(text: str, style: str = "") -> None:
    typer.echo(typer.style(text, bold=True) if style else text)
