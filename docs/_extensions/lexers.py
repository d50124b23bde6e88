"""Colours for languages that Pygments does not know: P-log, ProbLog and POMDP files."""

from __future__ import annotations

from typing import Any

from pygments.lexer import RegexLexer, words
from pygments.lexers.special import TextLexer
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text


class PlogLexer(RegexLexer):
    """P-log in its dialects, and ProbLog."""

    name = "P-log"
    tokens = {  # noqa: RUF012 (as Pygments declares it)
        "root": [
            (r"%.*", Comment),
            (r"\s+", Text),
            (r"\?", Keyword),
            (r"\[\w+(\([^)]*\))?\](?=\s*(random|pr))", Name.Label),
            (
                words(("random", "pr", "obs", "do", "not", "evidence", "query"), prefix=r"\b", suffix=r"\b"),
                Keyword,
            ),
            (
                words(("sorts", "attributes", "statements", "boolean"), prefix=r"\b", suffix=r"\b"),
                Keyword.Type,
            ),
            (r"#\w+|&\w+", Keyword.Type),
            (r"\d+(?:\.\d+)?(?!\.\d)|\.\d+", Number),
            (r'"[^"\n]*"|\'[^\'\n]*\'', String),
            (r"[A-Z_]\w*", Name.Variable),
            (r"\w+", Name),
            (r":-|\+-|:\+|->|\\\+|::|<-|!=|<=|>=|\.\.|[=<>|*/+\-:^@~]", Operator),
            (r"[()\[\]{},.;\\&]", Punctuation),
        ]
    }


class PomdpLexer(RegexLexer):
    """Cassandra's POMDP files."""

    name = "POMDP"
    tokens = {  # noqa: RUF012
        "root": [
            (r"#.*", Comment),
            (r"\s+", Text),
            (r"(discount|values|states|actions|observations|start)(?=[\w ]*:)", Keyword),
            (r"\b[TOR](?=\s*:)", Keyword),
            (r"\b(uniform|identity|reward|cost|include|exclude|reset)\b", Keyword.Constant),
            (r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?(?![\w-])", Number),
            (r"[\w-]+", Name),
            (r"[:*.]", Punctuation),
        ]
    }


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    lexers = {
        "plog": PlogLexer,
        "problog": PlogLexer,
        "pomdp": PomdpLexer,
        "csv": TextLexer,
        "ebnf": TextLexer,
    }
    for name, lexer in lexers.items():
        app.add_lexer(name, lexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
