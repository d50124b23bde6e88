"""`lcorpp track`: people seen by a camera, as tracks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.errors import DataError, FileError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.camera import Frame, FrameSource, Intrinsics, Locator, Sample
    from lcorpp.camera.mounting import FloorObserver

SUFFIXES = (".csv", ".parquet", ".pq")
"""Formats of tracks."""

CLOCK_TOLERANCE = 1e-6
"""Seconds by which a time may exceed --from and --to: rounding of the clock."""


def track(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A folder of images, a video, or a bag: a ROS 1 .bag file or a ROS 2 folder.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Write the tracks: .csv or .parquet.")
    ],
    homography: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="For colour: three rows of three numbers that map pixels to metres on the floor.",
        ),
    ] = None,
    detector: Annotated[
        str,
        typer.Option(metavar="NAME", help="For colour: background, hog, or your function as FILE.py:NAME."),
    ] = "background",
    intrinsics: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(
            metavar="FX FY CX CY",
            help="For depth: focal lengths and principal point in pixels; a bag has them.",
        ),
    ] = None,
    topic: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="The topic of a bag: of a people tracker, a laser scanner or of images."
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            help="Images a second; by default a video's own, and a folder's names are times in seconds.",
        ),
    ] = None,
    rotate: Annotated[
        int,
        typer.Option(
            metavar="DEGREES",
            help="For depth: turn the images clockwise by 90, 180 or 270 degrees: the floor must be below.",
        ),
    ] = 0,
    depth_scale: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            help="For depth: values a metre, e.g. 5000; by default 1000 in 16 bits, and 1 in 32 bits.",
        ),
    ] = None,
    start: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Leave out what is before, in seconds.")
    ] = None,
    end: Annotated[
        float | None, typer.Option("--to", metavar="S", help="Leave out what is after, in seconds.")
    ] = None,
) -> None:
    """Track people whom a camera or a scanner sees, and write them.

    A bag with messages of a people tracker is read as tracks, not images, and with --topic of a laser scanner
    as scans (docs/guides/robot/people.md).

    Colour images need a homography, depth images the intrinsics. Positions are in metres: those of the
    homography, or x forward and y to the left of a depth camera, on the floor below it. Times are those of
    the source; --from and --to count from its first image or sample. Ctrl-C writes the tracks so far.
    """
    if output.suffix.lower() not in SUFFIXES:
        raise FileError(f"{output}: not the name of a recording; {expected_one_of(SUFFIXES)} at its end")
    output_files.check_writable(output)
    if start is not None and end is not None and not start < end:
        raise DataError(f"--from {start:g} --to {end:g}: expected the first to be less")
    if _is_bag(source) and _has_people(source, topic):
        from lcorpp.worlds.ros.people_bag import read_people_bag

        read = read_people_bag(source, topic)
        began = min((time for time, *_ in read), default=0.0)
        low, high = began + (start or 0.0), inf if end is None else began + end
        console.out.print(_write([own for own in read if low <= own[0] <= high], source, output))
        return
    from lcorpp.camera import Intrinsics, track_people
    from lcorpp.camera.mounting import check_rotation, rotate_frames

    check_rotation(rotate)
    frames, own_intrinsics = _open(source, topic, rate, depth_scale)
    known = own_intrinsics if intrinsics is None else Intrinsics(*intrinsics)
    cut = _cut(frames, start, end)
    first = next(cut, None)
    if first is None:
        raise DataError(f"{source}: has no images between --from and --to")
    if not first.is_depth and (rotate or depth_scale is not None):
        raise DataError(f"{first.place}: is a colour image; --rotate and --depth-scale are for depth images")
    locator, observer = _make_locator(first, homography, detector, known, rotate)
    turned = rotate_frames(chain([first], cut), rotate)
    samples: list[Sample] = []
    count, interrupted = 0, False
    try:
        with console.show_progress(f"tracking people in {source.name}", len(frames)) as advance:
            for frame, new in track_people(turned, locator):
                samples += new
                if observer is not None:
                    observer.observe(frame)
                count += 1
                advance(count, max(len(frames), count))
    except KeyboardInterrupt:
        interrupted = True
    written = _write(samples, source, output)
    note = None if observer is None else observer.explain(has_people=bool(samples))
    if note is not None:
        console.warn(f"{source}: {note}")
    if interrupted:
        raise KeyboardInterrupt(f"interrupted after {count} images; {written}")
    console.out.print(f"{written}, in {count} images")


def _open(
    source: Path, topic: str | None, rate: float | None, depth_scale: float | None
) -> tuple[FrameSource, Intrinsics | None]:
    """Return the frames of a source, and the intrinsics that it states."""
    from lcorpp.camera import Bag, ImageFolder, Video

    if _is_bag(source):
        if rate is not None:
            raise DataError("--rate is for folders and videos; the messages of a bag have times")
        bag = Bag(source, topic=topic, depth_scale=depth_scale)
        return bag, bag.intrinsics
    if topic is not None:
        raise DataError(
            f"--topic is for bags; {source} is a {'folder of images' if source.is_dir() else 'video'}"
        )
    if source.is_dir():
        return ImageFolder(source, rate=rate, depth_scale=depth_scale), None
    return Video(source, rate=rate), None


def _is_bag(source: Path) -> bool:
    return source.suffix.lower() == ".bag" or (source / "metadata.yaml").exists()


def _has_people(source: Path, topic: str | None) -> bool:
    """Return whether the topic of a bag is that of a people tracker, not of a camera."""
    from lcorpp.worlds.ros.people.laser_scan import LASER
    from lcorpp.worlds.ros.people_bag import list_topics
    from lcorpp.worlds.ros.sensor_messages import PEOPLE, TRANSFORMS

    topics = list_topics(source)
    if topic is not None and topic not in topics:
        known = [f"{name} ({kind})" for name, kind in sorted(topics.items())]
        raise DataError(f"{source}: has no topic {topic!r}; {expected_one_of(known)}")
    kinds = set(topics.values()) - {TRANSFORMS} if topic is None else {topics[topic]}
    return bool(kinds & PEOPLE.keys()) or (topic is not None and kinds == {LASER})


def _cut(frames: FrameSource, start: float | None, end: float | None) -> Iterator[Frame]:
    """Yield the frames from `start` to `end`, in seconds after the first one."""
    began = None
    for frame in frames:
        began = frame.time if began is None else began
        if end is not None and frame.time - began > end + CLOCK_TOLERANCE:
            return
        if start is None or frame.time - began >= start - CLOCK_TOLERANCE:
            yield frame


def _make_locator(
    first: Frame, homography: Path | None, detector: str, intrinsics: Intrinsics | None, rotate: int
) -> tuple[Locator, FloorObserver | None]:
    """Return the locator for images like the first one, turned; and of depth images an observer."""
    from lcorpp.camera import DepthLocator, GroundCamera, ImageLocator, make_detector, read_homography
    from lcorpp.camera.mounting import FloorObserver, rotate_intrinsics

    if first.is_depth:
        if homography is not None:
            raise DataError(f"{first.place}: has depths; --homography is for colour images")
        if intrinsics is None:
            raise DataError(f"{first.place}: has depths, whose camera is unknown; expected --intrinsics")
        size = (first.image.shape[1], first.image.shape[0])
        upright = rotate_intrinsics(intrinsics, rotate, size)
        depth_locator = DepthLocator(upright)
        return depth_locator, FloorObserver(depth_locator, upright)
    if homography is None:
        raise DataError(f"{first.place}: is a colour image; expected --homography, from pixels to metres")
    size = (first.image.shape[1], first.image.shape[0])
    try:
        camera = GroundCamera(read_homography(homography), size)
    except DataError as error:
        raise DataError(f"{homography}: {error}") from error
    return ImageLocator(make_detector(detector, camera), camera), None


def _write(samples: Sequence[tuple[float, int | str, float, float]], source: Path, output: Path) -> str:
    """Write the tracks of two samples and more; return what was written."""
    import numpy as np

    from lcorpp.learning import Recording, Track, write_recording

    tracks = []
    for person in sorted({sample[1] for sample in samples}):
        own: dict[float, tuple[float, float]] = {}
        for time, name, x, y in samples:
            if name == person:
                own.setdefault(time, (x, y))  # of equal times the first sample counts, as in a stream
        times = np.array(sorted(own))
        xs, ys = np.array([own[time] for time in times]).T
        if len(times) > 1:
            tracks.append(Track(str(person), times, {"x": xs, "y": ys}))
    if not tracks:
        return f"no people were tracked, and {output} is not written"
    write_recording(Recording(tuple(tracks), source=str(source)), output)
    return f"wrote {output}: {len(tracks)} tracks, {sum(map(len, tracks))} samples"
