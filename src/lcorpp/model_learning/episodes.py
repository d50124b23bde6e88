"""Episodes as arrays: actions, observations and rewards of each step, read from a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, expected_one_of
from lcorpp.fitting import read_records
from lcorpp.fitting.records import Record, read_header
from lcorpp.values import Array, Indices

COLUMNS = ("episode", "action", "observation", "reward")
"""Columns that each table of episodes has; `end` is optional."""

MAX_REWARDS = 50
"""Maximum number of different rewards."""

YES, NO = ("1", "true", "yes"), ("0", "false", "no")
"""Cells of the column `end`."""


@dataclass(frozen=True)
class Step:
    """What a robot knows of a step: names of the action and the observation, and the reward.

    Examples:
        >>> from lcorpp.model_learning import Step
        >>> Step("ask", "hear_tea", -1.0).reward
        -1.0
    """

    action: str
    observation: str
    reward: float


@dataclass(frozen=True, eq=False)
class Episodes:
    """N episodes, all their M steps one after the other.

    action_names, observation_names: sorted. reward_values: (V,) the different rewards, increasing.
    actions, observations, rewards: (M,) indices of these.
    begins: (N + 1,) the first step of each episode, and M. ended: (N,) whether the decision was over after
    the last step.
    facts: (N,) what is known of each episode, attribute -> value.
    evidence: (N, V) the likelihood of what is known, given each of V shared values; None without.
    """

    action_names: tuple[str, ...]
    observation_names: tuple[str, ...]
    reward_values: Array
    actions: Indices
    observations: Indices
    rewards: Indices
    begins: Indices
    ended: npt.NDArray[np.bool_]
    facts: tuple[Mapping[str, str], ...]
    evidence: Array | None = None

    @classmethod
    def of(
        cls,
        episodes: Sequence[Sequence[Step]],
        ended: Sequence[bool],
        facts: Sequence[Mapping[str, str]] | None = None,
    ) -> Episodes:
        """Return episodes of steps. facts: what is known of each.

        Raises:
            DataError: there are none, one has no steps, a reward is not finite, or too many rewards differ.
        """
        if not episodes or not all(episodes):
            raise DataError("expected at least one episode, and at least one step in each")
        steps = [step for episode in episodes for step in episode]
        if not all(isfinite(step.reward) for step in steps):
            raise DataError("a reward is not finite")
        values = sorted({step.reward for step in steps})
        if len(values) > MAX_REWARDS:
            raise DataError(
                f"{len(values)} different rewards; expected at most {MAX_REWARDS}: round them, e.g. to what a"
                " second costs"
            )
        actions = tuple(sorted({step.action for step in steps}))
        observations = tuple(sorted({step.observation for step in steps}))
        return cls(
            actions,
            observations,
            np.array(values),
            np.array([actions.index(step.action) for step in steps]),
            np.array([observations.index(step.observation) for step in steps]),
            np.searchsorted(values, [step.reward for step in steps]),
            np.cumsum([0, *map(len, episodes)]),
            np.array(ended, dtype=bool),
            ({},) * len(episodes) if facts is None else tuple(facts),
        )

    def __len__(self) -> int:
        return len(self.ended)

    def __repr__(self) -> str:
        return (
            f"<Episodes: {len(self)} with {len(self.actions)} steps, {len(self.action_names)} actions,"
            f" {len(self.observation_names)} observations>"
        )

    def add_observations(self, names: Iterable[str]) -> Episodes:
        """Return the episodes with names of observations that may occur, too."""
        every = tuple(sorted({*self.observation_names, *names}))
        places = np.array([every.index(name) for name in self.observation_names])
        return replace(self, observation_names=every, observations=places[self.observations])

    def select(self, places: Indices) -> Episodes:
        """Return some of these episodes, each as often as its index occurs."""
        begins = self.begins[:-1][places]
        sizes = np.diff(self.begins)[places]
        ends = np.cumsum(sizes)
        steps = np.repeat(begins - ends + sizes, sizes) + np.arange(ends[-1])
        return replace(
            self,
            actions=self.actions[steps],
            observations=self.observations[steps],
            rewards=self.rewards[steps],
            begins=np.append(0, ends),
            ended=self.ended[places],
            facts=tuple(self.facts[i] for i in places),
            evidence=None if self.evidence is None else self.evidence[places],
        )

    @cached_property
    def is_end(self) -> npt.NDArray[np.bool_]:
        """(M,) whether the decision was over after a step."""
        found = np.zeros(len(self.actions), dtype=bool)
        found[self.begins[1:] - 1] = self.ended
        return found


def read_episodes(path: str | Path, facts: Sequence[str] = ()) -> Episodes:
    r"""Read a table of episodes, CSV: a row for each step, in their order.

    Columns: `episode` identifies it, `action`, `observation`, `reward` of the step; `end`, optional, is 1 in
    the last row of an episode after which the decision is over. Without it, an action after which no episode
    goes on ends the decision. Other columns are ignored.

    Args:
        facts: further columns with what is known of an episode, e.g. ``time``; one value in all rows of an
            episode, or none.

    Raises:
        FileError: the file cannot be read.
        DataError: a column or cell is missing or wrong; the message names the line.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.model_learning import read_episodes
        >>> _ = Path("steps.csv").write_text(
        ...     "episode,action,observation,reward\n1,look,dark,-1\n1,leave,none,5\n2,leave,none,-5\n")
        >>> episodes = read_episodes("steps.csv")
        >>> len(episodes), episodes.action_names, episodes.ended.tolist()
        (2, ('leave', 'look'), [True, True])
    """
    rows: dict[str, list[tuple[Step, bool | None]]] = {}
    known: dict[str, Record] = {}
    last = ""
    for record in read_records(path):
        episode = _read_cell(record, "episode")
        if episode != last and episode in rows:
            raise DataError(
                f"{record.place}: episode {episode} goes on after another one; expected it together"
            )
        last = episode
        own = rows.setdefault(episode, [])
        if own and own[-1][1]:
            raise DataError(f"{record.place}: episode {episode} goes on after its end")
        own.append((_read_step(record), _read_end(record)))
        _add_facts(known, episode, record, facts)
    if not rows:
        raise DataError(f"{path}: there are no episodes")
    steps = [[step for step, _ in own] for own in rows.values()]
    stated = [own[-1][1] for own in rows.values()]
    going_on = {step.action for own in steps for step in own[:-1]}
    ended = [
        own[-1].action not in going_on if end is None else end for own, end in zip(steps, stated, strict=True)
    ]
    try:
        episodes = Episodes.of(steps, ended, list(known.values()))
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    for name in facts:
        if not any(name in own for own in known.values()):
            raise DataError(f"{path}: no cell of the column {name}; expected it, as it is one of the facts")
    return episodes


def _read_cell(record: Record, column: str) -> str:
    if column not in record:
        raise DataError(f"{record.place}: no {column}; expected the columns {', '.join(COLUMNS)}")
    return record[column]


def is_table_of_episodes(path: str | Path) -> bool:
    """Whether a table has two or more of the columns of episodes; others have records.

    Raises:
        FileError, DataError: as `read_records`.
    """
    return len(set(COLUMNS).intersection(read_header(path))) > 1


def read_facts(path: str | Path, names: Sequence[str] = ()) -> list[Record]:
    """Read records, of some attributes only if names are given.

    Raises:
        FileError, DataError: as `read_records`; a name is no column.
    """
    header = read_header(path)
    for name in names:
        if name not in header:
            raise DataError(f"{path}: no column {name}; {expected_one_of(header)}")
    records = list(read_records(path))
    for record in records if names else ():
        for name in set(record).difference(names):
            del record[name]
    return records


def _add_facts(known: dict[str, Record], episode: str, record: Record, facts: Sequence[str]) -> None:
    """Add the facts of a row to those of its episode."""
    if episode not in known:
        known[episode] = Record()
        known[episode].place = record.place
    for name in facts:
        own = known[episode]
        if name in record and own.setdefault(name, record[name]) != record[name]:
            raise DataError(
                f"{record.place}: {name} is {record[name]}, and {own[name]} before in episode {episode};"
                " expected one value in an episode"
            )


def _read_step(record: Record) -> Step:
    text = _read_cell(record, "reward")
    try:
        reward = float(text)
    except ValueError:
        reward = float("nan")
    if not isfinite(reward):
        raise DataError(f"{record.place}: the reward is {text}; expected a finite number")
    return Step(_read_cell(record, "action"), _read_cell(record, "observation"), reward)


def _read_end(record: Mapping[str, str]) -> bool | None:
    cell = record.get("end")
    if cell is None:
        return None
    if cell.lower() not in (*YES, *NO):
        place = getattr(record, "place", "")
        raise DataError(f"{place}: end is {cell}; expected {', '.join((*YES, *NO))}")
    return cell.lower() in YES
