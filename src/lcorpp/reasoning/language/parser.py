"""Parser: read P-log programs, queries and terms from text; errors have line and column.

A recursive descent parser in linear time: `lexer`, `expressions`, `declarations`, `queries`, `statements`.
A program is then desugared (`desugar`) and checked (`Program`).
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from contextlib import contextmanager
from os import PathLike
from os.path import splitext
from typing import TYPE_CHECKING

from lcorpp.errors import ParseError, ProgramError, check_type
from lcorpp.files import read_text
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.checker import drop_ill_sorted
from lcorpp.reasoning.language.desugar import desugar
from lcorpp.reasoning.language.expressions import parse_value
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import END, Cursor, make_depth_error
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.queries import parse_question
from lcorpp.reasoning.language.signature import check_record_names
from lcorpp.reasoning.language.statements import parse_statements
from lcorpp.reasoning.language.syntax import Expression, Query, Semantics, Statement

if TYPE_CHECKING:
    from fractions import Fraction
    from pathlib import Path

    from lcorpp.reasoning.language.translation.problog_decisions import Utility

MAX_PROGRAM_BYTES = 2**24
"""Maximum size of a program's file; a program of this size would take hours to ground."""


def read_plog(path: str | Path, *, semantics: Semantics | None = None, strict: bool = True) -> Program:
    """Read and check a program by the end of its file's name: P-log or ProbLog, Markov logic (``.mln``), a
    Bayesian network (``.bif``), or tables (``.csv``, ``.toml``).

    Args:
        semantics, strict: as in `parse_plog`.

    Raises:
        FileError: the file cannot be read.
        ParseError: the text does not follow the grammar.
        ProgramError: a name, sort, arity or probability in it is wrong.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import Reasoner, read_plog
        >>> _ = Path("die.plog").write_text("sides = {1..6}. roll : sides. random(roll).")
        >>> Reasoner(read_plog("die.plog")).expect("roll")
        3.5
    """
    check_type(path, (str, PathLike), "path", ProgramError)
    suffix = splitext(path)[1].lower()
    if suffix == ".bif":
        from lcorpp.reasoning.language.networks.bif import read_bif  # imports numpy

        return read_bif(path)
    if suffix == ".mln":
        return parse_mln(read_text(path, MAX_PROGRAM_BYTES), file=str(path))[0]
    if suffix in (".csv", ".toml"):
        from lcorpp.reasoning.language.networks.table_files import read_tables  # imports numpy

        return read_tables(path)
    return parse_plog(read_text(path, MAX_PROGRAM_BYTES), file=str(path), semantics=semantics, strict=strict)


def parse_plog(
    text: str, *, file: str = "<text>", semantics: Semantics | None = None, strict: bool = True
) -> Program:
    """Parse and check a P-log program given as text, in the dialect of plog 1.0, plog 2.0 or the papers.

    Programs of ProbLog and plingo are recognised and translated.

    Args:
        file: the file name in error messages.
        semantics: the meaning of `do` and Condition 1. Default: that of a directive ``#semantics 2018.``;
            without one, 2018 if the text has a construct of plog 2.0 (a section header, ``#sort``,
            ``random(a, p)``, ``:+``), else 2009.
        strict: whether to reject what the public systems accept against their manual: a constant outside of
            its sort, a wrong number of arguments, an attribute with the name of a record. With
            ``strict=False`` statements that therefore have no instance are removed; see `drop_ill_sorted`.

    Raises:
        ParseError: the text does not follow the grammar.
        ProgramError: a name, sort, arity or probability in it is wrong.

    Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 2; Balai, Gelfond and Zhang, 2019, section 3;
    the manual of plog 2.0.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> rain = parse_plog('''
        ... rain, wet : boolean.
        ... random(rain). random(wet).
        ... pr(rain) = 0.2. pr(wet | rain) = 0.9. pr(wet | -rain) = 0.1.
        ... ''')
        >>> Reasoner(rain).posterior("rain", {"wet": "true"})  # 0.18 : 0.08
        Distribution(true: 0.6923, false: 0.3077)
    """
    check_type(text, str, "text", ProgramError)
    check_type(file, str, "file", ProgramError)
    check_type(strict, bool, "strict", ProgramError)
    try:
        return _parse_own(text, file, semantics, strict)
    except (ParseError, ProgramError):
        from lcorpp.reasoning.language.translation.recognition import (  # rarely needed
            is_answer_set_program,
            translate_problog,
        )

        with _open_cursor(text, file):
            if is_answer_set_program(text, file):
                return parse_answer_sets(text, file=file)
            translated = translate_problog(text, file)
        if translated is None:
            raise
    return Program(file, translated.statements, semantics or "2009", translated.names)


