"""Reading A. Cassandra's .pomdp format, as published files use it.

The format: http://pomdp.org/code/pomdp-file-spec.html. Later statements override earlier ones. Beyond the
specification, as in published files: a bare list of start states, and a stray colon before the numbers.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.files import read_text
from lcorpp.planning.formats.pomdp.preamble import Preamble, read_preamble
from lcorpp.planning.formats.pomdp.rewards import expected_rewards
from lcorpp.planning.formats.pomdp.statements import Statements
from lcorpp.planning.formats.pomdp.tables import Table
from lcorpp.planning.formats.pomdp.tokens import ROW_TOLERANCE, Places, Tokens
from lcorpp.planning.pomdp import SUM_TOLERANCE, Pomdp
from lcorpp.planning.sparse import SparseTables


def read_pomdp(path: str | Path) -> Pomdp:
    """Read a model: a .pomdpx file where its name ends so or it is XML, otherwise a .pomdp file.

    Raises:
        FileError: the file cannot be read.
        ParseError: the text is malformed; file, line and column are told.
        ModelError: the model is too large to be held.
    """
    xml = Path(path).suffix.lower() == ".pomdpx"
    text = "" if xml else read_text(path)
    if xml or text.lstrip("\ufeff \t\r\n").startswith(
        "<"
    ):  # published under either name; no .pomdp begins so
        from lcorpp.planning.formats.pomdpx.reader import read_pomdpx

        return read_pomdpx(path)
    return parse_pomdp(text, file=str(path))


def parse_pomdp(text: str, *, file: str = "<text>") -> Pomdp:
    """The POMDP that a text in .pomdp format describes.

    Rows that sum to 1 within 1e-4 are normalised; costs become negative rewards; rewards that depend on the
    next state or the observation are folded into the expected reward. Time and memory follow the length of
    the text and the number of probabilities above zero.

    Raises:
        ParseError: the text is malformed.
        ModelError: the model is too large to be held.
    """
    tokens = Tokens(text, file)
    try:
        head = read_preamble(tokens)
        statements = Statements(tokens, head)
        statements.read()
        transition, observation = (
            _checked(tokens, head, table) for table in (statements.transition, statements.observation)
        )
        reward = expected_rewards(transition, observation, statements.rewards)
        return Pomdp(
            head.names["states"],
            head.names["actions"],
            head.names["observations"],
            transition,
            observation,
            # 0 + and 0 - turn -0.0 into 0.0: a file should not come back with another sign
            0.0 + reward if head.sign > 0 else 0.0 - reward,
            head.discount,
            head.start,
            file,
        )
    except ModelError as error:
        raise ModelError(f"{file}: {error}") from None


def _checked(tokens: Tokens, head: Preamble, table: Table) -> SparseTables:
    """The table, of which every row is there and sums to 1; rounding of the file is taken out.

    Raises:
        ParseError: a row is missing or its sum is wrong.
    """
    rows, places = table.rows()
    _check_all_there(tokens, head, table, places)
    sums = rows.row_sums()
    off = np.abs(sums - 1)
    if off.max() > ROW_TOLERANCE:
        wrong = np.argwhere(off > ROW_TOLERANCE)
        a, s = wrong[places[tuple(wrong.T)].argmin()].tolist()
        raise tokens.error(
            f"{table.title} row for {head.names['actions'][a]!r}, {head.names['states'][s]!r}"
            f" sums to {sums[a, s]:.10g}, not 1",
            int(places[a, s]),
        )
    if off.max() <= SUM_TOLERANCE:
        return rows
    divisors = np.where(off > SUM_TOLERANCE, sums, 1.0).reshape(-1)
    return SparseTables(rows.shape, rows.begins, rows.columns, rows.values / divisors[rows.rows])


def _check_all_there(tokens: Tokens, head: Preamble, table: Table, places: Places) -> None:
    unset = places < 0
    if not unset.any():
        return
    a = int(unset.any(axis=1).argmax())
    action, own = head.names["actions"][a], head.places["actions"]
    place = own[a] if len(own) > 1 else own[0]
    if unset[a].all():
        raise tokens.error(f"action {action!r} has no {table.title} rows", place)
    state = head.names["states"][int(unset[a].argmax())]
    raise tokens.error(f"{table.title} row for {action!r}, {state!r} is missing", place)
