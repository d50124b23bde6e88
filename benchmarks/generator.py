"""Simulated tracks: accuracy of the paper's LSTM, label leakage, similarity to real pedestrians.

    python benchmarks/generator.py [--seeds 10] [--tracks 1600] [--pedestrians FOLDER] [--out TABLE.md]

For each seed: five-fold cross-validation of the paper's LSTM on balanced classes, for the whole track, its
first half and its first quarter, each trained on the same prefix; with the domain's number of epochs and the
paper's 300; and on 2286 tracks of which 63 are positive, with class weights. `--pedestrians` is a folder of
pedestrians in the `obsmat` layout at 2.5 Hz (ETH: eth, hotel; UCY: students03, zara01, zara02).

The table is rewritten after each seed, so the benchmark can be stopped at any time.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from scipy.stats import ks_2samp, t

from lcorpp.domains import Domain, load_domain
from lcorpp.files import make_folder, write_atomically
from lcorpp.learning import Validation, cross_validate, measure_leakage, paper_pipeline
from lcorpp.simulation.people import SimulatedSignals, simulate_dataset
from lcorpp.simulation.recordings import simulate_recording
from lcorpp.values import Array, Dataset

PAPER_EPOCHS = 300
PARTS = {"first quarter": 76, "first half": 152, "whole track": 304}
"""Time points of a prefix, for training and prediction."""
CASES, POSITIVE = 2286, 63
"""The paper's data set."""
EVERY = 12
"""Every twelfth point of a track, .396 s apart: near the 2.5 Hz of the pedestrians."""
MOVING = 0.1
"""Metres per second; below this speed a direction is noise."""
WALKING = 0.5
"""Mean speed, metres per second, from which a pedestrian counts as walking."""
QUANTITIES = {"speed": "m/s", "acceleration": "m/s²", "turning": "rad/s"}

Measured = dict[str, list[dict[str, float]]]
"""Name of a setting -> the metrics of each seed."""


def pedestrians(folder: Path) -> dict[str, list[Array]]:
    """Scene -> tracks (samples, 2) in metres, .4 s between two samples."""
    scenes = {}
    for file in sorted(folder.glob("*.txt")):
        rows = np.loadtxt(file)  # frame, person, x, z, y, vx, vz, vy
        tracks = [rows[rows[:, 1] == person] for person in np.unique(rows[:, 1])]
        step = np.median(np.concatenate([np.diff(track[:, 0]) for track in tracks]))
        pieces = [
            p for track in tracks for p in np.split(track, np.flatnonzero(np.diff(track[:, 0]) != step) + 1)
        ]
        scenes[file.stem.split("_")[-1]] = [piece[:, [2, 4]] for piece in pieces if len(piece) >= 3]
    return scenes


def measure_motion(tracks: Sequence[Array], seconds: float) -> dict[str, Array]:
    """Speed, and sizes of acceleration and turning, of tracks (samples, 2), `seconds` between samples."""
    found: dict[str, list[Array]] = {name: [] for name in QUANTITIES}
    for track in tracks:
        velocity = np.diff(track, axis=0) / seconds
        speed = np.hypot(*velocity.T)
        turn = np.diff(np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])))
        moving = (speed[1:] > MOVING) & (speed[:-1] > MOVING)
        found["speed"].append(speed)
        found["acceleration"].append(np.hypot(*(np.diff(velocity, axis=0) / seconds).T))
        found["turning"].append(np.abs(turn[moving]) / seconds)
    return {name: np.concatenate(values) for name, values in found.items()}


def walkers(scenes: dict[str, list[Array]]) -> dict[str, list[Array]]:
    """The tracks of walking pedestrians."""
    return {
        name: [t for t in tracks if np.hypot(*np.diff(t, axis=0).T).mean() / 0.4 >= WALKING]
        for name, tracks in scenes.items()
    }


def distances(one: dict[str, Array], other: dict[str, Array]) -> dict[str, float]:
    """Kolmogorov-Smirnov distance in each quantity."""
    return {name: float(ks_2samp(one[name], other[name]).statistic) for name in QUANTITIES}


def all_tracks(scenes: dict[str, list[Array]]) -> list[Array]:
    """The tracks of all scenes."""
    return [track for tracks in scenes.values() for track in tracks]


def passers_by(domain: Domain, count: int, seed: int) -> list[Array]:
    """Tracks (samples, 2) of people who are not interested, at the sampling rate of the pedestrians."""
    people = [{"intention": "not_interested"}] * count
    tracks = SimulatedSignals.from_domain(domain, domain.senses[0]).simulate(
        people, np.random.default_rng(seed)
    )
    return [track.T for track in tracks[:, :, ::EVERY]]


def imbalanced(domain: Domain, seed: int) -> Dataset:
    """A data set of the paper's size: 2286 tracks, 63 positive, shuffled."""
    rng = np.random.default_rng(seed)
    positive = rng.permutation(np.arange(CASES) < POSITIVE)
    labels = tuple("interested" if flag else "not_interested" for flag in positive)
    return Dataset(domain.simulation.signals["motion"]([{"intention": name} for name in labels], rng), labels)


