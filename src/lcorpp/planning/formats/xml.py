"""XML parsing that is safe for untrusted files: no document types, so no entities, and bounded nesting."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from xml.parsers import expat

from lcorpp.errors import LcorppError


class XmlReader(ABC):
    """Base class of readers: passes the elements of a file to the methods of a subclass.

    open: names of the open elements, outermost first; in `start`, the element's ancestors.

    Args:
        root: required name of the outermost element.
        max_depth: maximum nesting.
        join_text: whether to join adjacent pieces of text; their positions are then lost.
    """

    def __init__(self, *, root: str, max_depth: int, join_text: bool = False) -> None:
        self._root, self._max_depth, self._join_text = root, max_depth, join_text
        self.open: list[str] = []

    @abstractmethod
    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Handle a start tag."""

    @abstractmethod
    def end(self, name: str) -> None:
        """Handle an end tag."""

    @abstractmethod
    def text(self, text: str) -> None:
        """Handle a piece of text."""

    def comment(self, text: str) -> None:  # noqa: B027  (optional: most readers ignore comments)
        """Handle a comment; by default, ignore it."""

    @abstractmethod
    def make_error(self, line: int, column: int, message: str) -> LcorppError:
        """Return the exception to raise for an error at a place, both counted from 1."""

    def parse(self, data: str | bytes) -> None:
        """Parse a text, or the bytes of a file in the encoding that its first line declares.

        Raises the error of `make_error` if the file is malformed or contains a document type declaration.
        """
        # a decoded text no longer has the encoding that its first line declares
        self._expat = expat.ParserCreate("utf-8" if isinstance(data, str) else None)
        self._expat.buffer_text = self._join_text
        self._expat.StartDoctypeDeclHandler = self._refuse_doctype
        self._expat.StartElementHandler, self._expat.EndElementHandler = self._make_element_handlers()
        self._expat.CharacterDataHandler = self.text
        self._expat.CommentHandler = self.comment
        try:
            self._expat.Parse(data.encode("utf-8", "surrogatepass") if isinstance(data, str) else data, True)
        except expat.ExpatError as error:
            message = f"not well-formed XML: {expat.errors.messages[error.code]}"
            raise self.make_error(error.lineno, error.offset + 1, message) from None
        except (LookupError, ValueError) as error:  # an encoding unknown to Python or expat
            raise self.make_error(1, 1, f"cannot be decoded: {error}") from None

    @property
    def position(self) -> tuple[int, int]:
        """Line and column of the current tag or text, counted from 1."""
        return self._expat.CurrentLineNumber, self._expat.CurrentColumnNumber + 1

    def error(self, message: str) -> LcorppError:
        """Return an error at the current position."""
        return self.make_error(*self.position, message)

    def _refuse_doctype(self, *declaration: object) -> None:
        raise self.error("a document type declaration is refused; the format needs none")

    def _make_element_handlers(self) -> tuple[Callable[[str, dict[str, str]], None], Callable[[str], None]]:
        """Return the handlers of start and end tags; closures, because files have millions of tags."""
        names, root, max_depth = self.open, self._root, self._max_depth
        handle_start, handle_end, push, pop = self.start, self.end, names.append, names.pop

        def start(name: str, attributes: dict[str, str]) -> None:
            if not names and name != root:
                raise self.error(f"expected <{root}>, found <{name}>")
            if len(names) >= max_depth:
                raise self.error(f"<{name}> is nested too deeply; at most {max_depth} levels are read")
            handle_start(name, attributes)
            push(name)

        def end(name: str) -> None:
            pop()
            handle_end(name)

        return start, end
