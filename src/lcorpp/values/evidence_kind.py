"""What a trained classifier gives to the reasoner: a label, a likelihood, or a prediction set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lcorpp.errors import DataError, expected_one_of

EVIDENCE = ("hard", "soft", "set")
"""Names of the kinds of evidence."""

BASELINE_SIGN = "-"
"""In the name of a sense: a baseline, which only the strategy of the same name uses, e.g. "gaze-rule"."""

COVERAGE = 0.95
"""Default coverage of prediction sets."""


@dataclass(frozen=True)
class EvidenceKind:
    """A kind of evidence.

    name: "hard", a label; "soft", a calibrated likelihood; "set", the likelihood of a prediction set.
    coverage: of the prediction sets; None is `COVERAGE`, or that of a stored classifier.

    Examples:
        >>> from lcorpp.values import EvidenceKind
        >>> EvidenceKind.parse("set:0.9")
        EvidenceKind(name='set', coverage=0.9)
    """

    name: str = "hard"
    coverage: float | None = None

    def __post_init__(self) -> None:
        if self.name not in EVIDENCE:
            raise DataError(f"evidence {self.name!r}: {expected_one_of(EVIDENCE)}")
        if self.coverage is not None:
            if self.name != "set":
                raise DataError(f"evidence {self.name!r} has no coverage; expected 'set'")
            check_coverage(self.coverage)

    def __str__(self) -> str:
        return self.name if self.coverage is None else f"{self.name}:{self.coverage:g}"

    @classmethod
    def parse(cls, text: str) -> EvidenceKind:
        """Return the kind of a text: hard, soft, set or set:COVERAGE.

        Raises:
            DataError: the text has another form, or the coverage is not between 0 and 1.
        """
        name, colon, coverage = text.partition(":")
        if not colon:
            return cls(name)
        try:
            return cls(name, float(coverage))
        except (ValueError, DataError):
            raise DataError(f"evidence {text!r}: expected set:COVERAGE, as set:{COVERAGE}") from None

    @property
    def is_likelihood(self) -> bool:
        """Whether the evidence is a likelihood, so that the program does without error rates."""
        return self.name != "hard"


def check_coverage(coverage: Any) -> None:
    """Raise `DataError` unless the coverage of prediction sets is a number between 0 and 1.

    Examples:
        >>> from lcorpp.values import check_coverage
        >>> check_coverage(95)
        Traceback (most recent call last):
            ...
        lcorpp.errors.DataError: the coverage of prediction sets is 95; expected a number between 0 and 1
    """
    if isinstance(coverage, bool) or not isinstance(coverage, int | float) or not 0 < coverage < 1:
        raise DataError(f"the coverage of prediction sets is {coverage!r}; expected a number between 0 and 1")
