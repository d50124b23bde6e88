"""Text of others cannot control the terminal, and any text can be written in any encoding."""

import io
import logging
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout

import pytest

from lcorpp.log_output import StandardErrorHandler
from lcorpp.terminal import EscapedStream, escape_controls, escape_output


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("\x1b[31mred", r"\x1b[31mred"),
        ("\x1b]0;title\x07", r"\x1b]0;title\x07"),
        ("a\rb", r"a\x0db"),
        ("a\x9b2J\x7f\x00", r"a\x9b2J\x7f\x00"),
        ("\u202eevil\u202c \u2066x\u2069", r"\u202eevil\u202c \u2066x\u2069"),
        ("a\tb\r\nc\n", "a\tb\r\nc\n"),
        ("äöü שלום 漢字 █", "äöü שלום 漢字 █"),
    ],
)
def test_control_characters_are_visible(text, expected):
    assert escape_controls(text) == expected


@contextmanager
def ascii_streams():
    """Standard output and standard error in ASCII; yields what is written."""
    written = io.BytesIO(), io.BytesIO()
    out, err = (io.TextIOWrapper(content, encoding="ascii", write_through=True) for content in written)
    with redirect_stdout(out), redirect_stderr(err):
        yield written


def test_all_ways_to_write_are_escaped():
    with ascii_streams() as (out, err):
        with escape_output():
            print("\x1b[2J printed")
            sys.stderr.write("\x1b[2J written\n")
            assert not hasattr(sys.stdout, "buffer")  # no library writes around it
        assert not isinstance(sys.stdout, EscapedStream)
        assert out.getvalue() == b"\\x1b[2J printed\n"
        assert err.getvalue() == b"\\x1b[2J written\n"


def test_what_the_encoding_lacks_is_replaced():
    with ascii_streams() as (out, err):
        with escape_output():
            print("é █")
            print("é █", file=sys.stderr)
        assert out.getvalue() == err.getvalue() == b"\\xe9 \\u2588\n"


def test_a_closed_output_remains_closed():
    with redirect_stdout(None), escape_output():
        print("nothing")
        assert sys.stdout is None


def test_a_traceback_is_escaped():
    with ascii_streams():
        with pytest.raises(ZeroDivisionError), escape_output():
            raise ZeroDivisionError
        assert isinstance(sys.stderr, EscapedStream)  # the interpreter prints the traceback later


def test_the_log_is_escaped_in_any_process():
    record = logging.LogRecord("lcorpp", logging.INFO, "", 0, "name %s", ("\x1b[2J",), None)
    with ascii_streams() as (_, err):
        StandardErrorHandler().emit(record)
        assert err.getvalue() == b"lcorpp: name \\x1b[2J\n"
