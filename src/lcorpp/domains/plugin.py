"""The domain's own `people.py`: simulated signals and reactions of people."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.errors import DomainError
from lcorpp.protocols import World
from lcorpp.user_code import UserFile, load_file
from lcorpp.values import BASELINE_SIGN, Array, stack_signals

FUNCTIONS = ("trajectory", "trajectories", "reaction")
"""Functions of a plug-in, beside those with the names of senses; it defines at least one."""


class SimulationPlugin:
    """A `people.py`; a call that fails or returns a wrong type raises `DomainError`.

    A person is a mapping from the attributes of the truth program to values. The file may define:

    - for each sense a function of its name ``motion(people, rng)`` -> one signal for each person:
      (people, channels, time points) or (people, features). The first sense may also have
      ``trajectories(people, rng)`` or ``trajectory(person, rng)`` -> (channels, time points). The numbers of
      time points may differ; None is the signal of a person whom the sense does not perceive;
    - ``reaction(person, action, rng)`` -> observation;
    - ``recordings(people, rng, *, seconds)`` -> one array (samples, columns) for each person, with
      COLUMNS, the names of the columns, "time" first.
    """

    def __init__(self, path: Path, senses: Sequence[str]) -> None:
        """senses: their names."""
        self.path, self._senses = path, tuple(senses)
        self._module = load_file(path, f"lcorpp_people_{path.parent.name}", DomainError)
        self._file = UserFile.of(path, self._module)
        names = (*FUNCTIONS, *[sense.replace(BASELINE_SIGN, "_") for sense in senses])
        if not self.defines(*names):
            raise DomainError(f"{path}: defines none of {', '.join(names)}")

    def defines(self, *names: str) -> bool:
        """Return whether the file defines a function of one of the names."""
        return any(callable(getattr(self._module, name, None)) for name in names)

    @property
    def columns(self) -> tuple[str, ...]:
        """The column names of a recording, () without recordings."""
        if not self.defines("recordings"):
            return ()
        columns = getattr(self._module, "COLUMNS", None)
        if not (
            isinstance(columns, tuple)
            and all(isinstance(name, str) for name in columns)
            and columns[:1] == ("time",)
            and len(set(columns)) == len(columns)
        ):
            raise DomainError(
                f"{self.path}: COLUMNS is {columns!r}; recordings() needs a tuple of different names there,"
                " 'time' first"
            )
        return columns

    @property
    def signals(self) -> dict[str, Callable[[Sequence[Mapping[str, str]], np.random.Generator], Array]]:
        """The simulations of the signals of the senses that have one."""
        function_of = {sense: sense.replace(BASELINE_SIGN, "_") for sense in self._senses}
        functions = {sense: name for sense, name in function_of.items() if self.defines(name)}
        own = [sense for sense in self._senses if BASELINE_SIGN not in sense]
        for name in ("trajectory", "trajectories"):
            if own and self.defines(name):  # of both functions, `trajectories`
                functions[own[0]] = name
        return {sense: partial(self._simulate, name) for sense, name in functions.items()}

    def _simulate(self, name: str, people: Sequence[Mapping[str, str]], rng: np.random.Generator) -> Array:
        """Return the signals of people by the function of this name; shorter tracks are padded."""
        ranks: tuple[int, ...] = (1, 2)
        shapes = f"({len(people)}, channels, time points) or ({len(people)}, features)"
        if name in ("trajectory", "trajectories"):
            ranks, shapes = (2,), f"({len(people)}, channels, time points)"
        if name == "trajectory":
            signals = [self._call(name, person, rng) for person in people]
        else:
            signals = self._call(name, people, rng)
        try:
            rows = [None if signal is None else np.array(signal, dtype=np.float64) for signal in signals]
        except (TypeError, ValueError):
            rows = []
        arrays = [row for row in rows if row is not None]
        known = {array.shape for array in arrays}
        fixed = {(len(shape), *shape[:1]) for shape in known}  # the numbers of time points may differ
        is_array = len(fixed) == 1 and not any(0 in shape or len(shape) not in ranks for shape in known)
        if not (is_array or (rows and not arrays)) or len(rows) != len(people):
            found = (len(rows), *known.pop()) if len(known) == 1 else "of unequal shapes"
            raise DomainError(f"{self.path}: {name}(): expected signals of shape {shapes}, not {found}")
        if not all(np.isfinite(array).all() for array in arrays):
            raise DomainError(f"{self.path}: {name}(): a signal has a value that is not a number")
        missing = np.full_like(arrays[0], np.nan) if arrays else np.full((1, 1), np.nan)
        return stack_signals([missing if row is None else row for row in rows])

    def recordings(
        self,
        people: Sequence[Mapping[str, str]],
        rng: np.random.Generator,
        *,
        seconds: tuple[float, float] | None = None,
    ) -> list[Array]:
        """Return one array (samples, columns) for each person, as a tracker records it.

        Args:
            seconds: minimum and maximum duration; None for the plug-in's default.
        """
        returned = self._call("recordings", people, rng, **({} if seconds is None else {"seconds": seconds}))
        try:
            tables = [np.array(table, dtype=np.float64) for table in returned]
        except (TypeError, ValueError):
            tables = []
        width = len(self.columns)
        if len(tables) != len(people) or any(
            t.ndim != 2 or t.shape[1] != width or not len(t) for t in tables
        ):
            raise DomainError(
                f"{self.path}: expected {len(people)} recordings, one for each person, of shape"
                f" (samples, {width})"
            )
        if not all(np.isfinite(table).all() for table in tables):
            raise DomainError(f"{self.path}: a recording has a value that is not a number")
        if not all(np.all(np.diff(table[:, 0]) > 0) for table in tables):
            raise DomainError(f"{self.path}: the times of a recording do not increase")
        return tables

    def reaction(self, person: Mapping[str, str], action: str, rng: np.random.Generator) -> str:
        """Return a person's reaction to an action, an observation."""
        answer = self._call("reaction", person, action, rng)
        if not isinstance(answer, str):
            raise DomainError(f"{self.path}: reaction() returned {answer!r}, expected an observation")
        return answer

    def make_world(self, person: Mapping[str, str], rng: np.random.Generator) -> World:
        """Return the world of a person who answers by `reaction`."""
        from lcorpp.domains.own_world import ReactionWorld

        return ReactionWorld(self.reaction, f"{self.path}: reaction", person, rng)

    def _call(self, name: str, *arguments: Any, **options: Any) -> Any:
        function: Callable[..., Any] = getattr(self._module, name)
        with self._file.locate_failures(f"{name}()", DomainError):
            return function(*arguments, **options)

    def __reduce__(self) -> tuple[type[SimulationPlugin], tuple[Path, Sequence[str]]]:
        return SimulationPlugin, (self.path, self._senses)  # another process loads the file again
