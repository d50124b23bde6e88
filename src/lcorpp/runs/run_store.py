"""Run store: the decisions of a run of Algorithm 1 and a checkpoint of every training, to resume it.

Each sense that learns has a store of its own: the first one in `FILE.tracks`, others in `FILE-SENSE.tracks`.
`append_decision` returns when the decision is on the disk, `save_checkpoint` when the batch is. After an
interruption of any kind the next run resumes there. The stores are authoritative: without a usable checkpoint
the classifiers are trained again, and nothing else is lost.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self
from uuid import uuid4

from lcorpp.decision import Batch, ResumePoint, TrainedSense
from lcorpp.decision.lcorpp import Train, Training
from lcorpp.learning.store import NewTrack, Snapshot, Store, StoredTrack, TrackSchema
from lcorpp.runs.checkpoint import CheckpointFolder, Json, Rows
from lcorpp.values import Array, Dataset, Distribution, LabelEvidence, track_hash

STRATEGY, EVIDENCE = "strategy", "evidence"
"""Keys in the extra data of a stored decision; only runs with trust or the alarm have them."""


class RunStore:
    """The stores of a run and its checkpoint in the folder `<store>.checkpoint`; for one process at a time.

    stores: sense -> its store, open for writing. A decision is complete when the first one contains it.
    notes: warnings from opening the stores and reading the checkpoint, as sentences.
    pending: the stored decisions since the last training.
    n_people: number of people that the run has drawn so far, in all batches.

    Examples:
        >>> from lcorpp import Dataset, Distribution
        >>> from lcorpp.runs import RunStore
        >>> walk, classes = [[0.0, 1.0, 2.0], [0.0, 0.0, 0.0]], ("no", "yes")  # x and y in metres
        >>> data, belief = Dataset([walk], ["yes"], interval=0.5), Distribution(classes, [0.9, 0.1])
        >>> store = RunStore("run.tracks", {"motion": data}, {"motion": classes}, {"seed": 0})
        >>> _ = store.append_decision(
        ...     {"motion": walk}, {"time": "noon"}, {"motion": "no"}, {"motion": belief}, [("ask", "neg")], {}
        ... )
        >>> store.datasets()["motion"].labels  # the initial data, and the report
        ('yes', 'no')
        >>> store.close()
    """

    def __init__(
        self,
        path: str | Path,
        datasets: Mapping[str, Dataset],
        classes: Mapping[str, Sequence[str]],
        settings: Mapping[str, Any],
    ):
        """Open or create the stores and read the checkpoint of an earlier run.

        Args:
            path: of the store of the first sense.
            datasets: sense -> its initial data, for each sense that learns; the signals of its store have the
                same schema.
            classes: sense -> the classes that it predicts.
            settings: everything else that a training depends on, as JSON can represent it, e.g. the seed; a
                checkpoint with other settings is not used.

        Raises:
            FileError, DataError: as `Store`.
        """
        path, self._initial = Path(path), dict(datasets)
        first = next(iter(datasets))
        digests = {
            "data" if name == first else f"{name} data": _compute_digest(dataset)
            for name, dataset in datasets.items()
        }
        with ExitStack() as stack:
            self.stores = {
                name: stack.enter_context(
                    Store(
                        path if name == first else path.with_name(f"{path.stem}-{name}{path.suffix}"),
                        TrackSchema.from_dataset(dataset, classes[name]),
                    )
                )
                for name, dataset in datasets.items()
            }
            self.store = self.stores[first]
            self.notes = [note for store in self.stores.values() for note in store.notes]
            snapshots = {name: store.snapshot() for name, store in self.stores.items()}
            folder = self.store.path.with_name(f"{self.store.path.name}.checkpoint")
            self._folder = CheckpointFolder(folder, self.store.identity, {**settings, **digests})
            has_records = len(snapshots[first]) > 0
            self._checkpoint = self._folder.read(datasets, has_records, self.notes.append)
            self._run = self._checkpoint.run if self._checkpoint else uuid4().hex[:12]
            self._number = self._checkpoint.number if self._checkpoint else 0
            self.pending = self._find_pending(snapshots[first])
            self._n_pending = {name: len(self._find_pending(own)) for name, own in snapshots.items()}
            met = [stored.extra.get("met") for stored in snapshots[first]]
            self.n_people = 1 + max((number for number in met if type(number) is int), default=-1)
            self._files = stack.pop_all()

    @property
    def number(self) -> int | None:
        """The last completed batch of the resumed run; None for a new run."""
        return self._checkpoint.number if self._checkpoint else None

    @property
    def rows(self) -> Rows:
        """Batch results reported by the resumed run."""
        return list(self._checkpoint.rows) if self._checkpoint else []

    def datasets(self, without: Sequence[StoredTrack] = ()) -> dict[str, Dataset]:
        """Return Omega of each sense: the initial data and those of its store, but for `without`."""
        excluded = {track.id for track in without}
        complete = {track.id for track in self.store.snapshot()}
        datasets = {}
        for name, store in self.stores.items():
            snapshot = store.snapshot()
            chosen = [
                track
                for track in snapshot.select()
                if track.id not in excluded and (track.id in complete or "run" not in track.extra)
            ]
            added = snapshot.dataset(chosen)
            pairs = list(zip(added.trajectories, added.labels, strict=True))
            evidence = [find_stored_evidence(track) for track in chosen]
            datasets[name] = self._initial[name].append(pairs, added.groups, evidence)
        return datasets

    def decisions(self, name: str) -> list[tuple[StoredTrack, Array]]:
        """Return the robot's complete decisions, of all runs, with a signal of a sense, and the signals."""
        complete, snapshot = {track.id for track in self.store.snapshot()}, self.stores[name].snapshot()
        tracks = [
            track for track in snapshot if track.points and track.id in complete and "met" in track.extra
        ]
        return list(zip(tracks, snapshot.trajectories(tracks), strict=True)) if tracks else []

    def resume(self, train: Train) -> ResumePoint | None:
        """Return the state in which the earlier run ended; None for a new run.

        Args:
            train: trains the classifier of a sense if the checkpoint has none, or if people have labelled its
                signals since.
        """
        if self._checkpoint is None:
            return None
        senses = {name: self._resume_sense(name, train) for name in self.stores}
        return ResumePoint(self._checkpoint.number, senses, len(self.pending))

    def _resume_sense(self, name: str, train: Train) -> TrainedSense:
        assert self._checkpoint is not None
        checkpoint = self._checkpoint.senses[name]
        since = self.stores[name].last_record - self._n_pending[name] - checkpoint.records
        if since:
            text = (
                f"{since} records were added by persons or another run: trained again"
                if since > 0
                else f"{-since} records that the last training used are lost: trained again"
            )
            self.notes.append(text if len(self.stores) == 1 else f"{name}: {text}")
            training = Training(*train(name, self.datasets()[name]))
            return TrainedSense(
                training.classifier, training.confusion, checkpoint.confusion, training.against_reports
            )
        trained = checkpoint.classifier
        if trained is None:
            trained = train(name, self.datasets(without=self.pending)[name])[0]
        return TrainedSense(trained, checkpoint.confusion, checkpoint.previous, checkpoint.against_reports)

    def append_decision(
        self,
        signals: Mapping[str, Array],
        context: Mapping[str, str],
        labels: Mapping[str, str | None],
        beliefs: Mapping[str, Distribution],
        answers: Sequence[tuple[str, str]],
        extra: Mapping[str, Any],
    ) -> str:
        """Store a decision: the signals, the reported classes and the beliefs behind them, by sense.

        The decision is on the disk when this method returns.

        Args:
            signals: those of the senses that learn, and maybe others; without those that perceived nothing.
            labels: the class by the robot's report, None without a report.
            beliefs: over the classes, when the robot reported.
            answers: pairs (action, observation), as `Episode.answers`.
            extra: further data to store, e.g. the simulated truth.

        Returns:
            The id of the decision in each store.
        """
        id = f"{self._run}-{self.n_people}"
        for name, store in reversed(self.stores.items()):  # the first one completes the decision
            if id in store:  # a crash came before the decision was complete; now it was made again
                continue
            track = NewTrack(
                signals.get(name),
                labels[name] if name in signals else None,
                belief=beliefs[name],
                context=context,
                id=id,
                extra={
                    "run": self._run,
                    "batch": self._number + 1,
                    "met": self.n_people,
                    "answers": answers,
                    **extra,
                },
            )
            store.append(track)
        self.n_people += 1
        return id

    @property
    def session(self) -> Json | None:
        """The state of the session at the checkpoint, see `LearningSession.state`."""
        return self._checkpoint.session if self._checkpoint else None

    def save_checkpoint(self, batch: Batch, rows: Rows, session: Json | None = None) -> None:
        """Write the checkpoint of a batch, whole or not at all.

        Args:
            session: the state of the session, if the run has one.

        Raises:
            FileError: it cannot be written.
        """
        if batch.number != self._number:
            self._number, self.pending, self._n_pending = batch.number, (), dict.fromkeys(self.stores, 0)
        records = {name: store.last_record - self._n_pending[name] for name, store in self.stores.items()}
        self._folder.write(self._run, batch.number, rows, batch.senses, records, session)

    def __repr__(self) -> str:
        state = "new run" if self.number is None else f"resumed after batch {self.number}"
        return f"RunStore({str(self.store.path)!r}, {state}, {len(self.pending)} decisions since)"

    def close(self) -> None:
        """Close the stores, so that another process can write to them."""
        self._files.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _find_pending(self, snapshot: Snapshot) -> tuple[StoredTrack, ...]:
        """Return the decisions of the batch that is not complete."""
        batch = self._run, self._number + 1
        return tuple(
            stored for stored in snapshot if (stored.extra.get("run"), stored.extra.get("batch")) == batch
        )


def find_stored_evidence(track: StoredTrack) -> LabelEvidence | None:
    """Return what a robot's label is based on; None for a label by a person.

    Earlier versions did not store the answers.
    """
    record, stored = track.label_record, track.extra.get("answers")
    if record.source != "robot" or record.belief is None:
        return None
    answers = None if stored is None else tuple((action, observation) for action, observation in stored)
    return LabelEvidence(dict(record.belief), dict(track.context), answers)


def _compute_digest(dataset: Dataset) -> str:
    """Return a text that only equal data sets share; it identifies the initial data, which are not stored."""
    labels = zlib.crc32("\n".join(dataset.labels).encode())
    digest = track_hash(dataset.trajectories).removeprefix("track ")
    weights = f"-{zlib.crc32(dataset.weights.tobytes()):08x}" if dataset.is_weighted else ""
    return f"{len(dataset)} {dataset.unit}, {digest}-{labels:08x}{weights}"
