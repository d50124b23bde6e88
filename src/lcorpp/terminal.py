"""Text on standard output and standard error: control characters of foreign text appear as `\\x1b`."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

# C0 except newline, tab and the return of a line end; DEL, C1, overrides and isolates of the text direction
_CONTROLS = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]|\r(?!\n)")


def escape_controls(text: str) -> str:
    r"""Return a text whose control characters are visible, e.g. ``\x1b``: a terminal cannot obey it.

    Newline and tab remain, as does the direction of text that needs no override.
    """
    return _CONTROLS.sub(_escape, text)


def _escape(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}"


class EscapedStream(io.TextIOBase):
    r"""A stream that passes text on by `escape_controls`.

    It has no `buffer`, so that no library writes around it.

    Attributes:
        unescaped: the stream below, for escape codes of our own. What its encoding lacks is written as
            ``\xe9`` or ``\u2588``.
    """

    def __init__(self, stream: TextIO) -> None:
        self.unescaped = stream
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self.unescaped.encoding

    @property
    def errors(self) -> str | None:  # type: ignore[override]
        return self.unescaped.errors

    def write(self, text: str) -> int:
        self.unescaped.write(escape_controls(text))
        return len(text)

    def flush(self) -> None:
        self.unescaped.flush()

    def writable(self) -> bool:
        return True

    def isatty(self) -> bool:
        return self.unescaped.isatty()

    def fileno(self) -> int:
        return self.unescaped.fileno()


def find_unescaped(stream: TextIO) -> TextIO:
    """Return the stream below an `EscapedStream`; any other one itself."""
    return stream.unescaped if isinstance(stream, EscapedStream) else stream


@contextmanager
def escape_output() -> Iterator[None]:
    """Within this block, standard output and standard error are `EscapedStream`.

    After an unexpected error they remain so, as the interpreter then prints the traceback.
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (
        stream if stream is None or isinstance(stream, EscapedStream) else EscapedStream(stream)
        for stream in before
    )
    try:
        yield
    except Exception:
        raise
    except BaseException:
        sys.stdout, sys.stderr = before
        raise
    sys.stdout, sys.stderr = before
