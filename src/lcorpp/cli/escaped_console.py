"""A console of rich that styles text, and prints control characters of foreign text as `\\x1b`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import IO, Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.file_proxy import FileProxy
from rich.segment import Segment
from rich.text import Text

from lcorpp.terminal import escape_controls, find_unescaped


class EscapedConsole(Console):
    """A console whose own styles and cursor movements are the only control characters of its output."""

    @property
    def file(self) -> IO[str]:
        return find_unescaped(super().file)  # type: ignore[arg-type]

    @file.setter
    def file(self, new_file: IO[str]) -> None:
        self._file = new_file

    def render_str(self, text: str, **options: Any) -> Text:
        """Escape a text before its width is computed; cells of tables are texts."""
        return super().render_str(escape_controls(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Escape the text of all segments; those of control codes are rich's own."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=escape_controls(segment.text))


class EscapedProxy(FileProxy):
    """Standard output or error during a live display, which it redraws below what is printed."""

    def write(self, text: str) -> int:
        return super().write(escape_controls(text))