def take_points(dataset: Dataset, points: int) -> Dataset:
    """The first points of every track."""
    return replace(dataset, trajectories=dataset.trajectories[:, :, :points])


def rates(validation: Validation, positive: str = "interested") -> dict[str, float]:
    """TPR and TNR, the pooled AUC, and the smallest fraction of a class among the predictions of a fold."""
    found = {rate.true: rate.value for rate in validation.recalls}
    predicted = np.array(validation.predictions) == positive
    shares = [predicted[np.array(validation.folds) == fold].mean() for fold in set(validation.folds)]
    other = next(name for name in found if name != positive)
    assert validation.auc is not None
    smallest = float(min(min(shares), 1 - max(shares)))
    return {"TPR": found[positive], "TNR": found[other], "AUC": validation.auc, "smallest share": smallest}


def main(
    seeds: Annotated[int, typer.Option(help="Data sets to generate and cross-validate.")] = 10,
    tracks: Annotated[
        int, typer.Option(help="Tracks of a balanced data set; 0 takes the domain's number.")
    ] = 0,
    weighted_seeds: Annotated[int, typer.Option(help="Imbalanced data sets; at most as many as seeds.")] = 10,
    pedestrians_folder: Annotated[
        Path | None, typer.Option("--pedestrians", help="Folder of real pedestrians.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Processes for the folds.")] = 1,
    out: Annotated[Path, typer.Option(help="The table; the picture goes beside it.")] = Path(
        "benchmarks/results/generator.md"
    ),
) -> None:
    """Measure, then write a table and a picture."""
    console = Console(stderr=True)
    domain = load_domain("intention")
    (sense,) = domain.senses
    tracks = tracks or sense.tracks
    make_folder(out.parent)
    scenes = pedestrians(pedestrians_folder) if pedestrians_folder else {}
    likeness = _likeness(domain, scenes) if scenes else []
    leaks = _leaks(domain)
    _plot(domain, scenes, out.with_suffix(".png"))
    found: Measured = {}
    for seed in range(seeds):
        for name, estimator, dataset in _work(domain, tracks, seed, seed < weighted_seeds):
            found.setdefault(name, []).append(
                rates(cross_validate(estimator(), dataset(), seed=seed, jobs=jobs))
            )
            metrics = ", ".join(f"{key} {value:.3f}" for key, value in found[name][-1].items())
            console.print(f"seed {seed}, {name}: {metrics}")
        write_atomically(out, _table(domain, tracks, found, leaks, likeness))
    console.print(f"wrote {out} and {out.with_suffix('.png')}")


def _work(
    domain: Domain, tracks: int, seed: int, weighted: bool
) -> list[tuple[str, Callable[[], Any], Callable[[], Dataset]]]:
    """(name, classifier, data set) of one seed."""
    (sense,), rng = domain.senses, np.random.default_rng([seed, 0])
    balanced = simulate_dataset(domain, sense, SimulatedSignals.from_domain(domain, sense), tracks, rng)
    work = list[tuple[str, Callable[[], Any], Callable[[], Dataset]]]()
    for epochs in (sense.epochs, PAPER_EPOCHS):

        def lstm(epochs: int = epochs) -> Any:
            return paper_pipeline(epochs=epochs, random_state=seed, class_weight="balanced")

        for name, points in PARTS.items():
            work.append((f"{name}, {epochs} epochs", lstm, partial(take_points, balanced, points)))
        if weighted:
            work.append((f"{CASES}/{POSITIVE}, {epochs} epochs", lstm, partial(imbalanced, domain, seed)))
    return work


def _leaks(domain: Domain) -> list[str]:
    recording = simulate_recording(domain, np.random.default_rng(0), tracks=2000, positives=1000)
    return [f"{leak.name} {leak.auc}" for leak in measure_leakage(recording)]


def _likeness(domain: Domain, scenes: dict[str, list[Array]]) -> list[str]:
    """Rows: the generator against scenes, and each scene against the others."""
    ours = measure_motion(passers_by(domain, 2000, 0), EVERY * 0.033)
    walk = walkers(scenes)
    each = {name: measure_motion(tracks, 0.4) for name, tracks in scenes.items()}
    lines = ["| | " + " | ".join(QUANTITIES) + " |", "|---|---|---|---|"]

    def row(name: str, values: dict[str, str]) -> None:
        lines.append(f"| {name} | " + " | ".join(values[q] for q in QUANTITIES) + " |")

    for name, tracks in (("all pedestrians", all_tracks(scenes)), ("walkers alone", all_tracks(walk))):
        found = distances(ours, measure_motion(tracks, 0.4))
        row(f"generator and {name}, all scenes", {q: f"**{d:.2f}**" for q, d in found.items()})
    for name, motion in each.items():
        row(f"generator and {name}", {q: f"{d:.2f}" for q, d in distances(ours, motion).items()})
    for name, motion in each.items():
        others = [distances(motion, other) for key, other in each.items() if key != name]
        row(
            f"{name} and the other scenes",
            {q: f"{min(d[q] for d in others):.2f} to {max(d[q] for d in others):.2f}" for q in QUANTITIES},
        )
    return lines


