"""Recognise programs of other systems: ProbLog is translated, plingo is refused by name."""

from __future__ import annotations

import re
from collections.abc import Sequence

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import find_place, list_line_starts
from lcorpp.reasoning.language.translation.names import Translation
from lcorpp.reasoning.language.translation.problog_clauses import make_clauses
from lcorpp.reasoning.language.translation.problog_grounded import translate_instances
from lcorpp.reasoning.language.translation.problog_lifted import is_liftable, translate_clauses
from lcorpp.reasoning.language.translation.prolog_reader import PrologReader, Token, list_tokens

_PLOG_FORMS = {
    "random": "random(f(D) : {X : p(X)}) :- B",
    "pr": "pr(f(D)=x | B) = 1/4",
    "obs": "obs(f(D)=x)",
    "do": "do(f(D)=x)",
    "query": "?{f(D)=x}",
    "evidence": "obs(f(D)=x)",
    "problog": "random(p) and pr(p) = 1/4",
    "weight": "pr-atoms, as P-log has no weights",
    "log": "pr-atoms, as P-log has no weights",
}
"""Theory atoms of plingo, and what P-log has in their place."""

_PLINGO = re.compile(rf"& ({'|'.join(_PLOG_FORMS)}) [({{]")

_PROBLOG = re.compile(
    r"(?:\b[A-Z_]\w*|[\d.]|[)?]) :: |\\\+ |:- (?:use_module|consult|initialization) "
    r"|\A(?!.* : )(?:.* \. )?(?:query|evidence) \( ",
    re.DOTALL,
)
"""Marks in a text with spaces between its tokens. A P-log program has declarations beside query(...)."""


def translate_other_system(text: str, file: str) -> Translation | None:
    """Translate a program of ProbLog; None if the text is neither of ProbLog nor of plingo.

    Raises:
        SourceIssue: the program has an error or a construct without translation.
    """
    tokens = list_tokens(text)
    spaced = " ".join([token.text for token in tokens])
    if found := _PLINGO.search(spaced):
        words = f"&{found[1]} is not translated; expected {_PLOG_FORMS[found[1]]}"
        start = tokens[spaced.count(" ", 0, found.start())].start
        raise _refuse("plingo", SourceIssue(find_place(file, list_line_starts(text), start), words))
    if not _PROBLOG.search(spaced):
        return None
    try:
        return _translate_problog(text, file, tokens)
    except SourceIssue as issue:
        raise _refuse("ProbLog", issue) from None


def _translate_problog(text: str, file: str, tokens: Sequence[Token]) -> Translation:
    """Translate a ProbLog program, given by its text and its tokens.

    Clauses of constants and variables without arithmetic keep their form, see `problog_lifted`. If the
    program needs more, Prolog's own evaluation finds the ground instances on which its queries and evidence
    depend, and decides what does not depend on chance, see `problog_grounded`.

    Raises:
        SourceIssue: the program has an error, or a construct without translation, which the message names.
    """
    clauses = make_clauses(PrologReader(text, file, tokens).read_clauses())
    return translate_clauses(clauses) if is_liftable(clauses) else translate_instances(clauses)


def _refuse(system: str, issue: SourceIssue) -> SourceIssue:
    message = f"this is a {system} program: {issue.message}; see docs/background/coming-from.md"
    return SourceIssue(issue.at, message)
