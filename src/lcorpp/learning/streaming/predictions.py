"""Results of streaming classification: the prediction for a person, and the report on the samples."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lcorpp.learning.streaming.resampler import RepairCounts
from lcorpp.learning.streaming.trigger import EarlyDecision
from lcorpp.notebook import html_table
from lcorpp.values import Array


@dataclass(frozen=True, eq=False, slots=True)
class Prediction:
    """The current prediction for a person.

    person: the id. track: number of tracks of this id so far; the prediction is for the last one.
    points: points of that track at the fixed rate. time: stamp of the last point, None without one.
    probabilities: (K,) uncalibrated, of the classes of the classifier; None with too few points.
    decision: of the trigger on this track, once enough of it is seen; None before, and without a trigger.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import StreamingClassifier, learner, train
        >>> walks = [np.outer([speed, 0], np.arange(30) / 10) for speed in (0.2, 0.3, 1.2, 1.3)]
        >>> data = Dataset(walks, 2 * ["slow"] + 2 * ["fast"], interval=0.1)
        >>> streams = StreamingClassifier.from_trained(train(learner("summaries", interval=0.1), data))
        >>> prediction = streams.push(0.0, "person 7", 4.0, 1.5)
        >>> prediction.points, prediction.probabilities  # one point is not a motion
        (1, None)
    """

    person: Hashable
    track: int
    points: int
    time: float | None
    probabilities: Array | None
    decision: EarlyDecision | None = None

    def __repr__(self) -> str:
        values = None if self.probabilities is None else [round(float(p), 3) for p in self.probabilities[:8]]
        decided = "" if self.decision is None else f"; decided: {self.decision.label}"
        return (
            f"<Prediction for {self.person!r}: track {self.track}, {self.points} points, {values}{decided}>"
        )

    def _repr_html_(self) -> str:
        return predictions_to_html([self], (), caption="Prediction")


@dataclass(frozen=True, eq=False)
class StreamReport:
    """Counts of repaired and rejected samples.

    people: counts of each tracked person. removed: counts of all people no longer tracked, together.
    removals: number of people removed or forgotten.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import StreamingClassifier, learner, train
        >>> walks = [np.outer([speed, 0], np.arange(30) / 10) for speed in (0.2, 0.3, 1.2, 1.3)]
        >>> data = Dataset(walks, 2 * ["slow"] + 2 * ["fast"], interval=0.1)
        >>> streams = StreamingClassifier.from_trained(train(learner("summaries", interval=0.1), data))
        >>> _ = streams.push(0.0, "person 7", 4.0, float("nan"))
        >>> streams.report().total.rejected
        1
    """

    people: Mapping[Hashable, RepairCounts]
    removed: RepairCounts
    removals: int

    @property
    def total(self) -> RepairCounts:
        """Counts of all people together."""
        total = replace(self.removed)
        for counts in self.people.values():
            total.add(counts)
        return total

    def _repr_html_(self) -> str:
        rows = [(str(person), str(counts)) for person, counts in self.people.items()]
        if self.removals:
            rows.append((f"{self.removals} no longer tracked", str(self.removed)))
        return html_table(("person", "samples and repairs"), rows, caption="Samples of a stream")

    def __str__(self) -> str:
        lines = [f"{person}: {counts}" for person, counts in self.people.items()]
        if self.removals:
            lines.append(f"{self.removals} no longer tracked: {self.removed}")
        return "\n".join(lines) or "no samples"

    def __repr__(self) -> str:
        return f"<StreamReport: {len(self.people)} people tracked, {self.removals} removed; {self.total}>"


def predictions_to_html(predictions: Iterable[Prediction], classes: Sequence[str], *, caption: str) -> str:
    """Return predictions as an HTML table with a column for each class; without their names, by number."""
    shown = list(predictions)
    count = max((len(x.probabilities) for x in shown if x.probabilities is not None), default=0)
    names = classes or [f"class {number + 1}" for number in range(count)]
    rows = []
    for x in shown:
        values = [""] * len(names) if x.probabilities is None else [f"{p:.3f}" for p in x.probabilities]
        time = "" if x.time is None else f"{x.time:.2f}"
        decided = "" if x.decision is None else x.decision.label
        rows.append((str(x.person), str(x.track), str(x.points), time, *values, decided))
    return html_table(("person", "track", "points", "time", *names, "decided"), rows, caption=caption)


class ConstantEstimator:
    """An estimator whose result does not depend on its input: one person's prediction at one time."""

    def __init__(self, classes: tuple[str, ...], probabilities: Array) -> None:
        self.classes_, self._probabilities = np.array(classes), probabilities

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) the same row for every case."""
        return np.tile(self._probabilities, (len(np.asarray(X)), 1))
