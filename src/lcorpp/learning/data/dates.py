"""Times that are written as dates, or as times of day, in ISO 8601."""

from __future__ import annotations

import re
from datetime import UTC, datetime, time

TIME_OF_DAY = re.compile(r"\d{1,2}:\d\d:\d\d([.,]\d+)?")
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d.*", re.IGNORECASE)


def parse_date(cell: str) -> tuple[str, float] | None:
    """Return the kind of a date or a time of day, and its seconds; None if it is neither.

    The seconds are those since 1970, where a date without a zone is taken for UTC, or since midnight.
    """
    text = cell.strip()
    try:
        if TIME_OF_DAY.fullmatch(text):
            clock = time.fromisoformat(text.rjust(len(text) + (text[1] == ":"), "0"))
            seconds = 3600 * clock.hour + 60 * clock.minute + clock.second
            return "times of day", seconds + clock.microsecond / 1e6
        if DATE.fullmatch(text):
            date = datetime.fromisoformat(re.sub(r"\s+(?=[+-]|Z$|UTC$)", "", text).replace("UTC", "Z"))
            if date.tzinfo is None:
                return "dates without a zone, taken for UTC", date.replace(tzinfo=UTC).timestamp()
            return "dates", date.timestamp()
    except ValueError:
        pass
    return None
