"""Recognise programs of other systems: of ProbLog, which are translated here, and of plingo."""

from __future__ import annotations

import re
from collections.abc import Sequence

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.translation.names import Translation
from lcorpp.reasoning.language.translation.problog_clauses import make_clauses
from lcorpp.reasoning.language.translation.problog_grounded import translate_instances
from lcorpp.reasoning.language.translation.problog_lifted import is_liftable, translate_clauses
from lcorpp.reasoning.language.translation.prolog_reader import PrologReader, Token, list_tokens

_PLINGO = re.compile(r"& (?:random|pr|obs|do|query|evidence|problog|weight|log) [({]|:~ ")

_ANSWER_SET_SUFFIXES = (".lp", ".plp")

_PLOG = re.compile(r"(?:random|pr) \(|(?:\A|\. )[^.]* : ")
"""Marks of P-log, in a text with spaces between its tokens: a selection, a pr-atom, a declaration."""

_PROBLOG = re.compile(
    r"(?:\b[A-Z_]\w*|[\d.]|[)?]) :: |\\\+ |:- (?:use_module|consult|initialization) "
    r"|\A(?!.* : )(?:.* \. )?(?:query|evidence) \( ",
    re.DOTALL,
)
"""Marks in a text with spaces between its tokens. A P-log program has declarations beside query(...)."""


def is_answer_set_program(text: str, file: str) -> bool:
    """Whether a program is in the language of clingo: by its weights, or by the end of the file's name.

    A program without weights in a file ``.lp`` or ``.plp`` may be of P-log or ProbLog, too.
    """
    spaced = " ".join([token.text for token in list_tokens(text)])
    if _PLINGO.search(spaced):
        return True
    return file.lower().endswith(_ANSWER_SET_SUFFIXES) and not (
        _PLOG.search(spaced) or _PROBLOG.search(spaced)
    )


def translate_problog(text: str, file: str) -> Translation | None:
    """Translate a program of ProbLog; None if the text is none.

    Raises:
        SourceIssue: the program has an error or a construct without translation.
    """
    tokens = list_tokens(text)
    spaced = " ".join([token.text for token in tokens])
    if not _PROBLOG.search(spaced):
        return None
    try:
        return _translate_problog(text, file, tokens)
    except SourceIssue as issue:
        message = f"this is a ProbLog program: {issue.message}; see docs/background/coming-from.md"
        raise SourceIssue(issue.at, message) from None


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
