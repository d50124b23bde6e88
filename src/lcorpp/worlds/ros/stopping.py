"""Orders that stop the robot: a Twist of zeros, and the cancellation of goals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from time import monotonic, sleep

from lcorpp.errors import ActionFailedError, ConnectionLostError, WorldError
from lcorpp.worlds.ros.connection import RosConnection
from lcorpp.worlds.ros.skills import TWIST, Body, CallAction, Navigate, Skill, make_twist
from lcorpp.worlds.ros.stop_report import STANDSTILL, Cancellation, StopReport

BRIEFLY = 0.3
"""Seconds to wait for the confirmation of a stop, so that it does not cancel the next goal instead."""
POLL = 0.02


@dataclass
class StopOrders:
    """What stops the robot: a Twist of zeros, and the cancellation of the goals of these action servers.

    last_sent: when an order was sent last, on the monotonic clock; None before the first.
    """

    cmd_vel: str
    servers: tuple[str, ...] = ()
    last_sent: float | None = field(default=None, init=False)

    @classmethod
    def of(cls, cmd_vel: str, skills: Iterable[Skill | None]) -> StopOrders:
        """Return the orders for what these skills may have started."""
        names = {skill.name for skill in skills if isinstance(skill, Navigate | CallAction)}
        return cls(cmd_vel, tuple(sorted(names)))

    def send(self, connection: RosConnection, *, timeout: float = 0.0) -> StopReport:
        """Order the robot to stop; return what is known about it, except for the speed.

        Args:
            timeout: seconds to wait for each confirmation.

        Raises:
            ConnectionLostError: there is no connection, so nothing was sent.
        """
        connection.publish(self.cmd_vel, TWIST, make_twist(0.0, 0.0))
        self.last_sent = monotonic()
        receivers = connection.count_receivers(self.cmd_vel)
        known = dict.fromkeys(self.servers, Cancellation.NOT_SENT)
        for name in self.servers:
            try:
                known[name] = connection.cancel_goals(name, timeout=timeout)
            except ActionFailedError:  # the others are still cancelled
                known[name] = Cancellation.FAILED
            except ConnectionLostError:
                break
        return StopReport(True, None if receivers is None else receivers > 0, known)

    def stop(self, body: Body, *, is_final: bool = False) -> StopReport:
        """Order the robot to stop, and wait briefly for confirmations and for its standstill.

        Args:
            is_final: whether the connection ends now, so that orders are not sent after a reconnection.
        """
        try:
            sent, now = self.send(body.connection, timeout=BRIEFLY), monotonic()
        except ConnectionLostError:
            age = None if self.last_sent is None else monotonic() - self.last_sent
            return StopReport(False, age=age, is_repeated=not is_final)
        speed = body.perception.find_speed(now)
        while body.perception.measures_speed and monotonic() < now + BRIEFLY:
            if speed is not None and speed <= STANDSTILL:
                break
            sleep(POLL)
            speed = body.perception.find_speed(now)
        return StopReport(True, sent.has_receiver, sent.cancellations, speed)


class StopAfterFailure:
    """A context that orders the robot to stop if an action fails or is interrupted."""

    def __init__(self, action: str, orders: StopOrders, body: Body) -> None:
        self._action, self._orders, self._body = action, orders, body

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, _: object) -> None:
        if error is None:
            return
        report = self._orders.stop(self._body)
        if isinstance(error, WorldError):
            raise type(error)(f"{self._action}: {error}; {report}") from error
