"""`lcorpp track`: people whom a robot's sensors see, as tracks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options.recordings import LabelOption, parse_written_labels
from lcorpp.cli.options.senses import reject_given
from lcorpp.errors import DataError, FileError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.camera import Frame, FrameSource, Intrinsics, Locator
    from lcorpp.camera.mounting import FloorObserver
    from lcorpp.learning import Recording
    from lcorpp.worlds.ros.sensor_messages import Sample

SUFFIXES = (".csv", ".parquet", ".pq")
"""Formats of tracks."""

DETECTOR = "background"
"""Of people in colour images, by default."""

CLOCK_TOLERANCE = 1e-6
"""Seconds by which a time may exceed --from and --to: rounding of the clock."""


def track(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A folder of images, a video, a bag (a ROS 1 .bag file or a ROS 2 folder), or a folder of"
            " bags of people.",
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
    ] = DETECTOR,
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
            metavar="NAME",
            help="The topic of a bag: of a people tracker, a laser scanner, of frames (TF) or of images.",
        ),
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="For people by their frames: the frame in which they are placed, e.g. base_link; by default"
            " that of the camera.",
        ),
    ] = None,
    label: LabelOption = None,
    label_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="For bags: CSV of ids and labels, of tracks or of bags; others are left out. Without it"
            " --label finds the words in the names of bags.",
        ),
    ] = None,
    groups: Annotated[
        str | None,
        typer.Option(
            metavar="REGEX",
            help="For bags: who is in them, by their names, e.g. '[A-Z]{2}'; by default the ids of people.",
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

    A bag with messages of a people tracker is read as tracks, not images, with --topic of a laser scanner as
    scans, and without images by the frames of ROS4HRI, with gaze (docs/guides/robot/people.md).

    Colour images need a homography, depth images the intrinsics. Positions are in metres: those of the
    homography, or x forward and y to the left of a depth camera, on the floor below it. Times are those of
    the source; --from and --to count from its first image, or from the first sample of each bag. Ctrl-C
    writes the tracks of the images so far.
    """
    if output.suffix.lower() not in SUFFIXES:
        raise FileError(f"{output}: not the name of a recording; {expected_one_of(SUFFIXES)} at its end")
    output_files.check_writable(output)
    for name, value in (("--from", start), ("--to", end)):
        if value is not None and not isfinite(value):
            raise DataError(f"{name} {value:g}: expected a finite number of seconds")
    if start is not None and end is not None and not start < end:
        raise DataError(f"--from {start:g} --to {end:g}: expected the first to be less")
    if _has_people(source, topic):
        from lcorpp.worlds.ros.people.bag_recording import read_bags

        reject_given(
            f"{source} has people, whose positions are known; it is for images",
            homography=homography,
            detector=None if detector == DETECTOR else detector,
            intrinsics=intrinsics,
            rate=rate,
            rotate=rotate or None,
            depth_scale=depth_scale,
        )
        with console.show_progress(f"reading {source.name}") as advance:
            recording = read_bags(
                source,
                labels=parse_written_labels(label),
                label_file=label_file,
                groups=groups,
                topic=topic,
                frame=frame,
                progress=advance,
            )
        console.out.print(_write(_cut_recording(recording, start, end), source, output))
        return
    reject_given(
        f"{source} has images; people by their frames or a tracker have them",
        frame=frame,
        label=label,
        label_file=label_file,
        groups=groups,
    )
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
    from lcorpp.worlds.ros.sensor_messages import Sample

    samples: list[Sample] = []
    count, interrupted = 0, False
    try:
        with console.show_progress(f"tracking people in {source.name}", len(frames)) as advance:
            for image, new in track_people(turned, locator):
                samples += [Sample(time, str(person), x, y) for time, person, x, y in new]
                if observer is not None:
                    observer.observe(image)
                count += 1
                advance(count, max(len(frames), count))
    except KeyboardInterrupt:
        interrupted = True
    written = _write(_collect(samples, source), source, output)
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
    from lcorpp.camera.bags import is_bag

    if is_bag(source):
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


def _has_people(source: Path, topic: str | None) -> bool:
    """Return whether a source is a bag, or a folder of bags, with people rather than images.

    Frames are people if there are no images, or if they are the chosen topic.
    """
    from lcorpp.camera.bags import IMAGE
    from lcorpp.worlds.ros.connection import name_type
    from lcorpp.worlds.ros.people.bag_recording import find_bags
    from lcorpp.worlds.ros.people.laser_scan import LASER
    from lcorpp.worlds.ros.people.people_bag import list_topics
    from lcorpp.worlds.ros.sensor_messages import PEOPLE
    from lcorpp.worlds.ros.transforms import TRANSFORMS

    bags = find_bags(source)
    if bags != [source]:
        return bool(bags)
    topics = list_topics(source)
    if topic is not None:
        if topic not in topics:
            known = [f"{name} ({kind})" for name, kind in sorted(topics.items())]
            raise DataError(f"{source}: has no topic {topic!r}; {expected_one_of(known)}")
        return topics[topic] in (*PEOPLE, LASER, TRANSFORMS)
    kinds = set(topics.values())
    return bool(kinds & PEOPLE.keys()) or name_type(IMAGE, 1, "msg") not in kinds


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


def _cut_recording(recording: Recording, start: float | None, end: float | None) -> Recording:
    """Return what is between `start` and `end`, in seconds after the first sample of each bag."""
    if start is None and end is None:
        return recording
    bag_of = {track.id: track.id.rpartition("/")[0] for track in recording.tracks}  # "" for a single bag
    began = dict[str, float]()
    for track in recording.tracks:
        bag = bag_of[track.id]
        began[bag] = min(began.get(bag, inf), float(track.times[0]))
    cut = []
    for track in recording.tracks:
        first = began[bag_of[track.id]]
        low, high = first + (start or 0.0), inf if end is None else first + end
        cut.append(track.between(low - CLOCK_TOLERANCE, high + CLOCK_TOLERANCE))
    return replace(recording, tracks=tuple(track for track in cut if track is not None))


def _collect(samples: Sequence[Sample], source: Path) -> Recording:
    """Return the tracks of the samples of images."""
    from lcorpp.learning import Recording
    from lcorpp.worlds.ros.people.bag_recording import collect_tracks

    return Recording(tuple(collect_tracks(samples, gap=inf)[0]), str(source))


def _write(recording: Recording, source: Path, output: Path) -> str:
    """Write the tracks, if there are some; return what was written."""
    from lcorpp.learning import write_recording

    for note in recording.notes:
        console.warn(f"{source}: {note}")
    tracks = recording.tracks
    if not tracks:
        return f"no people were tracked, and {output} is not written"
    write_recording(recording, output)
    return f"wrote {output}: {len(tracks)} tracks, {sum(map(len, tracks))} samples"
