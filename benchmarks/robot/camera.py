r"""Accuracy and CPU time of `lcorpp track`'s parts, on a public video and on synthetic depth images.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/robot/camera.py --video vtest.avi \
        --truth gt.txt --out benchmarks/results/camera.md

vtest.avi is in Debian's package opencv-doc; it is the sequence PETS09-S2L1 (795 images, 7 a second). gt.txt
is its ground truth in the format of MOT15 (train/PETS09-S2L1/gt/gt.txt of 2DMOT2015): frame, id, left, top,
width, height, 1, x, y, z. The homography is fitted to its pairs of foot points and metres: the camera's
calibration. Nothing else of the ground truth is used.
"""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterable, Iterator
from datetime import date
from itertools import islice
from pathlib import Path
from time import process_time
from typing import Annotated

import numpy as np
import typer

from lcorpp.camera import (
    DepthLocator,
    Frame,
    GroundCamera,
    ImageLocator,
    Locator,
    Sample,
    Tracker,
    TrackingScore,
    Video,
    make_detector,
    score_tracks,
    track_people,
)
from lcorpp.camera.frames import make_frame
from lcorpp.files import write_atomically
from lcorpp.values import Array

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.camera.corridor import Mount, add_noise, render, walk, walk_side_by_side

RATE = 7.0
"""Images a second of PETS09-S2L1; the file states another rate."""

MAX_PIXELS, MAX_METRES = 40.0, 0.5
"""Maximum distance of a match, of foot points in the video and of positions in the corridor."""

HEADING = ("", "true samples", "MOTA", "IDF1", "RMSE", "missed", "false", "switches", "CPU an image")

MOUNTS = {
    "1.2 m, 9 degrees down": Mount(),
    "0.6 m, level": Mount(camera_height=0.6, tilt=0.0),
    "2.2 m, 29 degrees down": Mount(camera_height=2.2, tilt=0.5),
    "1.1 m, 6 degrees down, 320 x 240": Mount(320, 240, 285.0, 1.1, 0.1),
}


def main(
    video: Annotated[Path | None, typer.Option(help="vtest.avi.")] = None,
    truth: Annotated[Path | None, typer.Option(help="Its ground truth, gt.txt of MOT15.")] = None,
    hog: Annotated[bool, typer.Option("--hog", help="Also the HOG detector, which takes minutes.")] = False,
    seconds: Annotated[float, typer.Option(help="Of each scene in the corridor.")] = 15.0,
    out: Annotated[Path | None, typer.Option(help="Write the tables there, in Markdown.")] = None,
) -> None:
    """Measure, print the tables and write them to `--out`."""
    tables = []
    if video is not None and truth is not None:
        tables.append(format_table("vtest.avi, background", measure_video(video, truth, "background")))
        if hog:
            tables.append(format_table("vtest.avi, HOG", measure_video(video, truth, "hog", parts=False)))
    tables.append(format_table("Depth corridor", measure_corridor(seconds)))
    words = [Path(word).name if Path(word).is_absolute() else word for word in sys.argv]
    text = (
        f"# Camera\n\n`python {' '.join(words)}`, {date.today()}, {platform.machine()}, Python"
        f" {platform.python_version()}, one thread.\n\n" + "\n".join(tables)
    )
    if out is not None:
        write_atomically(out, text)


def format_table(title: str, rows: Iterator[tuple[str, TrackingScore, str, float]]) -> str:
    """Print rows as they come and return them as a table."""
    lines = [f"## {title}", "", "| " + " | ".join(HEADING) + " |", "|---" * len(HEADING) + "|"]
    print("\n".join(lines))
    for name, score, unit, milliseconds in rows:
        cells = (
            name,
            str(score.truths),
            f"{score.mota:.3f}",
            f"{score.idf1:.3f}",
            f"{score.rmse:.3f} {unit}" if unit == "m" else f"{score.rmse:.1f} {unit}",
            str(score.misses),
            str(score.false_positives),
            str(score.switches),
            f"{milliseconds:.1f} ms",
        )
        lines.append("| " + " | ".join(cells) + " |")
        print(lines[-1], flush=True)
    return "\n".join(lines) + "\n"


