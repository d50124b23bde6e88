"""The console styles its own output, and escapes the text of others."""

import io
import json
import re
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout

import pytest
from rich.table import Table
from rich.text import Text

from lcorpp.cli import console
from lcorpp.cli.escaped_console import EscapedConsole

STYLE = re.compile(r"\x1b\[[\d;]*m")
FOREIGN = "\x1b[2J\x9b5m\u202e"
SHOWN = r"\x1b[2J\x9b5m\u202e"


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self):
        return True


@contextmanager
def terminals(out=None):
    """Standard output and standard error as terminals, with new consoles; yields both."""
    made = Terminal() if out is None else out, Terminal()
    before = {name: vars(console).pop(name) for name in ("out", "err") if name in vars(console)}
    with redirect_stdout(made[0]), redirect_stderr(made[1]):
        yield made
    for name in ("out", "err"):
        vars(console).pop(name, None)
    vars(console).update(before)


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")


def test_text_tables_and_notes_are_escaped_and_styles_remain():
    table = Table("name")
    table.add_row(FOREIGN)
    with terminals() as (out, _):
        console.out.print(table, FOREIGN, Text(FOREIGN, style="bold"), style="yellow")
        console.print_note(FOREIGN)
        console.print_probability(FOREIGN, 0.5, 20)
        console.print_heading(1, FOREIGN, FOREIGN)
    assert "\x1b[33m" in out.getvalue()
    plain = STYLE.sub("", out.getvalue())
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]", plain)
    assert plain.count(SHOWN) == 7
    assert f"│ {SHOWN} │\n└{'─' * (len(SHOWN) + 2)}┘\n" in plain  # as wide as its border


def test_titles_of_progress_and_what_is_printed_meanwhile_are_escaped():
    with terminals() as (_, err), console.show_progress(f"reading {FOREIGN}", 2) as advance:
        print(f"above {FOREIGN}")
        print(f"above {FOREIGN}", file=sys.stderr)
        advance(1, 2)
    shown = err.getvalue()
    assert f"reading {SHOWN}" in STYLE.sub("", shown)
    assert shown.count(f"above {SHOWN}") == 2
    assert "\x1b[2J" not in shown
    assert "\x9b" not in shown


def test_a_display_does_not_redirect_what_is_no_terminal():
    with terminals(io.StringIO()) as (out, err), console.show_progress("reading"):
        print("a result")
    assert out.getvalue() == "a result\n"
    assert "a result" not in err.getvalue()


def test_lines_without_rich():
    with terminals() as (out, _):
        console.print_spans(("title\x1b[2J", console.BOLD), " end")
    assert out.getvalue() == "\x1b[1mtitle\\x1b[2J\x1b[0m end\n"


@pytest.mark.parametrize(("value", "bar"), [("", "\x1b[36m##\x1b[0m"), ("1", "##")])
def test_no_color_leaves_out_colours(value, bar, monkeypatch):
    monkeypatch.setenv("NO_COLOR", value)
    with terminals() as (out, _):
        console.print_spans(("title", console.BOLD), " ", ("##", console.CYAN))
    assert out.getvalue() == f"\x1b[1mtitle\x1b[0m {bar}\n"


def test_json_remains_json():
    content = {"name": "\x1b[2J\x7f\x9b é"}
    with terminals() as (out, _):
        console.print_json(content)
    assert json.loads(out.getvalue()) == content
    assert out.getvalue().isascii()
    assert "\x7f" not in out.getvalue()


def test_bars_and_boxes_of_ascii():
    written = io.BytesIO()
    stream = io.TextIOWrapper(written, encoding="ascii", write_through=True)
    table = Table("name")
    table.add_row("a")
    with redirect_stdout(stream):
        assert console.format_bar(0.5, 8) == "####"
        EscapedConsole().print(table)
    assert b"| a    |" in written.getvalue()
