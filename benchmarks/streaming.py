"""Cost of streaming classification: CPU time per sample and person, on one core.

    OMP_NUM_THREADS=1 python benchmarks/streaming.py [--people 50] [--seconds 10] [--out TABLE.md]

Simulated people of the intention domain are sampled at 30 Hz. Each learner is trained on other people, and
its `StreamingClassifier` processes all samples, one by one or a frame at once. "Realistic" samples have
jitter, and some are lost, late, duplicated or not a number; the allowed lateness is .1 s. Every final
prediction is compared with the batch prediction for the same samples.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Hashable, Sequence
from datetime import date
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from lcorpp.domains import load_domain
from lcorpp.files import make_folder, write_atomically
from lcorpp.learning import StreamingClassifier, with_prefix_ensemble
from lcorpp.learning.classifiers.registry import learner
from lcorpp.values import Array

RATE = 30.0
"""Samples per second."""

TRACKS, EPOCHS, INTERVAL = 400, 5, 0.033
"""Of the training; its accuracy does not matter here."""

Sample = tuple[Any, ...]
Frames = list[list[Sample]]

COLUMNS = (
    "learner",
    "points a second",
    "samples",
    "given",
    "samples in all",
    "CPU a sample and person",
    "first second",
    "last second",
    "CPU a frame: 99 % within",
    "at most",
    "load at 30 Hz",
    "stream and batch differ by",
)


def main(
    people: Annotated[int, typer.Option(help="People at once.")] = 50,
    seconds: Annotated[float, typer.Option(help="How long they are followed, up to 10.")] = 10.0,
    out: Annotated[Path | None, typer.Option(help="Write the table there, in Markdown.")] = None,
) -> None:
    """Measure, print the table and write it to `--out`."""
    rng = np.random.default_rng(0)
    tracks, labels = _tracks(TRACKS, rng)
    walks = _sample(_tracks(people, rng)[0], seconds)
    realistic_walks = _make_realistic(walks, rng)
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    for name, rate, realistic, together in (
        ("lstm", 3.0, False, True),
        ("lstm", 3.0, False, False),
        ("lstm", 3.0, True, True),
        ("lstm", 30.0, False, True),
        ("lstm", 30.0, False, False),
        ("lstm, prefix ensemble", 3.0, False, True),
        ("summaries", 3.0, False, True),
        ("summaries", 3.0, False, False),
        ("forest", 3.0, False, True),
        ("forest", 3.0, False, False),
        ("minirocket", 3.0, False, True),
        ("minirocket", 3.0, False, False),
        ("minirocket, prefix ensemble", 3.0, False, True),
    ):
        kind, _, ensemble = name.partition(", ")
        epochs = EPOCHS if kind == "lstm" else None
        pipeline = learner(kind, interval=INTERVAL, epochs=epochs).set_params(motion__rate=rate)
        pipeline = with_prefix_ensemble(pipeline) if ensemble else pipeline
        pipeline.fit(tracks, np.array(labels))
        row = _measure(pipeline, realistic_walks if realistic else walks, realistic, together)
        how = ("realistic" if realistic else "regular", "a frame at once" if together else "one by one")
        lines.append("| " + " | ".join([name, f"{rate:g}", *how, *row]) + " |")
        Console().print(lines[-1])
    text = (
        "# Streaming\n\n"
        f"`python benchmarks/streaming.py --people {people} --seconds {seconds:g}`, {date.today()},"
        f" {platform.machine()}, Python {platform.python_version()}; one core, CPU time. Load: share of one"
        f" core that {people} people at 30 Hz take.\n\n" + "\n".join(lines) + "\n"
    )
    if out is not None:
        make_folder(out.parent)
        write_atomically(out, text)


def _tracks(count: int, rng: np.random.Generator) -> tuple[Array, list[str]]:
    simulation = load_domain("intention").simulation
    labels = ["interested", "not_interested"] * (count // 2)
    return np.array(simulation.signals["motion"]([{"intention": label} for label in labels], rng)), labels


def _sample(tracks: Array, seconds: float) -> Frames:
    """The samples (time, person, x, y) of each frame, 30 a second."""
    before = np.arange(tracks.shape[2]) * INTERVAL
    times = np.arange(0, min(seconds, before[-1]), 1 / RATE)
    rows = np.array([[np.interp(times, before, channel) for channel in track] for track in tracks])
    return [
        [(at, person, *rows[person, :, frame].tolist()) for person in range(len(tracks))]
        for frame, at in enumerate(times.tolist())
    ]


def _make_realistic(frames: Frames, rng: np.random.Generator) -> Frames:
    """Add 5 ms of jitter; 5 % of the samples are lost, 2 % each 60 ms late, duplicated or not a number."""
    changed: Frames = [[] for _ in range(len(frames) + 2)]
    for frame, samples in enumerate(frames):
        for at, person, *values in samples:
            fate = rng.uniform()
            stamp = at + rng.normal(0, 0.005)
            sample = (stamp, person, *values)
            if fate < 0.05:
                continue
            if fate < 0.07:
                changed[frame + 2].append(sample)
            elif fate < 0.09:
                changed[frame] += [sample, sample]
            elif fate < 0.11:
                changed[frame].append((stamp, person, float("nan"), values[1]))
            else:
                changed[frame].append(sample)
    return [frame for frame in changed if frame]


def _measure(pipeline: Any, frames: Frames, realistic: bool, together: bool) -> list[str]:
    streams = StreamingClassifier(pipeline, allowed_lateness=0.1 if realistic else 0.0, min_points=2)
    streams.push(-10.0, "before", 0.0, 0.0)  # triggers lazy initialisation
    streams.remove("before")
    costs = []
    for samples in frames:
        began = time.process_time()
        if together:
            streams.push_many(samples)
        else:
            for sample in samples:
                streams.push(*sample)
        costs.append(time.process_time() - began)
    cost, count = np.array(costs), np.array([len(samples) for samples in frames])
    second = round(RATE)
    parts = [slice(None), slice(0, second), slice(-second, None)]
    each = [f"{1e3 * cost[part].sum() / count[part].sum():.4f} ms" for part in parts]
    people = len({person for samples in frames for _, person, *_ in samples})
    return [
        str(int(count.sum())),
        *each,
        f"{1e3 * np.quantile(cost, 0.99):.2f} ms",
        f"{1e3 * cost.max():.2f} ms",
        f"{100 * cost.sum() / count.sum() * RATE * people:.1f} %",
        f"{_difference(pipeline, streams, frames):.1g}",
    ]


def _difference(pipeline: Any, streams: StreamingClassifier, frames: Frames) -> float:
    """The largest difference between the final predictions and those of the pipeline for all samples."""
    tracks: dict[Hashable, dict[float, Sequence[float]]] = {}
    for samples in frames:
        for at, person, *values in samples:
            if np.isfinite(values).all():
                tracks.setdefault(person, {}).setdefault(at, values)
    worst = 0.0
    for person, track in tracks.items():
        times = sorted(track)
        motion = pipeline[0].transform_stamped(times, np.array([track[at] for at in times]).T)
        expected = pipeline[1:].predict_proba(motion)[0]
        prediction = streams.remove(person)
        assert prediction.track == 1, f"{person}: {streams.report()}"
        worst = max(worst, float(np.abs(prediction.probabilities - expected).max()))
    return worst


if __name__ == "__main__":
    typer.run(main)
