"""The grammar of docs/reference/plog/grammar.md generates what the parser reads, and derives our programs."""

from __future__ import annotations

import random
import re
from functools import cache
from pathlib import Path

import pytest

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import Cursor
from lcorpp.reasoning.language.statements import parse_statements

ROOT = Path(__file__).parents[3]
PAGES = ROOT / "docs" / "reference" / "plog"

TOKENS = {
    "name": ("[a-z][A-Za-z0-9_']*", ["a", "b", "f", "p"]),
    "integer_name": ("[a-z][A-Za-z0-9_']*", ["k"]),
    "variable": (r"_*[A-Z][A-Za-z0-9_']*|_", ["X", "Y"]),
    "hash_name": (r"#[a-z][A-Za-z0-9_']*", ["#s", "#t"]),
    "integer": ("[0-9]+", ["1", "2", "3"]),
    "decimal": (r"[0-9]*\.[0-9]+", ["0.5"]),
}
"""Kind of a token -> its pattern and examples."""

BEYOND = (
    "expected an integer",
    "is not allowed here; expected a value",
    "is not a number",
    "is a literal; expected a value",
    "'-' before a literal with a value",
    "is not an argument of the record",
    "expected an attribute in E[...]",
    "a formula of more than 1000 cases",
)
"""Messages of the restrictions that the page lists below the grammar."""


def read_grammar() -> dict[str, object]:
    """Read the rules: ("or" or "all", parts), ("many" or "maybe", part), the name of a rule, a "literal"."""
    page = (PAGES / "grammar.md").read_text(encoding="utf-8")
    text = re.search(r"^```ebnf\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)[1]
    words = [*re.findall(r'"[^"]+"|\w+|[=|{}()\[\]]|\n(?=\w)', text), "\n"]
    position = 0

    def read_choice() -> object:
        nonlocal position
        parts = [read_sequence()]
        while words[position] == "|":
            position += 1
            parts.append(read_sequence())
        return ("or", parts)

    def read_sequence() -> object:
        nonlocal position
        parts: list[object] = []
        while words[position] not in ("|", "}", "]", ")", "\n"):
            word = words[position]
            position += 1
            if kind := {"{": "many", "[": "maybe", "(": "group"}.get(word):
                inside = read_choice()
                position += 1
                parts.append(inside if kind == "group" else (kind, inside))
            else:
                parts.append(word)
        return ("all", parts)

    rules: dict[str, object] = {}
    while position < len(words):
        name = words[position]
        position += 2
        rules[name] = read_choice()
        position += 1
    return rules


RULES = read_grammar()


def generate(node: object, choose: random.Random, used: set[int], depth: int = 0) -> list[str]:
    """Return the tokens of a random string; `used` collects the alternatives that occur in it."""
    if isinstance(node, str):
        if node in TOKENS:
            return [choose.choice(TOKENS[node][1])]
        return [node[1:-1]] if node[0] == '"' else generate(RULES[node], choose, used, depth + 1)
    kind, inside = node
    if kind == "all":
        return [token for part in inside for token in generate(part, choose, used, depth)]
    if kind == "or":
        chosen = inside[0] if depth > 12 else choose.choice(inside)
        used.add(id(chosen))
        return generate(chosen, choose, used, depth)
    count = 0 if depth > 12 else choose.choice((0, 0, 1, 2) if kind == "many" else (0, 1))
    return [token for _ in range(count) for token in generate(inside, choose, used, depth)]


def list_alternatives(node: object) -> list[int]:
    if isinstance(node, str):
        return []
    kind, inside = node
    parts = inside if kind in ("or", "all") else [inside]
    own = [id(part) for part in parts] if kind == "or" else []
    return own + [number for part in parts for number in list_alternatives(part)]


def parse(text: str) -> int:
    """Return the number of statements that the parser reads."""
    return len(list(parse_statements(Cursor(text, "<text>"))))


def test_the_parser_reads_what_the_grammar_generates() -> None:
    choose = random.Random(1)
    used: set[int] = set()
    read, beyond = 0, set()
    for _ in range(1500):
        own: set[int] = set()
        text = " ".join(generate("statement", choose, own))
        try:
            parse(f"#const k = 2. {text}")
        except SourceIssue as issue:
            (reason,) = [words for words in BEYOND if words in issue.message] or [f"{text}: {issue}"]
            assert reason in BEYOND, reason
            beyond.add(reason)
            continue
        used |= own
        read += 1
    assert read > 750
    assert beyond == set(BEYOND)
    wanted = {
        number for name, rule in RULES.items() if name != "program" for number in list_alternatives(rule)
    }
    assert wanted <= used


def accepts(text: str) -> bool:
    """Whether the grammar derives a text."""
    words = Cursor(text, "<text>").texts[:-2]

    @cache
    def ends_of_rule(name: str, start: int) -> frozenset[int]:
        return frozenset(ends(RULES[name], start))

    def ends(node: object, start: int) -> set[int]:
        """Return where a derivation of the node that begins at `start` can end."""
        if isinstance(node, str):
            if node in RULES:
                return set(ends_of_rule(node, start))
            if start == len(words):
                return set()
            word = words[start]
            fits = word == node[1:-1] if node[0] == '"' else re.fullmatch(TOKENS[node][0], word)
            return {start + 1} if fits and (word not in ("not", "mod") or node[0] == '"') else set()
        kind, inside = node
        if kind == "or":
            return {end for part in inside for end in ends(part, start)}
        if kind == "all":
            reached = {start}
            for part in inside:
                reached = {end for place in reached for end in ends(part, place)}
            return reached
        reached, new = {start}, {start}
        while new:
            new = {end for place in new for end in ends(inside, place)} - reached
            reached |= new
            if kind == "maybe":
                break
        return reached

    place = 0
    while place < len(words):  # the first full stop that ends a statement
        reached = ends("statement", place)
        if not reached:
            return False
        place = min(reached)
    return True


EXAMPLES = [
    *(
        block
        for path in sorted(PAGES.glob("*.md"))
        for block in re.findall(
            r"^```plog\n(.*?)^```$", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
        )
    ),
    *(path.read_text() for path in sorted((ROOT / "tests" / "plog").glob("*.plog"))),
    (ROOT / "src/lcorpp/domains/intention/knowledge.plog").read_text(),
]


@pytest.mark.parametrize("text", EXAMPLES, ids=range(len(EXAMPLES)))
def test_the_grammar_derives_the_programs_that_are_written(text: str) -> None:
    try:
        assert parse(text)
    except SourceIssue:
        assert "% refused" in text
        assert not accepts(text)
    else:
        assert accepts(text)


@pytest.mark.parametrize(
    "text", ["p :- q", "p.q : .", "[r] p :- q.", "a = {1,}.", "? .", "pr(p) = .", "p :- not not q."]
)
def test_the_grammar_excludes_what_the_parser_refuses(text: str) -> None:
    assert not accepts(text)
    with pytest.raises(SourceIssue):
        parse(text)
