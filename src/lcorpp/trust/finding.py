"""What an alarm finds."""

from __future__ import annotations

from dataclasses import dataclass

KNOWLEDGE, HEARING, BIAS_CHANGE = "knowledge", "hearing", "biased answers"

WORSE_CHANGE, BETTER_CHANGE = "worse with each question", "better with each question"
REPEATED_CHANGE = "repeated answers"

FORM_CHANGES = WORSE_CHANGE, BETTER_CHANGE, REPEATED_CHANGE
"""What may be wrong with the hearing beside noise and bias: the form of the answers."""


@dataclass(frozen=True)
class Finding:
    """An alarm.

    person: number of people until then. part: `KNOWLEDGE` or `HEARING`. log_e: the logarithm of E.
    attributes: the attributes whose pr-atoms are probably wrong, several if their hypotheses are equivalent;
        empty for `HEARING`. change: what is probably wrong there; for `HEARING` bias or a form of answers,
        or "": noise.
    noise: the most probable degree of noise, see `AnswerModel`. probability: of `attributes`, given that one
        attribute alone is wrong; for `HEARING` of `change`.
    """

    person: int
    part: str
    log_e: float
    attributes: tuple[str, ...]
    change: str
    noise: float
    probability: float
