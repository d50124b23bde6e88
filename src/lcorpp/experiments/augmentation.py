"""Active data augmentation (Algorithm 1, supplementary figure): the people met, and how each batch went."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcorpp.decision import Batch
from lcorpp.domains import Domain
from lcorpp.experiments.metrics import Scores, scores
from lcorpp.experiments.people import Appearance, Person, Population
from lcorpp.experiments.plotting import plot_batches
from lcorpp.experiments.results import FIGURES, row, write_csv, write_json
from lcorpp.experiments.simulated_world import SimulatedWorld, Stage
from lcorpp.learning import TrainedClassifier, save_classifier
from lcorpp.values import Array, Instance

GROUP = 50
"""People whose motion is simulated at once: one by one takes twenty times longer."""

Meeting = tuple[Person, SimulatedWorld]


class Crowd:
    """Simulated people, one after the other; it remembers the hidden truth about those of the last batch."""

    def __init__(self, domain: Domain, appearance: Appearance, seed: int) -> None:
        self._domain, self._appearance = domain, appearance
        self._population, self._stage = Population(domain), Stage(domain)
        self._rng = np.random.default_rng([seed, 1])
        self._waiting: list[tuple[Person, Array]] = []
        self._meetings: list[Meeting] = []

    def next(self) -> tuple[Instance, SimulatedWorld]:
        """The next person: what the robot perceives, and the world in which to act; line 8 of Algorithm 1."""
        if not self._waiting:
            people = self._population.people(GROUP, self._rng)
            tracks = self._appearance.trajectories(people, self._rng)
            self._waiting = list(zip(people, tracks, strict=True))[::-1]
        person, track = self._waiting.pop()
        context = {name: person[name] for name in self._domain.observed}
        world = self._stage.world(person, self._rng)
        self._meetings.append((person, world))
        return Instance(track, context), world

    def met(self) -> list[Meeting]:
        """Those met since the last call."""
        meetings, self._meetings = self._meetings, []
        return meetings


class Log:
    """The batches so far, as lines to read and, where there is a folder, as files kept up to date."""

    def __init__(self, domain: Domain, folder: Path | None) -> None:
        self._domain, self._folder = domain, folder
        self._rows: list[dict[str, float | int | str]] = []
        self.written: list[Path] = []

    def add(self, batch: Batch, meetings: list[Meeting]) -> str:
        """Write down a batch and say in a line how it went."""
        rates = ", ".join(
            f"{name} {rate:.3f}"
            for name, rate in zip(
                batch.confusion.classes, np.diag(batch.confusion.probabilities), strict=True
            )
        )
        line = f"batch {batch.number}: {len(batch.dataset)} tracks; told right: {rates}"
        line += f"; change {batch.change:.3f}"
        cells: dict[str, float | int | str] = {
            "batch": batch.number,
            "tracks": len(batch.dataset),
            "change": batch.change,
        }
        if batch.episodes:
            result = self._scores(batch, meetings)
            cells |= {name: value for name, value in row(result).items() if name in FIGURES}
            line += (
                f"; F1 {result.f1.value:.3f}, cost {result.cost.value:.2f}, return {result.earned.value:.2f}"
            )
        self._rows.append(cells)
        if self._folder is not None:
            self._write(self._folder, batch)
        return line

    def _scores(self, batch: Batch, meetings: list[Meeting]) -> Scores:
        values = self._domain.values
        counts = np.zeros((len(values), len(values) + 1))
        for (person, _), episode in zip(meetings, batch.episodes, strict=True):
            reported = len(values) if episode.report is None else values.index(episode.report)
            counts[values.index(person[self._domain.target]), reported] += 1
        cost = np.array([world.cost for _, world in meetings])
        earned = np.array([world.earned for _, world in meetings])
        return scores("LCORPP", counts, cost, earned, values=values, positive=self._domain.positive)

    def _write(self, folder: Path, batch: Batch) -> None:
        self.written = [folder / "batches.csv", folder / "batches.json"]
        write_csv(self.written[0], ("batch", "tracks", "change", *FIGURES), self._rows)
        write_json(self.written[1], {"domain": self._domain.name, "batches": self._rows})
        if isinstance(batch.classifier, TrainedClassifier):
            self.written.append(folder / "classifier.npz")
            save_classifier(batch.classifier, self.written[-1])
        decided = self._rows[1:]
        if decided:
            self.written.append(folder / "batches.png")
            plot_batches(
                [int(cells["batch"]) for cells in decided],
                [float(cells["f1"]) for cells in decided],
                [float(cells["change"]) for cells in decided],
                self.written[-1],
            )