def parse_mln(
    text: str, *, file: str = "<text>.mln", facts: str = "", facts_file: str = "<text>.db"
) -> tuple[Program, list[str]]:
    """Parse a Markov logic network given as text; it becomes a P-log program.

    Args:
        facts: the text of a file of evidence, whose constants are in the domains, too.

    Returns:
        The program, and the evidence as observations of a query.

    Raises:
        ParseError: a text does not follow the format, or has a construct that is not translated, by name.
    """
    from lcorpp.reasoning.language.translation.mln_reader import read_facts, read_mln  # rarely needed
    from lcorpp.reasoning.language.translation.mln_translation import (
        add_constants,
        list_observations,
        translate_mln,
    )

    with _locate_issues(text):
        network = read_mln(text, file)
    with _locate_issues(facts):
        literals = read_facts(facts, facts_file)
        add_constants(network, literals)
    with _locate_issues(text):
        translated, names = translate_mln(network)
    program = _parse_own(translated, f"{file} (as P-log)", "2009", True)
    return Program(program.file, program.statements, "2009", names), list_observations(network, literals)


def parse_answer_sets(
    text: str, *, file: str = "<text>.plp", facts: str = "", facts_file: str = "<text>.evid"
) -> Program:
    """Parse a program of plingo or LPMLN given as text; it is grounded by clingo and becomes P-log.

    Args:
        facts: the text of a file of evidence: further rules, such as ``:- not alarm.``

    Raises:
        ParseError: the text does not follow the grammar of clingo, has a construct that is not translated,
            by name, or too many ground rules.
    """
    # rarely needed; they load clingo
    from lcorpp.reasoning.language.answer_sets.asp_grounding import ground_answer_sets
    from lcorpp.reasoning.language.answer_sets.asp_translation import translate_answer_sets
    from lcorpp.reasoning.language.answer_sets.plingo_reader import rewrite_plingo

    with _locate_issues(text):
        rewritten = rewrite_plingo(text, file)
    with _locate_issues(facts):
        rewrite_plingo(facts, facts_file, rewritten)
    with _locate_issues(text, facts, facts_file):
        ground = ground_answer_sets(rewritten.lines, rewritten.places)
        translated, names = translate_answer_sets(rewritten, ground)
    program = _parse_own(translated, f"{file} (as P-log)", "2009", True)
    return Program(program.file, program.statements, "2009", names)


def parse_credal(text: str, *, file: str = "<text>.lp") -> tuple[Program, dict[str, dict[str, Fraction]]]:
    """Parse a program with probabilistic facts and rules of clingo; see `credal.CredalProgram`."""
    from lcorpp.reasoning.language.answer_sets.credal_reader import translate_credal  # rarely needed

    with _locate_issues(text):
        translated, names, choices = translate_credal(text, file)
    program = _parse_own(translated, f"{file} (as P-log)", "2009", True)
    terms = {canonical_text(parse_term(text, file)): values for text, values in choices.items()}
    return Program(program.file, program.statements, "2009", names), terms


def parse_decisions(
    text: str, *, file: str = "<text>.pl"
) -> tuple[Program, dict[str, str], tuple[Utility, ...]]:
    """Parse a program of DTProbLog given as text; see `decision_problems.DecisionProblem` for the result."""
    from lcorpp.reasoning.language.translation.problog_decisions import translate_decisions  # rarely needed

    with _open_cursor(text, file):
        (statements, names), decisions, utilities = translate_decisions(text, file)
    return Program(file, statements, "2009", names), decisions, utilities


