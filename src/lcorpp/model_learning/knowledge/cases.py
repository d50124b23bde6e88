"""Records as rows of numbers; what a record does not state is completed by all its values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import log, prod

import numpy as np

from lcorpp.errors import DataError, expected_one_of
from lcorpp.fitting import SoftRecord
from lcorpp.fitting.records import Record
from lcorpp.reasoning.quoting import make_name_text, make_value_text
from lcorpp.values import Array, Indices

MAX_ATTRIBUTES = 12
"""Maximum number of attributes with two or more values: all sets of them are scored."""

MAX_VALUES = 100
"""Maximum number of values of an attribute."""

MAX_ROWS = 200_000
"""Maximum number of rows after completion."""

PSEUDO_RECORDS = 1.0
"""Records of equal values that each rule has before the data."""

_Row = tuple[tuple[int, ...], float]
_Facts = frozenset[tuple[str, str]]


@dataclass(frozen=True, eq=False)
class Cases:
    """R distinct records of n attributes, completed to M rows.

    names, values: of the attributes, the hidden ones first. hidden: those that no record states.
    constants: further attributes that have one value.
    repeats: (R,) how often each record occurs.
    rows: (M, n) indices of values. record_of: (M,) the record of each row, increasing.
    log_evidence: (M,) logarithm of the likelihood of the record, given the row.
    """

    names: tuple[str, ...]
    values: tuple[tuple[str, ...], ...]
    hidden: frozenset[str]
    constants: Mapping[str, str]
    repeats: Array
    rows: Indices
    record_of: Indices
    log_evidence: Array

    @classmethod
    def of(
        cls,
        records: Iterable[Mapping[str, str] | SoftRecord],
        *,
        hidden: Mapping[str, Sequence[str]] | None = None,
        values: Mapping[str, Sequence[str]] | None = None,
    ) -> Cases:
        """Return the cases of records.

        Args:
            records: attribute -> value; what is missing is unknown.
            hidden: attributes that no record states -> their values.
            values: attributes -> all their values, in this order; of others, those that occur, sorted.

        Raises:
            DataError: there are no records or too many unknown values, a hidden attribute is stated, a value
                is not one of those given, or there are too many attributes.
        """
        hidden, values = hidden or {}, values or {}
        mixtures, found = list[tuple[tuple[_Facts, float], ...]](), dict[str, dict[str, None]]()
        for number, record in enumerate(records, start=1):
            place = getattr(record, "place", f"record {number}")
            alternatives = record.alternatives if isinstance(record, SoftRecord) else (({}, 1.0),)
            facts = record.facts if isinstance(record, SoftRecord) else record
            own = [({**facts, **further}, weight) for further, weight in alternatives if weight]
            for name, value in [pair for stated, _ in own for pair in stated.items()]:
                if name in hidden:
                    raise DataError(f"{place}: {name} is stated; expected no value of a hidden attribute")
                if name in values and value not in values[name]:
                    raise DataError(f"{place}: {name} is {value}; {expected_one_of(values[name])}")
                found.setdefault(name, {})[value] = None
            mixtures.append(tuple((frozenset(stated.items()), weight) for stated, weight in own))
        if not found:
            raise DataError("there are no records with values; expected at least one")
        known = {name: tuple(own) for name, own in hidden.items()}
        known |= {name: tuple(own) for name, own in values.items()}
        known |= {name: tuple(sorted(own)) for name, own in found.items() if name not in known}
        for name, names in hidden.items():
            if len(set(names)) < max(2, len(names)):
                raise DataError(
                    f"hidden {name} has the values {', '.join(names)}; expected two or more different"
                )
        constants = {name: own[0] for name, own in known.items() if len(own) == 1}
        known = {name: own for name, own in known.items() if name not in constants}
        for name, names in known.items():
            if len(names) > MAX_VALUES:
                raise DataError(
                    f"{name} has {len(names)} values; expected at most {MAX_VALUES}: an identifier or a"
                    " number is no attribute, group its values or leave it out"
                )
        if not 0 < len(known) <= MAX_ATTRIBUTES:
            raise DataError(
                f"{len(known)} attributes have several values{': ' * bool(known)}{', '.join(known)}; expected"
                f" 1 to {MAX_ATTRIBUTES}"
            )
        repeats = Counter(mixtures)
        completed = [
            [row for facts, weight in mixture for row in _complete(facts, log(weight), known)]
            for mixture in _check_size(list(repeats), known)
        ]
        rows = [row for own in completed for row in own]
        return cls(
            tuple(known),
            tuple(known.values()),
            frozenset(hidden),
            constants,
            np.array(list(repeats.values()), dtype=np.float64),
            np.array([row for row, _ in rows]).reshape(len(rows), len(known)),
            np.repeat(np.arange(len(completed)), list(map(len, completed))),
            np.array([weight for _, weight in rows]),
        )

    @cached_property
    def sizes(self) -> tuple[int, ...]:
        """Number of values of each attribute."""
        return tuple(map(len, self.values))

    @property
    def count(self) -> float:
        """Number of records."""
        return float(self.repeats.sum())

    @cached_property
    def is_complete(self) -> bool:
        """Whether each record is one row."""
        return len(self.rows) == len(self.repeats)

    @cached_property
    def uncertain(self) -> frozenset[int]:
        """The attributes that have several values in the rows of most records."""
        begins = np.searchsorted(self.record_of, np.arange(len(self.repeats)))
        varies = np.maximum.reduceat(self.rows, begins) > np.minimum.reduceat(self.rows, begins)
        return frozenset(np.flatnonzero(self.repeats @ varies > self.count / 2).tolist())

    def normalise(self, logs: Array) -> tuple[Array, float]:
        """Return (M,) the weights of the rows, which sum to the repeats of each record.

        logs: (M,) logarithm of the probability of each row without its evidence.

        Returns:
            The weights, and the log likelihood of all records.
        """
        own = logs + self.log_evidence
        begins = np.searchsorted(self.record_of, np.arange(len(self.repeats)))
        top = np.maximum.reduceat(own, begins)
        weights = np.exp(own - top[self.record_of])
        sums = np.add.reduceat(weights, begins)
        weights *= (self.repeats / sums)[self.record_of]
        return weights, float(self.repeats @ (top + np.log(sums)))


def quote_record(record: Mapping[str, str] | SoftRecord) -> Mapping[str, str] | SoftRecord:
    """Return a record whose names and values are texts of P-log, in quotes where they need them."""
    if isinstance(record, SoftRecord):
        further = tuple((_quote(values), weight) for values, weight in record.alternatives)
        return SoftRecord(_quote(record.facts), further)
    if not isinstance(record, Record):
        return _quote(record)
    quoted = Record(_quote(record))
    quoted.place = record.place
    return quoted


def _quote(facts: Mapping[str, str]) -> dict[str, str]:
    for text in (text for pair in facts.items() for text in pair):
        if not text.isprintable():
            place = getattr(facts, "place", "a record")
            raise DataError(f"{place}: {text!r} has a character that cannot be printed; expected none")
    return {make_name_text(name): make_value_text(value) for name, value in facts.items()}


def _check_size(
    mixtures: list[tuple[tuple[_Facts, float], ...]], values: Mapping[str, Sequence[str]]
) -> list[tuple[tuple[_Facts, float], ...]]:
    """Check that unknown values have few completions."""
    total = 0
    for mixture in mixtures:
        for facts, _ in mixture:
            stated = {name for name, _ in facts}
            total += prod(len(own) for name, own in values.items() if name not in stated)
    if total > MAX_ROWS:
        raise DataError(
            f"the unknown values of the records can be completed in {total} ways; expected at most {MAX_ROWS}"
        )
    return mixtures


def _complete(facts: _Facts, log_weight: float, values: Mapping[str, Sequence[str]]) -> Iterator[_Row]:
    """Yield the rows of some facts: with each value of what is not stated."""
    stated = dict(facts)
    options = [
        [own.index(stated[name])] if name in stated else range(len(own)) for name, own in values.items()
    ]
    for choice in product(*options):
        yield choice, log_weight
