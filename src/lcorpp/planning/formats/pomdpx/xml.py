"""XML read without danger: no document types, no entities, bounded nesting, and a place for every word.

Files of APPL's formats come from strangers. What is read here is a plain tree of elements.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.parsers import expat

from lcorpp.errors import ParseError, expected_one_of
from lcorpp.planning.formats.numbers import finite_numbers, first_fault
from lcorpp.values import Array

MAX_DEPTH = 1000
"""The deepest nesting: a decision diagram takes two levels for each variable on a path."""

_WORD = re.compile(r"[^ \t\r\n]+")
_LINE_END = re.compile(r"\r\n|\r|\n")
_NO_ATTRIBUTES: dict[str, str] = {}


class Element:
    """An element with its place; its text is that before its first child."""

    __slots__ = ("attributes", "children", "column", "length", "line", "name", "pieces", "text")

    def __init__(self, name: str, attributes: dict[str, str], line: int, column: int) -> None:
        self.name, self.attributes, self.line, self.column = name, attributes, line, column
        self.children: list[Element] = []
        self.text = ""
        self.length = 0  # of the text so far, while it is read
        self.pieces: list[tuple[int, int, int]] = []  # where the text goes on: offset, line, column

    def words(self) -> list[str]:
        """The words of the text."""
        return _WORD.findall(self.text)

    def place(self, word: int | None) -> tuple[int, int]:
        """Line and column of a word of the text, or of the element."""
        if word is None:
            return self.line, self.column
        begins = [match.start() for match in _WORD.finditer(self.text)]
        offset = begins[word] if word < len(begins) else len(self.text)
        at, line, column = max(
            piece for piece in self.pieces or [(0, self.line, self.column)] if piece[0] <= offset
        )
        return line, column + offset - at


class Document:
    """A text with its elements, and the errors about it.

    Args:
        data: the text, or the bytes of a file in the encoding that its first line tells.
        file: its name, for messages.
        root: the name that the outermost element must have.

    Raises:
        ParseError: it is not well-formed, is nested too deeply, or has a document type declaration.
    """

    def __init__(self, data: str | bytes, file: str, root: str) -> None:
        self.file, self._data = file, data
        # a text is no longer in the encoding that its first line tells
        self._parser = expat.ParserCreate("utf-8" if isinstance(data, str) else None)
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._open: list[Element] = []
        self._texts: list[list[str]] = []  # of the open elements, piece by piece
        self._name = root
        try:
            self._parser.Parse(data.encode("utf-8", "surrogatepass") if isinstance(data, str) else data, True)
        except expat.ExpatError as error:
            message = f"not well-formed XML: {expat.errors.messages[error.code]}"
            raise self.error_at(error.lineno, error.offset + 1, message) from None
        except (LookupError, ValueError) as error:  # an encoding that Python or expat does not know
            raise self.error_at(1, 1, f"cannot be decoded: {error}") from None

    def error_at(self, line: int, column: int, message: str) -> ParseError:
        """A ParseError at a place."""
        text = self._data if isinstance(self._data, str) else _decoded(self._data)
        begin = 0
        for _, match in zip(range(line - 1), _LINE_END.finditer(text), strict=False):
            begin = match.end()
        end = _LINE_END.search(text, begin)
        return ParseError(self.file, line, column, message, text[begin : end.start() if end else None])

    def error(self, element: Element, message: str, word: int | None = None) -> ParseError:
        """A ParseError at an element, or at a word of its text."""
        return self.error_at(*element.place(word), message)

    # --- what may be asked of elements ---

    def children(
        self, element: Element, names: Sequence[str], attributes: Sequence[str] = ()
    ) -> list[Element]:
        """The children of an element that holds no text; other names and other attributes are refused."""
        self._check_attributes(element, attributes)
        if element.words():
            raise self.error(element, f"<{element.name}> holds no text, found {element.words()[0][:40]!r}", 0)
        for child in element.children:
            if child.name not in names:
                known = expected_one_of([f"<{name}>" for name in names]) if names else "it is empty"
                raise self.error(child, f"unknown <{child.name}> in <{element.name}>; {known}")
        return element.children

    def only(self, element: Element, name: str, *others: str) -> Element:
        """The one child of an element that has one of the names."""
        found = [child for child in element.children if child.name in (name, *others)]
        wanted = " or ".join(f"<{n}>" for n in (name, *others))
        if not found:
            raise self.error(element, f"<{element.name}> needs {wanted}")
        if len(found) > 1:
            raise self.error(found[1], f"a second {wanted} in <{element.name}>")
        return found[0]

    def words(self, element: Element) -> list[str]:
        """The words of an element that holds nothing else."""
        if element.children:
            inner = element.children[0]
            raise self.error(inner, f"<{element.name}> holds words only, found <{inner.name}>")
        self._check_attributes(element, ())
        return element.words()

    def word(self, element: Element) -> str:
        """The one word of an element."""
        found = self.words(element)
        if len(found) != 1:
            raise self.error(element, f"<{element.name}> holds one word, found {len(found)}")
        return found[0]

    def numbers(self, element: Element) -> Array:
        """(n,) the numbers that an element holds."""
        words = self.words(element)
        numbers = finite_numbers(element.text)
        # blanks of other scripts, which are none in XML, would make one word several numbers
        if numbers is None or len(numbers) != len(words):
            index, message = first_fault(words)
            raise self.error(element, message, index)
        return numbers

    def attribute(self, element: Element, name: str, default: str | None = None) -> str:
        """An attribute; without a default it must be there."""
        if name in element.attributes:
            return element.attributes[name]
        if default is None:
            raise self.error(element, f"<{element.name}> needs the attribute {name}")
        return default

    def _check_attributes(self, element: Element, names: Sequence[str]) -> None:
        """Refuse attributes other than these."""
        for name in element.attributes:
            if name not in names:
                known = expected_one_of(names) if names else "there is none"
                raise self.error(element, f"unknown attribute {name!r} of <{element.name}>; {known}")

    # --- while expat walks through the text ---

    def _doctype(self, *declaration: object) -> None:
        raise self._here("a document type declaration is refused; the format needs none")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        line, column = self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1
        element = Element(name, attributes or _NO_ATTRIBUTES, line, column)
        if self._open:
            self._open[-1].children.append(element)
        elif name != self._name:
            raise self._here(f"expected <{self._name}>, found <{name}>")
        else:
            self.root = element
        if len(self._open) >= MAX_DEPTH:
            raise self._here(f"<{name}> is nested too deeply; at most {MAX_DEPTH} levels are read")
        self._open.append(element)
        self._texts.append([])

    def _end(self, name: str) -> None:
        self._open.pop().text = "".join(self._texts.pop())

    def _characters(self, text: str) -> None:
        element, pieces = self._open[-1], self._texts[-1]
        if text.isspace():
            if pieces:
                pieces.append(" ")
                element.length += 1
            return
        if element.children:
            raise self._here(f"text among the elements of <{element.name}>: {text.strip()[:40]!r}")
        line, column = self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1
        element.pieces.append((element.length, line, column))
        element.length += len(text)
        pieces.append(text)

    def _here(self, message: str) -> ParseError:
        return self.error_at(self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1, message)


def _decoded(data: bytes) -> str:
    """Bytes as text, to show a line of it."""
    try:
        return data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
