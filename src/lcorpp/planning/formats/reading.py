"""Read a model in any of the formats, recognised by suffix and content."""

from __future__ import annotations

from pathlib import Path

from lcorpp.files import read_text
from lcorpp.planning.formats.pomdp.reader import parse_pomdp
from lcorpp.planning.pomdp import Pomdp


def read_pomdp(path: str | Path) -> Pomdp:
    """Read a model: PomdpX if the suffix is .pomdpx or the content is XML, otherwise .pomdp.

    Raises:
        FileError: the file cannot be read.
        ParseError: the text is malformed; the message has file, line and column.
        ModelError: the model is too large.
    """
    is_xml = Path(path).suffix.lower() == ".pomdpx"
    text = "" if is_xml else read_text(path)
    # PomdpX files are published under either suffix, and no .pomdp file starts with "<"
    if is_xml or text.lstrip("\ufeff \t\r\n").startswith("<"):
        from lcorpp.planning.formats.pomdpx.reader import read_pomdpx  # imports the XML parser

        return read_pomdpx(path)
    return parse_pomdp(text, file=str(path))
