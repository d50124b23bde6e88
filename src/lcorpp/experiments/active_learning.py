"""Active data augmentation (Algorithm 1, supplementary figure): the people met, and how each batch went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.decision import Batch
from lcorpp.domains import Domain
from lcorpp.errors import DataError
from lcorpp.experiments.figures.augmentation import plot_augmentation
from lcorpp.experiments.figures.files import write_figure
from lcorpp.experiments.metrics import Scores, score_decisions
from lcorpp.experiments.results import METRICS, to_row, write_csv, write_json
from lcorpp.learning import SoftClassifier, TrainedClassifier, save_classifier
from lcorpp.learning.store import StoredTrack
from lcorpp.simulation.population import Person, Population
from lcorpp.simulation.trajectories import TrajectorySource
from lcorpp.simulation.world import SimulatedWorld, SimulationModel
from lcorpp.values import Array, Episode, Instance

GROUP_SIZE = 50
"""People whose motion is simulated at once: one by one takes twenty times longer."""


@dataclass(frozen=True)
class DecisionResult:
    """How a decision went, from the hidden truth.

    actual: the value of the target. report: what the robot said it is, None if nothing.
    cost, return_: as in `SimulatedWorld`.
    """

    actual: str
    report: str | None
    cost: float
    return_: float

    def to_extra(self) -> dict[str, Any]:
        """For a store beside the track, whose label the report is."""
        return {"simulated": {"actual": self.actual, "cost": self.cost, "earned": self.return_}}

    @classmethod
    def from_stored(cls, stored: StoredTrack) -> DecisionResult | None:
        """Of a decision in a store; None where nobody knows the truth."""
        known = stored.extra.get("simulated")
        if not isinstance(known, dict) or not {"actual", "cost", "earned"} <= set(known):
            return None
        return cls(known["actual"], stored.label_history[0].label, known["cost"], known["earned"])


class PeopleStream:
    """Simulated people, one after the other; each depends on the seed and the place in the line alone.

    So a run that goes on after a crash meets those whom it would have met without it.
    """

    def __init__(self, domain: Domain, appearance: TrajectorySource, seed: int, *, met: int = 0) -> None:
        """met: how many people of the line have been met before."""
        self._domain, self._appearance, self._seed = domain, appearance, seed
        self._population, self._stage = Population(domain), SimulationModel(domain)
        self._group: list[tuple[Person, Array]] = []
        self._met = met
        self._meeting: tuple[Person, SimulatedWorld] | None = None

    def next(self) -> tuple[Instance, SimulatedWorld]:
        """The next person: what the robot perceives, and the world in which to act; line 8 of Algorithm 1."""
        group, place = divmod(self._met, GROUP_SIZE)
        if not self._group or place == 0:
            rng = np.random.default_rng([self._seed, 1, group])
            people = self._population.sample(GROUP_SIZE, rng)
            self._group = list(zip(people, self._appearance.trajectories(people, rng), strict=True))
        person, track = self._group[place]
        world = self._stage.make_world(person, np.random.default_rng([self._seed, 2, self._met]))
        self._met += 1
        self._meeting = person, world
        return Instance(track, {name: person[name] for name in self._domain.observed}), world

    def outcome(self, episode: Episode) -> DecisionResult:
        """How the decision about the person met last went."""
        assert self._meeting is not None
        person, world = self._meeting
        return DecisionResult(person[self._domain.target], episode.report, world.cost, world.return_)


class Log:
    """The batches so far, as lines to read and, where there is a folder, as files kept up to date.

    written: the files. unsaved: why the classifier is not among them.
    """

    def __init__(
        self,
        domain: Domain,
        folder: Path | None,
        rows: Sequence[dict[str, float | int | str]] = (),
        outcomes: Sequence[DecisionResult] = (),
    ) -> None:
        """rows, outcomes: batches that an earlier run completed, and what it decided since."""
        self._domain, self._folder = domain, folder
        self.rows, self._outcomes = list(rows), list(outcomes)
        self.written: list[Path] = []
        self.unsaved: str | None = None

    def decided(self, outcome: DecisionResult) -> None:
        """Remember how a decision of the batch that goes on went."""
        self._outcomes.append(outcome)

    def standing(self, batch: Batch) -> str:
        """The data and the matrix that a batch left, in words."""
        rates = ", ".join(
            f"{name} {rate:.3f}"
            for name, rate in zip(
                batch.confusion.classes, np.diag(batch.confusion.probabilities), strict=True
            )
        )
        return f"{len(batch.dataset)} tracks; told right: {rates}; change {batch.change:.3f}"

    def add(self, batch: Batch) -> str:
        """Write down a batch and say in a line how it went."""
        line = f"batch {batch.number}: {self.standing(batch)}"
        cells: dict[str, float | int | str] = {
            "batch": batch.number,
            "tracks": len(batch.dataset),
            "change": batch.change,
        }
        if self._outcomes:
            result = self._scores(self._outcomes)
            self._outcomes = []
            cells |= {name: value for name, value in to_row(result).items() if name in METRICS}
            f1, cost, return_ = result.f1.estimate, result.cost.estimate, result.return_.estimate
            line += f"; F1 {f1:.3f}, cost {cost:.2f}, return {return_:.2f}"
        self.rows.append(cells)
        self.write(batch)
        return line

    def _scores(self, outcomes: Sequence[DecisionResult]) -> Scores:
        values = self._domain.values
        counts = np.zeros((len(values), len(values) + 1))
        for outcome in outcomes:
            reported = len(values) if outcome.report is None else values.index(outcome.report)
            counts[values.index(outcome.actual), reported] += 1
        cost = np.array([outcome.cost for outcome in outcomes])
        return_ = np.array([outcome.return_ for outcome in outcomes])
        return score_decisions(
            "LCORPP", counts, cost, return_, values=values, positive=self._domain.learning.positive
        )

    def write(self, batch: Batch) -> None:
        """Bring the files up to date, `batch` being the last one; nothing without a folder."""
        folder = self._folder
        if folder is None:
            return
        self.written = [folder / "batches.csv", folder / "batches.json"]
        write_csv(self.written[0], ("batch", "tracks", "change", *METRICS), self.rows)
        write_json(self.written[1], {"domain": self._domain.name, "batches": self.rows})
        classifier = batch.classifier
        if isinstance(classifier, SoftClassifier):
            classifier = classifier.trained
        if isinstance(classifier, TrainedClassifier):
            try:
                save_classifier(classifier, folder / "classifier.npz")
                self.written.append(folder / "classifier.npz")
            except DataError as error:
                self.unsaved = str(error)
        decided = [cells for cells in self.rows if "f1" in cells]
        if decided:
            figure = plot_augmentation(
                [int(cells["batch"]) for cells in decided],
                [float(cells["f1"]) for cells in decided],
                [float(cells["change"]) for cells in decided],
            )
            self.written += write_figure(figure, folder, "batches", ("png",))
