"""What is known about an order to stop, and the sentences about it: sent, confirmed, still moving."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

STANDSTILL = 0.02
"""Speed in m/s plus rad/s below which odometry shows that the robot stands still."""


class Cancellation(Enum):
    """What is known about the request to cancel goals of an action server."""

    CONFIRMED = "the server has confirmed it"
    NO_REPLY = "it was sent, and the server has not replied in time"
    FAILED = "the server has refused it, or it failed"
    UNCONFIRMED = "it was sent by ROS 1, which confirms nothing"
    NOT_SENT = "there is no server or no connection"


SENTENCES: Mapping[Cancellation, str] = {
    Cancellation.CONFIRMED: "{name} has confirmed the cancellation",
    Cancellation.NO_REPLY: "{name} has not confirmed the cancellation so far",
    Cancellation.FAILED: "{name} has not accepted the cancellation",
    Cancellation.UNCONFIRMED: "ROS 1 does not confirm cancellations",
    Cancellation.NOT_SENT: "the cancellation could not be sent to {name}",
}
"""What is known about a cancellation -> the sentence about it."""


@dataclass(frozen=True)
class StopReport:
    """What is known about an order to stop; `str` is a sentence about it.

    is_sent: whether the Twist of zeros was sent. has_receiver: whether a node receives it, None if unknown.
    cancellations: action server -> what is known about the cancellation of its goals.
    speed: m/s plus rad/s that odometry has measured after the order; None without a measurement.
    age: seconds since the last order that was sent, if this one was not; None without one.
    is_repeated: whether orders that were not sent are sent once the connection is back.
    """

    is_sent: bool
    has_receiver: bool | None = None
    cancellations: Mapping[str, Cancellation] = field(default_factory=dict)
    speed: float | None = None
    age: float | None = None
    is_repeated: bool = False

    @property
    def is_settled(self) -> bool:
        """Whether nothing is left to confirm."""
        final = (Cancellation.CONFIRMED, Cancellation.UNCONFIRMED)
        return self.is_sent and all(known in final for known in self.cancellations.values())

    def __str__(self) -> str:
        if not self.is_sent:
            last = "" if self.age is None else f"; the last one was sent {self.age:.1f} s ago"
            later = "; the next one is sent first if the connection comes back" if self.is_repeated else ""
            return f"no order to stop can be sent, as there is no connection{last}{later}"
        sent = [name for name, known in self.cancellations.items() if known is not Cancellation.NOT_SENT]
        goals = f" and the cancellation of all goals of {' and '.join(sent)}" if sent else ""
        parts = [f"an order to stop was sent (a Twist of zeros{goals})"]
        if self.has_receiver is False:
            parts.append("no node receives the Twist")
        facts = (SENTENCES[known].format(name=name) for name, known in self.cancellations.items())
        parts += dict.fromkeys(facts)
        if self.speed is None:
            parts.append("whether the robot stands still is not measured")
        elif self.speed <= STANDSTILL:
            parts.append("odometry shows that the robot stands still")
        else:
            parts.append(f"by odometry the robot still moves ({self.speed:.2f} m/s plus rad/s)")
        return "; ".join(parts)


def describe_missing_result(name: str, timeout: float, known: Cancellation, *, has_ended: bool) -> str:
    """Return the message about a goal without a result in time.

    Args:
        known: about its cancellation. has_ended: whether the server has reported its end since.
    """
    sent = "" if known is Cancellation.NOT_SENT else "its cancellation was sent; "
    fact = "it has ended since" if has_ended else SENTENCES[known].format(name=name)
    return f"{name} has no result within {timeout:g} s; {sent}{fact}"
