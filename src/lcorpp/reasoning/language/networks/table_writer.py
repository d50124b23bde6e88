"""Write Bayesian networks as tables, in CSV or TOML; `table_files` reads them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from fractions import Fraction
from itertools import product

from lcorpp.csv_text import format_csv
from lcorpp.errors import ProgramError
from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork
from lcorpp.reasoning.quoting import strip_quotes

_BARE = re.compile(r"[A-Za-z0-9_-]+")

MAX_DECIMALS = 15
"""Probabilities with more decimals are written as fractions."""


def write_csv(network: BayesianNetwork) -> str:
    """Write the tables of a network in CSV, with a blank line between them.

    Raises:
        ProgramError: a name has ``=`` or a space around it, or begins with ``#``.
    """
    for name, attribute in network.attributes.items():
        for text in (name, *attribute.values):
            shown = strip_quotes(text)
            if shown != shown.strip() or not shown or shown.startswith("#") or "=" in shown:
                raise ProgramError(f"{network.file}: {text} cannot be written in CSV, but in TOML")
    parts = []
    for name, table in network.tables.items():
        shown = strip_quotes(name)
        values = [strip_quotes(value) for value in network.attributes[name].values]
        head = [*map(strip_quotes, table.parents), *[f"{shown} = {value}" for value in values]]
        parts.append(format_csv([head, *_list_rows(network, name)]))
    return "\n".join(parts)


def write_toml(network: BayesianNetwork) -> str:
    """Write the tables of a network in TOML.

    Raises:
        ProgramError: a name begins or ends with a space, or is empty.
    """
    parts = []
    for name, table in network.tables.items():
        values = [strip_quotes(value) for value in network.attributes[name].values]
        parents = [strip_quotes(parent) for parent in table.parents]
        for text in (strip_quotes(name), *values):
            if text != text.strip() or not text:
                raise ProgramError(f"{network.file}: {text!r} cannot be written in a table")
        shown = strip_quotes(name)
        lines = [f"[{shown if _BARE.fullmatch(shown) else _write_text(shown)}]"]
        if parents:
            lines.append(f"given = {_write_list(map(_write_text, parents))}")
        lines.append(f"values = {_write_list(map(_write_text, values))}")
        rows = [
            [*map(_write_text, row[: len(parents)]), *map(_write_number, row[len(parents) :])]
            for row in _list_rows(network, name)
        ]
        lines += ["rows = [", *[f"    {_write_list(row)}," for row in rows], "]"]
        parts.append("\n".join([*lines, ""]))
    return "\n".join(parts)


def _list_rows(network: BayesianNetwork, name: str) -> list[list[str]]:
    """List the cells of each row of a table."""
    table = network.tables[name]
    given = [map(strip_quotes, network.attributes[parent].values) for parent in table.parents]
    return [
        [*values, *map(format_probability, numbers)]
        for values, numbers in zip(product(*given), table.list_fractions(), strict=True)
    ]


def format_probability(number: Fraction) -> str:
    """Format a probability as a decimal if it has a short one, otherwise as a fraction."""
    for decimals in range(MAX_DECIMALS + 1):
        scaled = number * 10**decimals
        if scaled.denominator == 1:
            digits = str(scaled.numerator).rjust(decimals + 1, "0")
            return f"{digits[:-decimals]}.{digits[-decimals:]}" if decimals else digits
    return str(number)


def _write_number(text: str) -> str:
    return _write_text(text) if "/" in text else text


def _write_text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _write_list(items: Iterable[str]) -> str:
    return f"[{', '.join(items)}]"
