"""Where people are, whichever tracker detects them: a person whom several trackers detect is one."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from math import hypot, inf
from time import monotonic

MAX_AGE = 3.0
"""Seconds after which the position of a person who is no longer detected is unknown."""
MAX_PAUSE = 1.0
"""Seconds without a detection after which a tracker no longer sees a person."""
SAME_PERSON, MAX_APART = 0.6, 1.5
"""Metres within which new people of two trackers are one person, and beyond which they are no longer."""

Key = tuple[str, str]
"""A tracker's name and its id of a person."""


@dataclass
class _Person:
    """seen: tracker -> when it saw the person last, monotonic seconds."""

    x: float
    y: float
    seen: dict[str, float] = field(default_factory=dict)

    @property
    def last(self) -> float:
        return max(self.seen.values(), default=-inf)


class PeoplePositions:
    """Positions of people in the fixed frame. Methods may be called from any thread.

    Args:
        main: the tracker whose positions count as long as it sees a person, and whose ids are the names.

    Examples:
        >>> from lcorpp.worlds.ros.people.positions import PeoplePositions
        >>> people = PeoplePositions(main="camera")
        >>> people.update("camera", "7", 2.0, 0.0), people.update("laser", "1", 2.1, 0.1)
        ('7', '7')
        >>> people.update("laser", "2", -1.0, 0.0)  # behind the robot
        'laser 2'
    """

    def __init__(self, main: str = "") -> None:
        self._main, self._lock = main, threading.Lock()
        self._people = dict[str, _Person]()
        self._names = dict[Key, str]()

    def update(self, tracker: str, id: str, x: float, y: float) -> str:
        """Take a detection; return the name of the person.

        A new id of a tracker is a person whom another tracker sees within `SAME_PERSON`, and this one does
        not; the nearest, if there are several. Otherwise it is a new person, and so is one whom the main
        tracker sees more than `MAX_APART` away.
        """
        with self._lock:
            self._forget()
            name = self._names.get((tracker, id))
            if name is not None and self._is_apart(name, tracker, x, y):
                del self._people[name].seen[tracker]
                name = None
            if name is None:
                name = self._find_same(tracker, x, y) or self._make_name(tracker, id)
                self._names[tracker, id] = name
            person, now = self._people.setdefault(name, _Person(x, y)), monotonic()
            if tracker == self._main or now - person.seen.get(self._main, -inf) > MAX_PAUSE:
                person.x, person.y = x, y
            person.seen[tracker] = now
            return name

    def locate(self, name: str) -> tuple[float, float] | None:
        """Return the position of a person; None if the person is no longer detected."""
        return self.list_people().get(name)

    def list_people(self) -> dict[str, tuple[float, float]]:
        """Return the people who are detected, with their positions."""
        with self._lock:
            self._forget()
            return {name: (person.x, person.y) for name, person in self._people.items()}

    def _make_name(self, tracker: str, id: str) -> str:
        """Return the name of a new person: the main tracker's id, or with the name of another tracker."""
        name = id if tracker == self._main else f"{tracker} {id}"
        while name in self._people:  # the person of this id is another one now
            name += "'"
        return name

    def _find_same(self, tracker: str, x: float, y: float) -> str | None:
        """Return the nearest person whom another tracker sees now and this one does not; None without one."""
        now = monotonic()
        near = {
            name: hypot(person.x - x, person.y - y)
            for name, person in self._people.items()
            if now - person.last <= MAX_PAUSE and now - person.seen.get(tracker, -inf) > MAX_PAUSE
        }
        nearest = min(near, key=near.__getitem__, default=None)
        return nearest if nearest is not None and near[nearest] <= SAME_PERSON else None

    def _is_apart(self, name: str, tracker: str, x: float, y: float) -> bool:
        """Return whether the main tracker sees a person elsewhere than another tracker."""
        person = self._people.get(name)
        if person is None or tracker == self._main:
            return False
        is_seen = monotonic() - person.seen.get(self._main, -inf) <= MAX_PAUSE
        return is_seen and hypot(person.x - x, person.y - y) > MAX_APART

    def _forget(self) -> None:
        """Forget the people who are no longer detected."""
        now = monotonic()
        self._people = {name: own for name, own in self._people.items() if now - own.last < MAX_AGE}
        self._names = {key: name for key, name in self._names.items() if name in self._people}