def _table(domain: Domain, tracks: int, found: Measured, leaks: list[str], likeness: list[str]) -> str:
    lines = [
        "# The generator: what can be learnt from it, and what not",
        "",
        f"`python benchmarks/generator.py`, {date.today()}, {platform.machine()}, {os.cpu_count()} cores,"
        f" Python {platform.python_version()}. The paper's LSTM, five-fold cross-validation, "
        f"pooled; mean over"
        f" the seeds (each with its own balanced data set of {tracks} tracks) and its 95 % interval. The"
        f" paper: TPR .76, TNR .71. {CASES}/{POSITIVE}: {CASES} tracks, {POSITIVE} positive, class weights."
        " Smallest share: the smallest fraction of a class among the predictions of any fold.",
        "",
        "| data, epochs | seeds | TPR | TNR | AUC | smallest share |",
        "|---|---|---|---|---|---|",
    ]
    for name, entries in found.items():
        cells = [_mean([entry[key] for entry in entries]) for key in ("TPR", "TNR", "AUC")]
        smallest = min(entry["smallest share"] for entry in entries)
        lines.append(f"| {name} | {len(entries)} | " + " | ".join(cells) + f" | {smallest:.2f} |")
    lines += [
        "",
        "Label leakage (AUC of `measure_leakage`, 1000 recordings of each class): " + ", ".join(leaks),
    ]
    if likeness:
        lines += [
            "",
            "Simulated people without interest and real pedestrians (ETH: Pellegrini et al. 2009; UCY: Lerner"
            " et al. 2007), both at 2.5 Hz, Kolmogorov-Smirnov distance of all samples. Half of the "
            "accelerations of"
            " the zara scenes are exactly 0, since they were drawn as straight pieces; a walker has a mean"
            f" speed of {WALKING} m/s or more.",
            "",
            *likeness,
        ]
    return "\n".join(lines) + "\n"


def _mean(values: list[float]) -> str:
    mean = float(np.mean(values))
    if len(values) < 2:
        return f"{mean:.3f}"
    half = float(t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values)))
    return f"{mean:.3f} ± {half:.3f}"


def _plot(domain: Domain, scenes: dict[str, list[Array]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(12, 7.4), layout="constrained")
    ours = measure_motion(passers_by(domain, 2000, 0), EVERY * 0.033)
    each = {name: measure_motion(tracks, 0.4) for name, tracks in scenes.items()}
    if scenes:
        each["all scenes"] = measure_motion(all_tracks(scenes), 0.4)
    for axis, (name, unit), end in zip(axes[0], QUANTITIES.items(), (2.5, 3.0, 2.5), strict=True):
        grid = np.linspace(0, end, 251)
        for scene, found in each.items():
            shares = np.searchsorted(np.sort(found[name]), grid, side="right") / len(found[name])
            whole = scene == "all scenes"
            axis.plot(grid, shares, label=scene, lw=2.2 if whole else 0.9, color="black" if whole else None)
        shares = np.searchsorted(np.sort(ours[name]), grid, side="right") / len(ours[name])
        axis.plot(grid, shares, label="generator", lw=2.6, color="#c0392b")
        axis.set(xlabel=f"{name} ({unit})", ylabel="share below", ylim=(0, 1), xlim=(0, end))
        axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=8)
    tracks_of = SimulatedSignals.from_domain(domain, domain.senses[0]).simulate
    speeds = axes[1, 2]
    for axis, intention, colour in zip(
        axes[1], ("interested", "not_interested"), ("#1b6ca8", "#d68910"), strict=False
    ):
        tracks = tracks_of([{"intention": intention}] * 600, np.random.default_rng(1))
        for track in tracks[:40]:
            axis.plot(*track, lw=0.8, alpha=0.7, color=colour)
            axis.plot(*track[:, -1], ".", ms=4, color=colour)
        axis.plot(0, 0, "s", ms=8, color="black")
        axis.set(title=f"40 people {intention.replace('_', ' ')}; a dot where they end",
                 xlabel="x (m)", ylabel="y (m)", xlim=(-16, 16), ylim=(-1.5, 17), aspect="equal")  # fmt: skip
        axis.title.set_fontsize(9)
        steps = np.hypot(*np.diff(tracks[:, :, ::15], axis=2).transpose(1, 0, 2)) / (15 * 0.033)
        middle, times = np.median(steps, axis=0), np.arange(steps.shape[1]) * 15 * 0.033
        low, high = np.quantile(steps, [0.25, 0.75], axis=0)
        speeds.plot(times, middle, color=colour, label=intention.replace("_", " "))
        speeds.fill_between(times, low, high, color=colour, alpha=0.2)
    speeds.set(xlabel="time (s)", ylabel="speed (m/s)", title="median and middle half", ylim=(0, 2))
    speeds.title.set_fontsize(9)
    speeds.legend(fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    typer.run(main)
