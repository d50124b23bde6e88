"""ProbLog to P-log: read the clauses, and translate them as they are if possible, otherwise their instances.

Clauses of constants and variables without arithmetic keep their form, see `problog_lifted`. If the program
needs more, Prolog's own evaluation finds the ground instances on which its queries and evidence depend, and
decides what does not depend on chance, see `problog_grounded`.
"""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.reasoning.language.translation.names import Translation
from lcorpp.reasoning.language.translation.problog_clauses import make_clauses
from lcorpp.reasoning.language.translation.problog_grounded import translate_instances
from lcorpp.reasoning.language.translation.problog_lifted import is_liftable, translate_clauses
from lcorpp.reasoning.language.translation.prolog_reader import PrologReader, Token


def translate_problog(text: str, file: str, tokens: Sequence[Token]) -> Translation:
    """Translate a ProbLog program, given by its text and its tokens.

    Raises:
        SourceIssue: the program has an error, or a construct without translation, which the message names.
    """
    clauses = make_clauses(PrologReader(text, file, tokens).read_clauses())
    return translate_clauses(clauses) if is_liftable(clauses) else translate_instances(clauses)
