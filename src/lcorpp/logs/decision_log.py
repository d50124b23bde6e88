"""A log of decisions, one line of JSON each: written line by line, read with the place of each error."""

from __future__ import annotations

import json
import os
import shutil
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.assembly.robot_parts import Json, RobotParts, describe_strategy
from lcorpp.decision import Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DataError, FileError, LcorppError
from lcorpp.files import MAX_MAPPED_BYTES
from lcorpp.input_files import open_input, open_lines
from lcorpp.values import Array, Distribution, Episode, Label, Likelihood, Step, read_value
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp decision", 1)

START = f'{{"format": "{FORMAT.name}"'.encode()
"""How the lines of `format_decision` begin."""


class DecisionLog:
    """A file to which decisions are appended, each as one whole line.

    A line that an earlier crash has cut is ended first, so that it does not damage the next one. A file that
    does not begin as a decision does is left as it is.

    Raises:
        FileError: the file cannot be written, or its disk is full.
        DataError: the file is something else than a log of decisions.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import LCORPP
        >>> from lcorpp.logs import DecisionLog, read_log
        >>> facts = {"time": "afternoon", "location": "classroom"}
        >>> robot = load_robot("intention", cache=False)
        >>> episode = robot.decide(facts, label="zero", world=["pos", "pos", "pos"])
        >>> with DecisionLog(Path("decisions.jsonl")) as log:
        ...     log.append(robot.parts, LCORPP, facts, episode)
        >>> [line.context for line in read_log(Path("decisions.jsonl"))]
        [{'time': 'afternoon', 'location': 'classroom'}]
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        _check_kind(path)
        try:
            self._file = open(path, "ab", buffering=0)  # noqa: SIM115  # closed by close()
        except (OSError, ValueError) as error:
            raise self._make_error(error) from None
        kind = os.fstat(self._file.fileno()).st_mode
        self._is_regular = stat.S_ISREG(kind)
        try:
            if self._is_regular and not shutil.disk_usage(path).free:
                raise FileError(f"{path}: cannot be written: No space left on device")
            # a device such as /dev/full opens without an error, and fails at the first write
            if _ends_within_line(path) if self._is_regular else stat.S_ISCHR(kind):
                self.append_lines([b"\n"])
        except FileError:
            self.close()
            raise

    def __enter__(self) -> DecisionLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def append(
        self,
        parts: RobotParts,
        strategy: Strategy,
        context: Mapping[str, str],
        episode: Episode,
        simulated: Json | None = None,
        *,
        seed: tuple[int, ...] | None = None,
        person: int | None = None,
        person_id: str | None = None,
    ) -> None:
        """Append a decision, see `format_decision`.

        Raises:
            FileError: the file cannot be written.
        """
        line = format_decision(
            parts, strategy, context, episode, simulated, seed=seed, person=person, person_id=person_id
        )
        self.append_lines([line])

    def append_lines(self, lines: Iterable[bytes]) -> None:
        """Append whole lines; of a line that cannot be written completely, nothing remains.

        Raises:
            FileError: the file cannot be written.
        """
        for line in lines:
            written = 0
            try:
                while written < len(line):
                    written += self._file.write(line[written:])
            except OSError as error:
                if written and self._is_regular:
                    os.ftruncate(self._file.fileno(), os.fstat(self._file.fileno()).st_size - written)
                raise self._make_error(error) from None

    def _make_error(self, error: OSError | ValueError) -> FileError:
        return FileError(f"{self.path}: cannot be written: {getattr(error, 'strerror', None) or error}")


def _check_kind(path: Path) -> None:
    """Raise `DataError` if a file is not empty and does not begin as a decision does."""
    if not path.is_file():
        return
    try:
        with open(path, "rb") as file:
            start = file.read(len(START))
    except OSError:  # opening it to write names the reason
        return
    if not START.startswith(start):
        raise DataError(f"{path}: exists and is not a log of decisions; expected such a log or a new file")


def is_log(path: Path) -> bool:
    """Whether a file, or a pipe that is kept (`keep_pipes`), begins as a decision does.

    Raises:
        FileError: it cannot be read.
    """
    with open_input(path, MAX_MAPPED_BYTES) as file:
        return file.read(len(START)) == START


def _ends_within_line(path: Path) -> bool:
    """Whether the last line of a file has no end."""
    with open(path, "rb") as file:
        if not file.seek(0, os.SEEK_END):
            return False
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"


def format_decision(
    parts: RobotParts,
    strategy: Strategy,
    context: Mapping[str, str],
    episode: Episode,
    simulated: Json | None = None,
    *,
    seed: tuple[int, ...] | None = None,
    person: int | None = None,
    person_id: str | None = None,
) -> bytes:
    """Return a decision as one line of JSON; numbers have all their digits.

    Args:
        strategy: that of the robot. context: the observed facts.
        simulated: what only a simulation knows, e.g. the truth, cost and return.
        seed: of `make_generator`, for a strategy that draws its actions.
        person: number of people before this one, for a strategy that learns from them.
        person_id: by which such a strategy recognises people; None without.
    """
    own = dict[str, Any]()
    if strategy.draws:
        own["seed"] = seed
    elif strategy.start is not None:
        own |= {"person": person} | ({} if person_id is None else {"person_id": person_id})
    states = parts.domain.model.states
    marginal = episode.marginal
    content = {
        **FORMAT.header,
        "domain": parts.domain.name,
        "preset": parts.domain.preset,
        "strategy": describe_strategy(strategy) | own,
        "facts": dict(context),
        "labels": format_labels(episode.labels),
        "evidence": format_labels(episode.evidence),
        "marginal": None if marginal is None else list(marginal),
        "prior": _format_belief(states, episode.prior),
        "steps": [
            {
                "action": step.action,
                "observation": step.observation,
                "belief": _format_belief(states, step.belief),
            }
            for step in episode.steps
        ],
        "report": episode.report,
        "seconds": {name: round(seconds, 7) for name, seconds in episode.seconds.items()},
        "parts": parts.description,
    }
    if simulated is not None:
        content["simulated"] = simulated
    return json.dumps(content, ensure_ascii=False).encode() + b"\n"


def format_labels(labels: Mapping[str, Label]) -> dict[str, Any]:
    """Return labels or evidence as JSON; what likelihoods observed is left out."""
    return {name: label if isinstance(label, str) else dict(label) for name, label in labels.items()}


def _format_belief(states: tuple[str, ...], belief: Array) -> dict[str, float]:
    """Return the states of positive probability."""
    return {state: p for state, p in zip(states, belief.tolist(), strict=True) if p}


@dataclass(frozen=True, eq=False)
class LoggedDecision:
    """A line of a log that is a decision.

    line: counted from 1. content: the JSON object.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import LCORPP
        >>> from lcorpp.logs import DecisionLog, read_log
        >>> robot = load_robot("intention", cache=False)
        >>> with DecisionLog(Path("one.jsonl")) as log:
        ...     log.append(robot.parts, LCORPP, {}, robot.decide({}, label="zero", world=3 * ["pos"]))
        >>> (line,) = read_log(Path("one.jsonl"))
        >>> line.strategy, line.read_episode(robot.domain).report
        ({'name': 'LCORPP'}, 'interested')
    """

    line: int
    content: Json

    @property
    def strategy(self) -> Json:
        """The strategy, as `read_strategy` reads it."""
        return dict(self.content["strategy"])

    @property
    def context(self) -> dict[str, str]:
        """The observed facts."""
        return dict(self.content["facts"])

    def read_episode(self, domain: Domain) -> Episode:
        """Return the decision in terms of a domain.

        Raises:
            LcorppError: a distribution is none, or a state is unknown.
            LookupError, TypeError, ValueError, AttributeError: the content has another form.
        """
        content, marginal = self.content, self.content["marginal"]
        states = domain.model.states
        if marginal is not None:
            values, probabilities = zip(*marginal, strict=True)
            marginal = Distribution(tuple(map(read_value, values)), np.array(probabilities))
        steps = [
            Step(step["action"], step["observation"], _read_belief(states, step["belief"]))
            for step in content["steps"]
        ]
        return Episode(
            labels=read_labels(content["labels"]),
            evidence=read_labels(content["evidence"]),
            marginal=marginal,
            prior=_read_belief(states, content["prior"]),
            steps=tuple(steps),
            report=read_value(content["report"]),
            seconds=content["seconds"],
        )


def read_labels(labels: Mapping[str, Any]) -> dict[str, Label]:
    """Return labels or evidence from JSON."""
    return {
        name: label
        if isinstance(label, str)
        else Likelihood(tuple(label), np.array(list(label.values()), dtype=np.float64))
        for name, label in labels.items()
    }


def _read_belief(states: tuple[str, ...], belief: Mapping[str, float]) -> Array:
    for state in belief:
        if state not in states:
            raise DataError(f"the model has no state {state!r}")
    return np.array([belief.get(state, 0.0) for state in states], dtype=np.float64)


def read_log(path: Path, *, wait: Callable[[], None] | None = None) -> Iterator[LoggedDecision | DataError]:
    """Read a log line by line; a line that is not a decision of this format becomes an error with its place.

    Args:
        wait: called at the end of the log before it is read further, e.g. to sleep; None ends there.

    Raises:
        FileError: the file cannot be read.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import LCORPP
        >>> from lcorpp.logs import DecisionLog, read_log
        >>> robot = load_robot("intention", cache=False)
        >>> with DecisionLog(Path("two.jsonl")) as log:
        ...     for answer in ("pos", "neg"):
        ...         log.append(robot.parts, LCORPP, {}, robot.decide({}, label="zero", world=3 * [answer]))
        >>> [line.read_episode(robot.domain).report for line in read_log(Path("two.jsonl"))]
        ['interested', 'not_interested']
    """
    try:
        with open_lines(path, MAX_MAPPED_BYTES) as file:
            number, line = 0, b""
            while True:
                for part in file:
                    line += part
                    if wait is None or line.endswith(b"\n"):  # otherwise the line is being written
                        number += 1
                        if line.strip():
                            yield _read_line(path, number, line)
                        line = b""
                if wait is None:
                    return
                wait()
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def _read_line(path: Path, number: int, line: bytes) -> LoggedDecision | DataError:
    place = f"{path}:{number}"
    try:
        return LoggedDecision(number, FORMAT.read(line))
    except DataError as error:
        cut = "" if line.endswith(b"\n") else "; the line is cut"
        return DataError(f"{place}: not a decision: {error}{cut}")


DAMAGE = (LcorppError, LookupError, TypeError, ValueError, AttributeError, RecursionError, ArithmeticError)
"""Errors of reading a decision whose content was edited."""


def describe_damage(error: BaseException) -> str:
    """Return the message of a typed error; of another one also its type: a field is missing or wrong."""
    if isinstance(error, LcorppError):
        return str(error)
    return f"a field is missing or has another form ({type(error).__name__}: {error})"