def measure_video(
    video: Path, truth: Path, detector: str, parts: bool = True
) -> Iterator[tuple[str, TrackingScore, str, float]]:
    """Yield rows for the whole video and for parts of it, each tracked from its own first image."""
    rows = np.loadtxt(truth, delimiter=",")
    feet = np.stack([rows[:, 2] + rows[:, 4] / 2, rows[:, 3] + rows[:, 5]], axis=1)
    times = (rows[:, 0] - 1) / RATE
    homography = fit_homography(feet, rows[:, 7:9])
    source = Video(video, rate=RATE)
    lengths = (
        [(0, len(source)), (0, 200), (200, 400), (400, 600), (600, 795)] if parts else [(0, len(source))]
    )
    size = next(iter(source)).image.shape
    camera = GroundCamera(homography, (size[1], size[0]))
    for first, last in lengths:
        frames = iter(source)
        for _ in range(first):
            next(frames)
        began = process_time()
        locator = ImageLocator(make_detector(detector, camera), camera)
        samples = track(islice(frames, last - first), locator)
        cost = 1000 * (process_time() - began) / (last - first)
        inside = (rows[:, 0] > first) & (rows[:, 0] <= last)
        people = to_samples(times[inside], rows[inside, 1], feet[inside])
        found = to_samples(*split(samples)[:2], camera.to_pixels(split(samples)[2]))
        name = f"images {first + 1} to {last}"
        yield name, score_tracks(people, found, max_distance=MAX_PIXELS), "px", cost


def fit_homography(pixels: Array, metres: Array) -> Array:
    """Return the (3, 3) homography from pixels (n, 2) to metres (n, 2), by least squares (direct linear)."""
    scale = np.diag([1 / 500, 1 / 500, 1.0])
    points = np.column_stack([pixels / 500, np.ones(len(pixels))])
    zeros = np.zeros_like(points)
    equations = np.concatenate(
        [
            np.column_stack([points, zeros, -metres[:, :1] * points]),
            np.column_stack([zeros, points, -metres[:, 1:] * points]),
        ]
    )
    homography: Array = np.linalg.svd(equations, full_matrices=False)[2][-1].reshape(3, 3) @ scale
    return homography


def measure_corridor(seconds: float) -> Iterator[tuple[str, TrackingScore, str, float]]:
    """Yield rows of synthetic scenes: people in lanes, and people side by side, .5 m from axis to axis."""
    for name, mount in MOUNTS.items():
        for count, together in (
            (1, False),
            (2, False),
            (3, False),
            (4, False),
            (2, True),
            (3, True),
            (4, True),
        ):
            rng = np.random.default_rng(count)
            scene = (walk_side_by_side if together else walk)(count, seconds, rng)
            locator, tracker = DepthLocator(mount.intrinsics), Tracker()
            truth: list[Sample] = []
            samples: list[Sample] = []
            cost = 0.0
            for index, people in enumerate(scene):
                image = add_noise(render(mount, people), rng)
                began = process_time()
                frame = make_frame(index / 10, image, "corridor")
                samples += tracker.update(frame.time, *locator.locate(frame.image))
                cost += process_time() - began
                truth += [(frame.time, i, p.x, p.y) for i, p in enumerate(people) if mount.sees(p.x, p.y)]
            seen = [sample for sample in samples if mount.sees(*sample[2:])]
            score = score_tracks(truth, seen, max_distance=MAX_METRES)
            where = "side by side" if together else "in lanes"
            yield f"{name}: {count} {where}", score, "m", 1000 * cost / len(scene)


def track(frames: Iterable[Frame], locator: Locator) -> list[Sample]:
    """Return all samples of some frames."""
    return [sample for _, new in track_people(frames, locator) for sample in new]


def split(samples: list[Sample]) -> tuple[Array, Array, Array]:
    """Return times, ids and (n, 2) positions."""
    table = np.array(samples, dtype=np.float64).reshape(-1, 4)
    return table[:, 0], table[:, 1], table[:, 2:]


def to_samples(times: Array, ids: Array, positions: Array) -> list[Sample]:
    """Return samples from columns."""
    return [(t, int(i), x, y) for t, i, (x, y) in zip(times, ids, positions.tolist(), strict=True)]


if __name__ == "__main__":
    typer.run(main)