def parse_learnable(text: str, *, file: str = "<text>.pl") -> tuple[Program, frozenset[int]]:
    """Parse a program of ProbLog with numbers to be learnt, `t(_)::a`.

    Returns:
        The program, and the lines of the clauses whose numbers are not learnt.

    Raises:
        ParseError: as `parse_plog`.
    """
    from lcorpp.reasoning.language.translation.problog_learnable import translate_learnable  # rarely needed

    with _open_cursor(text, file):
        (statements, names), fixed = translate_learnable(text, file)
    return Program(file, statements, "2009", names), fixed


def _parse_own(text: str, file: str, semantics: Semantics | None, strict: bool) -> Program:
    """Parse a program of P-log."""
    with _open_cursor(text, file) as cursor:
        statements = tuple(parse_statements(cursor))
    dialect: Semantics = "2018" if cursor.uses_plog2 else "2009"
    chosen = (cursor.semantics or dialect) if semantics is None else semantics
    try:
        return _make_program(file, desugar(statements, dialect), chosen, strict)
    except SourceIssue as issue:
        raise ProgramError(str(issue)) from None


def _make_program(
    file: str, statements: tuple[Statement, ...], semantics: Semantics, strict: bool
) -> Program:
    """Make a program; the message of a strict refusal ends with a hint if the lenient mode reads it."""
    if not strict:
        return Program(file, drop_ill_sorted(statements), semantics)
    try:
        program = Program(file, statements, semantics)
        check_record_names(program.signature)
    except (SourceIssue, ProgramError) as error:
        try:
            _make_program(file, statements, semantics, False)
        except (SourceIssue, ProgramError):
            raise error from None
        raise ProgramError(f"{error}; strict=False (lcorpp ask --lenient) reads the program") from None
    return program


def parse_query(text: str, program: Program) -> Query:
    """Parse a query about `program`: ``a``, ``a=v, b=w | obs(c=u), do(d=x)`` or ``?{a=v} | obs(c=u).``.

    Attributes without values and braces ask for their joint distribution, `E[a+b]` for an expectation, any
    other query for a probability; see docs/reference/plog/queries.md.

    Raises:
        ParseError: the text is not a query, or contains a name unknown to `program`. The file is ``<query>``.

    Examples:
        >>> from lcorpp.reasoning import ask, parse_plog, parse_query
        >>> die = parse_plog("sides = {1..6}. roll : sides. random(roll).")
        >>> query = parse_query("?E[roll] | obs(roll > 4).", die)
        >>> str(query), str(ask(die, query))
        ('?E[roll] | obs(roll>4).', '11/2')
    """
    check_type(text, str, "query", ProgramError)
    check_type(program, Program, "program", ProgramError)
    with _open_cursor(text, "<query>", program.quoted_names) as cursor:
        query = parse_question(cursor)
        cursor.accept(".")
        cursor.expect(END)
        return program.resolve_query(query)


def parse_term(text: str, file: str, names: Container[str] = ()) -> Expression:
    """Parse one term or value, such as the key ``roll(d1)`` of evidence; `names` as in `Cursor`.

    Raises:
        ParseError: the text is not a term.
    """
    with _open_cursor(text, file, names) as cursor:
        expression = parse_value(cursor)
        cursor.expect(END)
        return expression


@contextmanager
def _open_cursor(text: str, file: str, names: Container[str] = ()) -> Iterator[Cursor]:
    """Yield a cursor over the text, and convert a SourceIssue to ParseError."""
    with _locate_issues(text):
        cursor = Cursor(text, file, names)
        try:
            yield cursor
        except RecursionError:  # the caller's own calls leave little of Python's stack
            raise make_depth_error(cursor.at) from None


@contextmanager
def _locate_issues(text: str, other: str = "", other_file: str | None = None) -> Iterator[None]:
    """Convert a SourceIssue about a text, or about another one of another file, to ParseError."""
    try:
        yield
    except SourceIssue as issue:
        at = issue.at
        lines = re.split(r"\r\n|\r|\n", other if at.file == other_file else text)
        line = lines[at.line - 1] if at.line <= len(lines) else ""
        raise ParseError(at.file, at.line, at.column, issue.message, line) from None
