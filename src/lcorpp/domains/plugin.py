"""Loading of a domain's own `people.py`, the plug-in that says how people move and react."""

from __future__ import annotations

import importlib.util
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from lcorpp.errors import DomainError
from lcorpp.values import Array

NAMES = ("trajectory", "trajectories", "reaction")


class People:
    """What a `people.py` defines; a call that fails or returns the wrong thing is a `DomainError`.

    It may define ``trajectory(person, rng)`` -> (channels, time points), its batch form
    ``trajectories(people, rng)`` -> (people, channels, time points), and ``reaction(person, action, rng)``
    -> observation; besides these ``recordings(people, rng, *, seconds)`` -> one array (samples, columns) for
    each person, with COLUMNS, the names of the columns, "time" the first. A person is a mapping from the
    attributes of the truth program to values.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._module = _load(path)
        if not any(hasattr(self._module, name) for name in NAMES):
            raise DomainError(f"{path}: defines none of {', '.join(NAMES)}")

    @property
    def has_motion(self) -> bool:
        return hasattr(self._module, "trajectory") or hasattr(self._module, "trajectories")

    @property
    def has_reaction(self) -> bool:
        return hasattr(self._module, "reaction")

    @property
    def has_recordings(self) -> bool:
        return hasattr(self._module, "recordings")

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns of a recording, () without recordings."""
        if not self.has_recordings:
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

    def trajectories(self, people: Sequence[Mapping[str, str]], rng: np.random.Generator) -> Array:
        """(people, channels, time points) how they move."""
        if hasattr(self._module, "trajectories"):
            tracks = self._call("trajectories", people, rng)
        else:
            tracks = [self._call("trajectory", person, rng) for person in people]
        try:
            array = np.array(tracks, dtype=np.float64)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.ndim != 3 or len(array) != len(people) or 0 in array.shape:
            raise DomainError(
                f"{self.path}: expected tracks of shape ({len(people)}, channels, time points),"
                f" not {array.shape if array.size else 'of unequal shapes'}"
            )
        if not np.isfinite(array).all():
            raise DomainError(f"{self.path}: a track has a coordinate that is not a number")
        return array

    def recordings(
        self,
        people: Sequence[Mapping[str, str]],
        rng: np.random.Generator,
        *,
        seconds: tuple[float, float] | None = None,
    ) -> list[Array]:
        """One array (samples, columns) for each person, as a tracker records them.

        Args:
            seconds: the shortest and the longest duration; None takes what the domain has.
        """
        options = {} if seconds is None else {"seconds": seconds}
        found = self._call("recordings", people, rng, **options)
        try:
            tables = [np.array(table, dtype=np.float64) for table in found]
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
            raise DomainError(f"{self.path}: the times of a recording do not rise")
        return tables

    def reaction(self, person: Mapping[str, str], action: str, rng: np.random.Generator) -> str:
        """What a person answers to an action."""
        answer = self._call("reaction", person, action, rng)
        if not isinstance(answer, str):
            raise DomainError(f"{self.path}: reaction() returned {answer!r}, expected an observation")
        return answer

    def _call(self, name: str, *arguments: Any, **options: Any) -> Any:
        function: Callable[..., Any] = getattr(self._module, name)
        try:
            return function(*arguments, **options)
        except (Exception, SystemExit) as error:
            raise _blamed(self.path, f"{name}() failed", error) from error

    def __reduce__(self) -> tuple[type[People], tuple[Path]]:
        return People, (self.path,)  # a plug-in module is loaded again in another process, not sent


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"lcorpp_people_{path.parent.name}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise DomainError(f"{path}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise _blamed(path, "cannot be loaded", error) from error
    return module


def _blamed(path: Path, what: str, error: BaseException) -> DomainError:
    """The user's own error, told with the deepest line of the user's own file."""
    if isinstance(error, SyntaxError) and error.filename and Path(error.filename).resolve() == path.resolve():
        return DomainError(f"{path}:{error.lineno}: {what}: SyntaxError: {error.msg}")
    frames = traceback.extract_tb(error.__traceback__)
    line = next(
        (frame.lineno for frame in reversed(frames) if Path(frame.filename).resolve() == path.resolve()), None
    )
    where = f"{path}:{line}" if line else str(path)
    return DomainError(f"{where}: {what}: {type(error).__name__}: {error}")
