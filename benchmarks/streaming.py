"""What it costs to classify people while they move: CPU time per sample and person, on one core.

    OMP_NUM_THREADS=1 python benchmarks/streaming.py [--people 50] [--seconds 10] [--out TABLE.md]

People of the intention domain are sampled 30 times a second, each learner is trained on others of them, and
its streams are given all samples: one by one, or those of a frame together. "As in life" has jitter, samples
that are lost, late, double or not a number, and waits .1 s for late ones. Every answer at the end is held
against the batch answer for the same samples.
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
from lcorpp.learning.classifiers.registry import learner
from lcorpp.learning.streaming import StreamingClassifier, with_prefix_ensemble
from lcorpp.values import Array

RATE = 30.0
"""Samples per second."""

TRACKS, EPOCHS, INTERVAL = 400, 5, 0.033
"""To train on; how well does not matter here."""

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
    """Measure and print, and write the table where `--out` says."""
    rng = np.random.default_rng(0)
    tracks, labels = _tracks(TRACKS, rng)
    walks = _sampled(_tracks(people, rng)[0], seconds)
    lively = _as_in_life(walks, rng)
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    for name, rate, lived, together in (
        ("lstm", 3.0, False, True),
        ("lstm", 3.0, False, False),
        ("lstm", 3.0, True, True),
        ("lstm", 30.0, False, True),
        ("lstm", 30.0, False, False),
        ("lstm, every age", 3.0, False, True),
        ("summaries", 3.0, False, True),
        ("forest", 3.0, False, True),
    ):
        kind, _, every_age = name.partition(", ")
        epochs = EPOCHS if kind == "lstm" else None
        pipeline = learner(kind, interval=INTERVAL, epochs=epochs).set_params(motion__rate=rate)
        pipeline = with_prefix_ensemble(pipeline) if every_age else pipeline
        pipeline.fit(tracks, np.array(labels))
        row = _measured(pipeline, lively if lived else walks, lived, together)
        how = ("as in life" if lived else "regular", "a frame at once" if together else "one by one")
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
    assert simulation is not None
    assert simulation.trajectories is not None
    labels = ["interested", "not_interested"] * (count // 2)
    return np.array(simulation.trajectories([{"intention": label} for label in labels], rng)), labels


def _sampled(tracks: Array, seconds: float) -> Frames:
    """The samples (time, person, x, y) of each frame, 30 a second."""
    before = np.arange(tracks.shape[2]) * INTERVAL
    times = np.arange(0, min(seconds, before[-1]), 1 / RATE)
    rows = np.array([[np.interp(times, before, channel) for channel in track] for track in tracks])
    return [
        [(at, person, *rows[person, :, frame].tolist()) for person in range(len(tracks))]
        for frame, at in enumerate(times.tolist())
    ]


def _as_in_life(frames: Frames, rng: np.random.Generator) -> Frames:
    """Jitter of 5 ms, one in twenty lost, one in fifty 60 ms late, doubled or not a number."""
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


def _measured(pipeline: Any, frames: Frames, lived: bool, together: bool) -> list[str]:
    streams = StreamingClassifier(pipeline, allowed_lateness=0.1 if lived else 0.0)
    streams.push(-10.0, "before", 0.0, 0.0)  # what is made when first used is made
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
    """The most by which the last answers differ from those of the pipeline to all samples."""
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
