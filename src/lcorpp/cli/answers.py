"""Answers of `lcorpp ask` on the console."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from heapq import nsmallest
from os.path import splitext
from typing import TYPE_CHECKING

from lcorpp.cli.console import (
    BOLD,
    CYAN,
    format_bar,
    print_json,
    print_spans,
    show_delayed_progress,
    show_warnings,
)
from lcorpp.errors import ParseError, ProgramError, UndefinedError
from lcorpp.files import read_text
from lcorpp.log_output import show_log
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.parser import (
    MAX_PROGRAM_BYTES,
    parse_answer_sets,
    parse_mln,
    parse_query,
    read_plog,
)
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.language.translation.names import is_auxiliary, restore_names
from lcorpp.reasoning.reasoner import DEFAULT_SAMPLES, Reasoner

if TYPE_CHECKING:
    from pathlib import Path

    from lcorpp.reasoning.answers import Numeric, PossibleWorld, QueryAnswer
    from lcorpp.reasoning.choices.credal import CredalProgram
    from lcorpp.reasoning.explanation import FiredRule

    _Without = Sequence[tuple[str, QueryAnswer | str]]
    _Worlds = Sequence[tuple[PossibleWorld, Sequence[FiredRule]]]

WHY_WORLDS = 3
"""The number of worlds that --why prints."""


_SEVERAL_ANSWER_SETS = ("depends on its own negation", "a disjunction in a head without probabilities")
"""Refusals of ProbLog programs that have several answer sets."""


@show_warnings()
def print_answers(
    file: str | Path,
    query: str | None = None,
    *,
    exact: bool = False,
    lenient: bool = False,
    why: bool = False,
    best: int | None = None,
    worlds: int = 0,
    as_json: bool = False,
    samples: int | None = None,
    seed: int = 0,
    evidence: Path | None = None,
) -> None:
    """Answer a query to a P-log program, or the program's own queries; the arguments are those of `ask`.

    Raises:
        ProgramError: the program or the query is wrong, or there is no query.
        UndefinedError: no possible world satisfies the conditions of a query.
    """
    show_log(logging.INFO, "lcorpp.reasoning")  # e.g. which engine answers
    observed: Sequence[str] = ()
    if evidence is None:
        try:
            program = read_plog(file, strict=not lenient)
        except (ParseError, ProgramError) as error:
            bounded = _read_bounds(file, error)
            if bounded is None and not _has_decisions(file):
                raise
            options = {"exact": exact, "why": why, "best": best, "worlds": worlds, "samples": samples}
            if useless := [name for name, value in options.items() if value]:
                kind = "decisions" if bounded is None else "lower and upper probabilities"
                raise ProgramError(f"--{useless[0]}: {file} has {kind}, which are printed alone") from None
            if bounded is not None:
                _print_bounds(bounded, query, as_json=as_json)
                return
            if query is not None:
                raise ProgramError(f"{file}: a program with decisions has no query; expected none") from None
            _print_decisions(file, as_json=as_json)
            return
    elif (suffix := splitext(file)[1].lower()) in (".mln", ".plp", ".lp"):
        text, facts = (read_text(path, MAX_PROGRAM_BYTES) for path in (file, evidence))
        if suffix == ".mln":
            program, observed = parse_mln(text, file=str(file), facts=facts, facts_file=str(evidence))
        else:
            program = parse_answer_sets(text, file=str(file), facts=facts, facts_file=str(evidence))
    else:
        raise ProgramError(
            f"--evidence {evidence}: {file} has its evidence in queries; expected a .mln, .plp or .lp file"
        )
    queries = [parse_query(query, program)] if query is not None else program.queries
    if observed:
        others = parse_query(f"?{{{observed[0][4:-1]}}} | {', '.join(observed)}.", program).observations
        queries = [replace(own, observations=(*own.observations, *others)) for own in queries]
    if not queries and not worlds:
        raise ProgramError(
            f"{file}: the program has no query of its own; give one, such as 'attribute=value'"
        )
    exact_options = [name for name, on in (("exact", exact), ("why", why), ("worlds", worlds)) if on]
    if samples is not None and exact_options:
        raise ProgramError(f"--samples {samples}: --{exact_options[0]} has exact answers only")
    reasoner = Reasoner(program, samples=samples or DEFAULT_SAMPLES, seed=seed)
    for question in queries or [Query()]:  # the empty query asks for worlds only
        if not as_json and queries:
            print_spans((_format_query(question), BOLD))
        if why and queries:
            from lcorpp.reasoning.explanation import explain

            found = explain(reasoner, question, count=worlds or WHY_WORLDS)
            answer, without, listed = found.answer, found.without, found.worlds
        else:
            answer, without = _ask(reasoner, question, exact) if queries else None, ()
            best_worlds = reasoner.list_worlds(question, worlds) if worlds else ()
            listed = tuple([(world, ()) for world in best_worlds])
        if best is not None and answer is not None:
            answer = _select_best(question, answer, best)
        report = _print_json if as_json else _print_report
        report(question, answer, without, _restore_worlds(listed, program.names), exact)
        if answer is None and (queries or not listed):
            raise UndefinedError(f"{file}: no possible world of positive measure has the evidence")


def _read_bounds(file: str | Path, error: ParseError | ProgramError) -> CredalProgram | None:
    """Read a program with probabilistic facts whose choices may have several answer sets.

    Args:
        error: of the program as one of P-log or ProbLog.

    Returns:
        None if the file is of another language, whose error is to be raised.

    Raises:
        ParseError: it has rules of clingo, but an error or a construct without translation.
    """
    from lcorpp.reasoning.choices.credal import parse_credal_program  # imports numpy
    from lcorpp.reasoning.language.answer_sets.credal_reader import has_answer_sets  # loads clingo

    text = read_text(file, MAX_PROGRAM_BYTES)
    if "::" not in text and not has_answer_sets(text):
        return None
    try:
        return parse_credal_program(text, file=str(file))
    except ParseError:
        if has_answer_sets(text) or any(words in str(error) for words in _SEVERAL_ANSWER_SETS):
            raise
        return None


def _print_bounds(program: CredalProgram, query: str | None, *, as_json: bool) -> None:
    """Print the lower and upper probability of the query, or of the program's own.

    Raises:
        ParseError, ProgramError, TooLargeError, UndefinedError: as of `bound_probability`; or no query.
    """
    from lcorpp.reasoning.choices.credal import bound_probability  # imports numpy

    own = program.program
    if query is not None and "{" not in query:
        subject, bar, conditions = query.partition("|")
        query = f"{{{subject.strip()}}} {bar} {conditions}".strip()
    queries = own.queries if query is None else [parse_query(query, own)]
    if not queries:
        raise ProgramError(f"{own.file}: the program has no query of its own; give one, such as 'atom'")
    for question in queries:
        bounds = bound_probability(program, question)
        if as_json:
            print_json({"query": str(question), **bounds._asdict()})
            continue
        print_spans((str(question), BOLD))
        print_spans(f"  lower {bounds.lower:.6f}, upper {bounds.upper:.6f}")
        if bounds.inconsistent:
            print_spans(f"  without choices that have no answer set, probability {bounds.inconsistent:.6f}")


def _has_decisions(file: str | Path) -> bool:
    """Whether a file may have decisions or utilities of ProbLog."""
    from lcorpp.reasoning.language.translation import problog_decisions  # rarely needed

    return problog_decisions.has_decisions(read_text(file, MAX_PROGRAM_BYTES))


def _print_decisions(file: str | Path, *, as_json: bool) -> None:
    """Print the best decisions of a program, and how much worse the next ones are.

    Raises:
        ParseError, TooLargeError, UndefinedError: as `choose_decisions` and `read_decision_problem`.
    """
    from lcorpp.reasoning.choices.decision_problems import (  # imports numpy
        choose_decisions,
        read_decision_problem,
    )

    best = choose_decisions(read_decision_problem(file))
    if as_json:
        record = {"decisions": best.choices, "utility": best.utility}
        if best.difference is not None:
            record |= {"difference": best.difference, "next": best.next_choices}
        print_json(record)
        return
    print_spans(("best decisions", BOLD), f": {_list_taken(best.choices)}")
    print_spans(f"  expected utility {best.utility:.6g}")
    if best.difference is not None:
        print_spans(f"  the next best, {_list_taken(best.next_choices)}, has {best.difference:.6g} less")


def _list_taken(choices: Mapping[str, bool]) -> str:
    """List the decisions that are taken."""
    taken = [name for name, is_taken in choices.items() if is_taken]
    return ", ".join(taken) or "none"


def _format_query(query: Query) -> str:
    """Return the text of a query, that of its own language if the program was translated."""
    return query.written or str(query)


def _restore_worlds(worlds: _Worlds, names: Mapping[str, str]) -> _Worlds:
    """Replace the names of a translated program by those of its source, and omit auxiliary attributes."""
    if not names:
        return worlds
    restored = []
    for world, fired in worlds:
        values = {
            restore_names(term, names): restore_names(value, names)
            for term, value in world.values.items()
            if not is_auxiliary(term, names)
        }
        rules = [
            replace(
                rule, statement=restore_names(rule.statement, names), effect=restore_names(rule.effect, names)
            )
            for rule in fired
        ]
        restored.append((replace(world, values=values), rules))
    return restored


def _ask(reasoner: Reasoner, query: Query, exact: bool) -> QueryAnswer:
    """Answer a query with a display of the progress."""
    with show_delayed_progress("answering") as advance:
        try:
            return reasoner.ask(query, exact=exact, progress=advance)
        except KeyboardInterrupt:
            words = "interrupted; this query and those after it have no answer"
            raise KeyboardInterrupt(words) from None


def _select_best(query: Query, answer: QueryAnswer, count: int) -> QueryAnswer:
    if not isinstance(answer, dict):
        raise ProgramError(f"--best {count}: {query} asks for a number, not for values")
    return dict(nsmallest(count, answer.items(), key=lambda pair: -pair[1]))


def _print_answer(query: Query, answer: QueryAnswer, exact: bool) -> None:
    """Print a number, or a table: one column for each attribute, and the probabilities."""
    if not isinstance(answer, dict):
        print_spans(f"  {_format_number(answer, exact)}")
        return
    rows = [(value,) if isinstance(value, str) else value for value in answer]
    if len(query.subjects) > 1:
        rows.insert(0, tuple(map(canonical_text, query.subjects)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(map(str.ljust, row, widths)) for row in rows]
    if len(query.subjects) > 1:
        print_spans(f"  {lines.pop(0)}".rstrip())
    for line, probability in zip(lines, answer.values(), strict=True):
        bar = (format_bar(float(probability)), CYAN)
        print_spans(f"  {line}  {_format_number(probability, exact)}  ", bar)


def _print_report(
    query: Query, answer: QueryAnswer | None, without: _Without, worlds: _Worlds, exact: bool
) -> None:
    if answer is not None:
        _print_answer(query, answer, exact)
    for condition, other in without:
        print_spans(f"\n  without {condition}:")
        if isinstance(other, str):
            print_spans(f"  {other}")
        else:
            _print_answer(query, other, exact)
    for number, (world, fired) in enumerate(worlds, start=1):
        print_spans((f"\n  world {number}, probability {_format_number(world.measure, exact)}:", BOLD))
        print_spans(f"  {', '.join(f'{term}={value}' for term, value in world.values.items())}")
        width = max((len(rule.effect) for rule in fired), default=0)
        for rule in fired:
            print_spans(f"    line {rule.at.line:<4} {rule.effect:<{width}}  {rule.statement}")


def _print_json(
    query: Query, answer: QueryAnswer | None, without: _Without, worlds: _Worlds, exact: bool
) -> None:
    """Print a line of JSON: query, answer, the answers without each condition, worlds."""

    def encode(answer: QueryAnswer | str | None) -> object:
        if isinstance(answer, dict):
            names = list(map(canonical_text, query.subjects))
            return [
                {"values": dict(zip(names, [v] if isinstance(v, str) else v, strict=True)),
                 "probability": encode(p)}
                for v, p in answer.items()
            ]  # fmt: skip
        interval = getattr(answer, "interval", None)
        if interval is not None:
            return {"estimate": interval.estimate, "low": interval.low, "high": interval.high}
        if isinstance(answer, str | None):
            return answer
        return str(answer) if exact else float(answer)

    record: dict[str, object] = {}
    if query != Query():
        record = {"query": _format_query(query), "answer": encode(answer)}
    if without:
        record["without"] = [
            {"condition": condition, "answer": encode(other)} for condition, other in without
        ]
    if worlds:
        record["worlds"] = [
            {"probability": encode(world.measure), "values": dict(world.values)}
            | ({"rules": [{"line": r.at.line, "effect": r.effect, "statement": r.statement} for r in fired]}
               if fired else {})
            for world, fired in worlds
        ]  # fmt: skip
    print_json(record)


def _format_number(probability: Numeric, exact: bool) -> str:
    """Return a probability as a fraction, a decimal number, or an estimate with its 95 % interval."""
    interval = getattr(probability, "interval", None)
    if interval is not None:
        return f"{interval:.6f}"
    if exact:
        return str(probability)
    shown_as_zero = 0 < probability < 5e-7  # with six decimals
    return f"{float(probability):.6g}" if shown_as_zero else f"{float(probability):.6f}"
