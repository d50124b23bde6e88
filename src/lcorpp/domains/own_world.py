"""Worlds of the user's own code: an object for each person that answers the robot's actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from lcorpp.errors import DomainError
from lcorpp.protocols import World
from lcorpp.user_code import UserFunction


class OwnWorlds:
    """The user's ``NAME(person, rng)`` in a file: returns the world of a person.

    A person is a mapping from the attributes of the truth program to values; `rng` draws what is random. A
    world has the methods ``act(action)`` -> observation and ``report(action)``, see `lcorpp.protocols.World`.

    Raises:
        DomainError: the file cannot be loaded, or has no such function.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._function = UserFunction(path, name, DomainError)

    def __repr__(self) -> str:
        return f"{self._function.path}:{self._function.name}"

    def __call__(self, person: Mapping[str, str], rng: np.random.Generator) -> World:
        """Return the world of a person.

        Raises:
            DomainError: the function fails or returns something else.
        """
        world = self._function(person, rng)
        missing = [name for name in ("act", "report") if not callable(getattr(world, name, None))]
        if isinstance(world, type) or missing:
            what = f"the class {world.__name__}" if isinstance(world, type) else type(world).__name__
            lacks = f", which lacks {' and '.join(missing)}" if missing else ""
            raise DomainError(
                f"{self._function.location}: {self._function.name}() returned {what}{lacks}; expected an"
                " object with the methods act(action) and report(action)"
            )
        return _OwnWorld(self._function, world)


class _OwnWorld:
    """The user's world of one person; errors name the user's file and line."""

    def __init__(self, function: UserFunction, world: World) -> None:
        self._function, self._world = function, world

    @property
    def source(self) -> str:
        """The method that answers, for messages."""
        return f"{self._function.file.locate(self._world.act)}: act"

    def act(self, action: str) -> str:
        with self._function.locate_failures(f"act({action!r})"):
            return self._world.act(action)

    def report(self, action: str) -> None:
        with self._function.locate_failures(f"report({action!r})"):
            self._world.report(action)


class ReactionWorld:
    """The world of a person whose answers `reaction(person, action, rng)` of a people.py draws."""

    def __init__(
        self,
        reaction: Callable[[Mapping[str, str], str, np.random.Generator], str],
        source: str,
        person: Mapping[str, str],
        rng: np.random.Generator,
    ) -> None:
        """source: the function, for messages."""
        self._reaction, self.source, self._person, self._rng = reaction, source, person, rng

    def act(self, action: str) -> str:
        return self._reaction(self._person, action, self._rng)

    def report(self, action: str) -> None:
        pass
