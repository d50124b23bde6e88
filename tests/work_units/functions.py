"""Functions that other processes import and evaluate."""

import os
import signal
import time
from pathlib import Path

from lcorpp.errors import DecisionError


def square(number: int) -> int:
    return number * number


def square_slowly(number: int) -> int:
    time.sleep(0.05)
    return number * number


def refuse_three(number: int) -> int:
    if number == 3:
        raise DecisionError("three is impossible")
    return number


def kill_worker_once(argument: tuple[str, int]) -> int:
    """Kill the own process at number 5 if the marker does not exist yet."""
    marker, number = Path(argument[0]), argument[1]
    if number == 5 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def kill_worker(number: int) -> int:
    if number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return number
