"""Attention among several people: whom the robot attends to next, while the others may leave.

To attend to person i takes D seconds and yields the value V, e.g. the probability that an interested person
is served. A person who is postponed stays with probability exp(-h d), h being their hazard of leaving and d
the mean duration of the decisions to choose from. What that is worth depends on the load: let q be the
share of the people who come, weighted by value, to whom the robot attends; the others leave before, or find
no room. Per second that the robot spends on i, what is lost if i is postponed is

    index_i = V_i / D_i * (1 - w exp(-h_i d)),   w = q^2.

In overload q -> 0, and the index is the value per second, which is optimal there (Atar, Giat and Shimkin,
The c mu / theta rule for many-server queues with abandonment, Operations Research 58, 2010). With q -> 1 a
postponed person is served later all the same, and those who are about to leave come first. With equal
hazards the order is that of value per second whatever the load is. The weight w is below q because later
service takes time from others, and a person who was passed over once may be so again;
benchmarks/results/attention.md compares exponents.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from math import exp, inf

from lcorpp.errors import DecisionError

MIN_SECONDS = 1.0
"""Shorter decisions count as this long: the robot turns to a person before it reports."""
EXPONENT = 2
"""Of q in the weight of postponed value."""
PRIOR_SHARE, PRIOR_WEIGHT = 0.5, 10.0
"""The estimate of q before any observation, and the value of people that it counts as."""
MEMORY = 300.0
"""Number of people after whom an observation has lost two thirds of its weight: the load changes."""
PRESENCE_MEMORY = 3600.0
"""The same for the number of people present, in seconds."""
MIN_FULL_SHARE = 0.01
"""Minimal share of the time at or above the largest number of people: rarer ones may be tracking errors."""


@dataclass(frozen=True)
class Candidate:
    """A person to whom the robot may attend.

    person: the tracker's id. probability: of what the robot looks for, e.g. P(interested).
    value: expected value of attending to this person now; 0 or less if it is not worth it.
    seconds: expected duration.
    hazard: rate of leaving during the next decision, per second; inf for "at once".

    Raises:
        DecisionError: a number is out of range or not finite.
    """

    person: Hashable
    probability: float
    value: float
    seconds: float
    hazard: float

    def __post_init__(self) -> None:
        if not 0 <= self.probability <= 1:
            self._refuse("probability", self.probability, "a number in [0, 1]")
        if not -inf < self.value < inf:
            self._refuse("value", self.value, "a finite number")
        if not 0 <= self.seconds < inf:
            self._refuse("seconds", self.seconds, "a finite number, 0 or more")
        if not self.hazard >= 0:
            self._refuse("hazard", self.hazard, "a number, 0 or more")

    def _refuse(self, name: str, value: float, expected: str) -> None:
        raise DecisionError(f"the {name} of the candidate {self.person!r} is {value!r}; expected {expected}")


def choose_candidate(candidates: Sequence[Candidate], *, share: float) -> Hashable | None:
    """Return the person with the highest index, the first among equals; None if nobody is worth attending to.

    Args:
        candidates: the people who are present and undecided.
        share: q, see `ServedShare`.

    Raises:
        DecisionError: `share` is not a number in [0, 1].
    """
    if not 0 <= share <= 1:
        raise DecisionError(f"the share of served people is {share!r}; expected a number in [0, 1]")
    worthwhile = [each for each in candidates if each.value > 0]
    if not worthwhile:
        return None
    delay = find_delay([each.seconds for each in worthwhile])
    return max(worthwhile, key=lambda each: compute_index(each, share, delay)).person


def compute_index(candidate: Candidate, share: float, delay: float) -> float:
    """Return the index of a person, in value per second; see the module.

    Args:
        share: q. delay: d, the seconds by which the person is postponed otherwise.
    """
    per_second = candidate.value / max(candidate.seconds, MIN_SECONDS)
    return per_second * (1 - share**EXPONENT * exp(-candidate.hazard * delay))


def find_delay(seconds: Sequence[float]) -> float:
    """Return d, the mean of the durations of the decisions to choose from, in seconds."""
    return sum(max(each, MIN_SECONDS) for each in seconds) / len(seconds)


class ServedShare:
    """Online estimate of q: the share of people, by value, to whom the robot attends.

    People who find no room are not observed. By PASTA (Wolff, Poisson arrivals see time averages, Operations
    Research 30, 1982) their share of the arrivals equals the share of the time in which the place is full,
    i.e. the maximal number of people is present. In a place without a limit that share is small.
    """

    def __init__(self) -> None:
        self._attended, self._all = PRIOR_SHARE * PRIOR_WEIGHT, PRIOR_WEIGHT
        self._seconds = defaultdict[int, float](float)

    def __repr__(self) -> str:
        return f"<ServedShare: {self.share:.2f}>"

    @property
    def share(self) -> float:
        """The estimate."""
        return self._attended / self._all * (1 - self._full_share)

    def record(self, value: float, *, attended: bool) -> None:
        """Record that the robot attends to a person, or that a person left before.

        Args:
            value: of attending to them, when last estimated; people who are not worth it do not count.
        """
        keep, value = exp(-1 / MEMORY), max(value, 0.0)
        self._attended = keep * self._attended + (value if attended else 0.0)
        self._all = keep * self._all + value

    def record_presence(self, count: int, seconds: float) -> None:
        """Record the number of people present, including the one attended to, for some seconds."""
        keep = exp(-seconds / PRESENCE_MEMORY)
        for number in self._seconds:
            self._seconds[number] *= keep
        self._seconds[count] += PRESENCE_MEMORY * (1 - keep)

    @property
    def _full_share(self) -> float:
        """Share of the time in which the place was full; 0 while the number of people never changed."""
        total, at_least = sum(self._seconds.values()), 0.0
        for number in sorted(self._seconds, reverse=True)[:-1]:
            at_least += self._seconds[number]
            if at_least >= MIN_FULL_SHARE * total:
                return at_least / total
        return 0.0
