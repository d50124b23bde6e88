"""Accuracy of tracks against ground truth: MOTA and root-mean-square error (CLEAR MOT), IDF1.

Sources: Bernardin and Stiefelhagen, Evaluating Multiple Object Tracking Performance: The CLEAR MOT Metrics,
EURASIP Journal on Image and Video Processing, 2008; Ristani, Solera, Zou, Cucchiara and Tomasi, Performance
Measures and a Data Set for Multi-Target, Multi-Camera Tracking, 2016 (IDF1).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from math import isfinite, nan, sqrt

import numpy as np
from scipy.optimize import linear_sum_assignment

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.values import Array

TIME_DECIMALS = 6
"""Samples at times that are equal to this decimal are at one time."""

Positions = dict[Hashable, Array]
"""Id -> (2,) position, of all people at one time."""


@dataclass(frozen=True)
class TrackingScore:
    """Errors of tracks.

    truths: number of true samples. misses: true samples without a track. false_positives: samples of tracks
    without a true one. switches: changes of the track that a person is matched with.
    identified: matched samples under the best one-to-one assignment of tracks to people over all time.
    samples: number of samples of all tracks. squared_error: sum over the matched samples, m^2 (or pixels^2).

    Examples:
        >>> from lcorpp.camera import score_tracks
        >>> truth = [(time, "Ann", float(time), 2.0) for time in range(4)]  # time, id, x, y
        >>> tracks = [(0, 1, 0.0, 2.0), (1, 1, 1.0, 2.0), (2, 2, 2.0, 2.0)]  # another id, then none
        >>> score = score_tracks(truth, tracks, max_distance=0.5)
        >>> score.misses, score.switches, score.mota
        (1, 1, 0.5)
    """

    truths: int
    samples: int
    misses: int
    false_positives: int
    switches: int
    identified: int
    squared_error: float

    @property
    def mota(self) -> float:
        """1 - (misses + false positives + switches) / truths; NaN without a true sample."""
        errors = self.misses + self.false_positives + self.switches
        return 1 - errors / self.truths if self.truths else nan

    @property
    def idf1(self) -> float:
        """2 identified / (truths + samples); NaN without any sample."""
        both = self.truths + self.samples
        return 2 * self.identified / both if both else nan

    @property
    def rmse(self) -> float:
        """Root-mean-square distance of the matched samples; NaN without one."""
        matched = self.truths - self.misses
        return sqrt(self.squared_error / matched) if matched else nan

    def __str__(self) -> str:
        return (
            f"MOTA {self.mota:.3f}, IDF1 {self.idf1:.3f}, RMSE {self.rmse:.3f}; of {self.truths} true samples"
            f" {self.misses} missed, {self.false_positives} false, {self.switches} switches"
        )


@check_arguments
def score_tracks(
    truth: Iterable[Sequence[object]], tracks: Iterable[Sequence[object]], *, max_distance: float
) -> TrackingScore:
    """Compare tracks with ground truth.

    At each time, a person keeps the track that it was last matched with if that is within `max_distance`;
    the others are matched so that there are most pairs, and then the least sum of distances.

    Args:
        truth, tracks: samples (time, id, x, y) in any order; positions in metres (or pixels, all alike).
        max_distance: of a match, in the unit of the positions.

    Raises:
        DataError: a sample is malformed, an id has two at one time, or the distance is not positive.

    Examples:
        >>> from lcorpp.camera import score_tracks
        >>> truth = [(t / 10, "Ann", t / 10, 2.0) for t in range(10)]  # time, id, x, y
        >>> tracks = [(t / 10, 7, t / 10 + 0.1, 2.0) for t in range(8)]  # two samples fewer
        >>> print(score_tracks(truth, tracks, max_distance=0.5))
        MOTA 0.800, IDF1 0.889, RMSE 0.100; of 10 true samples 2 missed, 0 false, 0 switches
    """
    if not (isfinite(max_distance) and max_distance > 0):
        raise DataError(f"score_tracks: max_distance is {max_distance:g}; expected a number above 0")
    true, given = _by_time(truth, "truth"), _by_time(tracks, "tracks")
    last: dict[Hashable, Hashable] = {}  # person -> the track of its last match
    owners: dict[Hashable, Hashable] = {}  # track -> the person of its last match
    together = Counter[tuple[Hashable, Hashable]]()  # person, track -> number of times within the distance
    misses = false_positives = switches = 0
    squared_error = 0.0
    for time in sorted(true.keys() | given.keys()):
        people, found = true.get(time, {}), given.get(time, {})
        distances = _measure_distances(people, found)
        near = {pair: d for pair, d in distances.items() if d <= max_distance}
        together.update(near.keys())
        pairs = {p: t for p, t in last.items() if (p, t) in near and owners[t] == p}
        for person, track in _match(near, set(pairs), set(pairs.values())):
            pairs[person] = track
            switches += last.get(person, track) != track
        last |= pairs
        owners |= {track: person for person, track in pairs.items()}
        misses += len(people) - len(pairs)
        false_positives += len(found) - len(pairs)
        squared_error += sum(near[pair] ** 2 for pair in pairs.items())
    return TrackingScore(
        sum(map(len, true.values())),
        sum(map(len, given.values())),
        misses,
        false_positives,
        switches,
        _count_identified(together),
        squared_error,
    )


def _by_time(samples: Iterable[Sequence[object]], what: str) -> dict[float, Positions]:
    times: dict[float, Positions] = defaultdict(dict)
    for sample in samples:
        try:
            time, name, x, y = sample
            at, position = round(float(time), TIME_DECIMALS), np.array([float(x), float(y)])  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise DataError(f"{what}: sample {sample!r}; expected (time, id, x, y)") from None
        if not (isfinite(at) and np.isfinite(position).all()):
            raise DataError(f"{what}: sample {sample!r} is not finite")
        if name in times[at]:
            raise DataError(f"{what}: two samples of {name!r} at {at:.15g} s; expected one")
        times[at][name] = position
    return times


def _measure_distances(people: Positions, found: Positions) -> dict[tuple[Hashable, Hashable], float]:
    """Return (person, track) -> distance."""
    if not people or not found:
        return {}
    offsets = np.stack(list(people.values()))[:, None] - np.stack(list(found.values()))
    rows = np.hypot(offsets[..., 0], offsets[..., 1]).tolist()
    return {(p, t): rows[i][j] for i, p in enumerate(people) for j, t in enumerate(found)}


def _match(
    near: dict[tuple[Hashable, Hashable], float], people: set[Hashable], tracks: set[Hashable]
) -> list[tuple[Hashable, Hashable]]:
    """Match what is near, without the given people and tracks: most pairs, then the least distance."""
    rest = {(p, t): d for (p, t), d in near.items() if p not in people and t not in tracks}
    if not rest:
        return []
    rows, columns = list(dict.fromkeys(p for p, _ in rest)), list(dict.fromkeys(t for _, t in rest))
    too_far = 1 + 2 * sum(rest.values())
    costs = np.array([[rest.get((p, t), too_far) for t in columns] for p in rows])
    matched = zip(*linear_sum_assignment(costs), strict=True)
    return [(rows[i], columns[j]) for i, j in matched if (rows[i], columns[j]) in rest]


def _count_identified(together: Counter[tuple[Hashable, Hashable]]) -> int:
    """Return the samples that match under the best assignment of tracks to people over all time."""
    if not together:
        return 0
    rows, columns = list(dict.fromkeys(p for p, _ in together)), list(dict.fromkeys(t for _, t in together))
    counts = np.array([[together[p, t] for t in columns] for p in rows])
    return int(counts[linear_sum_assignment(counts, maximize=True)].sum())
