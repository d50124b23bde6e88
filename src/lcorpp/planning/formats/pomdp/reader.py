"""Read A. Cassandra's .pomdp format, as published files use it; a PomdpX file is passed to its own reader.

The format: http://pomdp.org/code/pomdp-file-spec.html. Later statements override earlier ones. Extensions of
published files: a bare list of initial states, and a stray colon before the numbers.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.files import map_text
from lcorpp.planning.formats.memory import report_full_memory
from lcorpp.planning.formats.numbers import ROW_TOLERANCE
from lcorpp.planning.formats.pomdp.preamble import Preamble, read_preamble
from lcorpp.planning.formats.pomdp.rewards import expected_rewards
from lcorpp.planning.formats.pomdp.statements import Statements
from lcorpp.planning.formats.pomdp.tables import TableStatements
from lcorpp.planning.formats.pomdp.tokens import Tokens
from lcorpp.planning.pomdp import SUM_TOLERANCE, Pomdp
from lcorpp.planning.sparse import SparseTables

_XML = re.compile(rb"(?:\xef\xbb\xbf)?\s*<")


def read_pomdp(path: str | Path) -> Pomdp:
    """Read a model: PomdpX if the suffix is .pomdpx or the content is XML, otherwise .pomdp.

    Raises:
        FileError: the file cannot be read, or the memory is full.
        ParseError: the text is malformed; the message has file, line and column.
        ModelError: the model is too large.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain, read_pomdp
        >>> _ = Path("lamp.pomdp").write_text('''
        ... discount: 0.9   values: reward
        ... states: on off  actions: look   observations: bright dark
        ... T: look identity    O: look identity    R: look : on : * : * 1
        ... ''')
        >>> read_pomdp("lamp.pomdp")
        <Pomdp lamp.pomdp: 2 states, 1 actions, 2 observations, discount 0.9>
    """
    with report_full_memory(path):
        return _read_file(path)


def _read_file(path: str | Path) -> Pomdp:
    is_xml = Path(path).suffix.lower() == ".pomdpx"
    text = b"" if is_xml else map_text(path, comment=b"#")
    # PomdpX files are published under either suffix, and no .pomdp file starts with "<"
    if is_xml or _XML.match(text):
        from lcorpp.planning.formats.pomdpx.reader import read_pomdpx  # imports the XML parser

        return read_pomdpx(path)
    return _read_tokens(Tokens(text, str(path)))


def parse_pomdp(text: str, *, file: str = "<text>") -> Pomdp:
    """Parse a text in .pomdp format.

    Rows that sum to 1 within 1e-4 are normalised; costs become negative rewards; rewards that depend on the
    next state or the observation become expected rewards. Time and memory are linear in the length of the
    text and the number of nonzero probabilities.

    Raises:
        ParseError: the text is malformed.
        ModelError: the model is too large.

    Examples:
        >>> from lcorpp import solve
        >>> from lcorpp.planning import parse_pomdp
        >>> tiger = parse_pomdp('''
        ... discount: 0.95  values: reward
        ... states: left right  actions: listen open_left open_right  observations: hear_left hear_right
        ... T: * uniform  T: listen identity
        ... O: * uniform  O: listen 0.85 0.15 0.15 0.85
        ... R: * : * : * : * 10  R: listen : * : * : * -1
        ... R: open_left : left : * : * -100  R: open_right : right : * : * -100
        ... ''')
        >>> round(solve(tiger).lower, 2)
        19.37
    """
    return _read_tokens(Tokens(text.encode("utf-8", "surrogatepass"), file))


def _read_tokens(tokens: Tokens) -> Pomdp:
    try:
        preamble = read_preamble(tokens)
        statements = Statements(tokens, preamble)
        statements.read()
        transition, observation = (
            _normalize_rows(tokens, preamble, table)
            for table in (statements.transition, statements.observation)
        )
        reward = expected_rewards(transition, observation, statements.rewards)
        return Pomdp(
            preamble.names["states"],
            preamble.names["actions"],
            preamble.names["observations"],
            transition,
            observation,
            # 0 + and 0 - turn -0.0 into 0.0, so that writing and reading back gives the same bits
            0.0 + reward if preamble.sign > 0 else 0.0 - reward,
            preamble.discount,
            preamble.start,
            tokens.file,
        )
    except ModelError as error:
        raise ModelError(f"{tokens.file}: {error}") from None


def _normalize_rows(tokens: Tokens, preamble: Preamble, table: TableStatements) -> SparseTables:
    """Check that each row is present and sums to 1; return the rows without the file's rounding errors."""
    actions, states = preamble.names["actions"], preamble.names["states"]
    rows, offsets = table.take_rows()
    unset = offsets < 0
    if unset.any():
        a = int(unset.any(axis=1).argmax())
        places = preamble.offsets["actions"]
        place = places[a] if len(places) > 1 else places[0]
        if unset[a].all():
            raise tokens.error(f"action {actions[a]!r} has no {table.title} rows", place)
        state = states[int(unset[a].argmax())]
        raise tokens.error(f"{table.title} row for {actions[a]!r}, {state!r} is missing", place)
    sums = rows.row_sums()
    errors = np.abs(sums - 1)
    if errors.max() > ROW_TOLERANCE:
        wrong = np.argwhere(errors > ROW_TOLERANCE)
        a, s = wrong[offsets[tuple(wrong.T)].argmin()].tolist()
        raise tokens.error(
            f"{table.title} row for {actions[a]!r}, {states[s]!r} sums to {sums[a, s]:.10g}, not 1",
            int(offsets[a, s]),
        )
    if errors.max() <= SUM_TOLERANCE:
        return rows
    divisors = np.where(errors > SUM_TOLERANCE, sums, 1.0).reshape(-1)
    return SparseTables(rows.shape, rows.begins, rows.columns, rows.values / divisors[rows.rows])
