"""Why depth images show no floor: a camera that is turned, or another unit of the depths."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.camera.depth import DepthLocator
from lcorpp.camera.floor import Floor, Intrinsics
from lcorpp.camera.frames import Frame
from lcorpp.errors import DataError, expected_one_of

ROTATIONS = (0, 90, 180, 270)
"""Degrees by which images can be turned, clockwise."""

SOUGHT = (0, 180, 90, 270)
"""Rotations in the order in which a floor is sought: next to a wall a camera that is turned by 90 degrees has
a floor, too."""

DEPTH_SCALES: Mapping[float, str] = {
    1.0: "metres",
    100.0: "centimetres",
    1000.0: "millimetres",
    4000.0: "RealSense L515",
    5000.0: "TUM RGB-D",
    8000.0: "RealSense SR300",
    10000.0: "RealSense D405",
}
"""Common values of depth images for a metre, and where they occur."""

MIN_USUAL_HEIGHT, MAX_USUAL_HEIGHT = 0.25, 2.5
"""Of a robot's camera above the floor, in metres; others are legal but rare."""

MAX_VIEWED = 8
"""Images that are turned to see whether they show people then."""

NEARER, MORE = 0.9, 6.0
"""Of a floor that is likelier than another: maximum ratio of the heights if it is nearer, or minimum ratio of
the numbers of people."""

MEDIAN_DEPTH = 3.0
"""Metres to which depths of an unknown unit are scaled before the floor is sought."""


def check_rotation(degrees: int) -> int:
    """Return a rotation; raise a DataError if it is not one of `ROTATIONS`."""
    if degrees not in ROTATIONS:
        raise DataError(f"a rotation by {degrees} degrees; {expected_one_of([str(r) for r in ROTATIONS])}")
    return degrees


@check_arguments
def rotate_intrinsics(intrinsics: Intrinsics, degrees: int, size: tuple[int, int]) -> Intrinsics:
    """Return the intrinsics of images that are turned clockwise.

    Args:
        degrees: one of `ROTATIONS`. size: (width, height) of the images before.

    Raises:
        DataError: another number of degrees.
    """
    k, (width, height) = intrinsics, size
    for _ in range(check_rotation(degrees) // 90):
        k, width, height = Intrinsics(k.fy, k.fx, height - 1 - k.cy, k.cx), height, width
    return k


def rotate_frames(frames: Iterable[Frame], degrees: int) -> Iterator[Frame]:
    """Yield the frames with their images turned clockwise. degrees: one of `ROTATIONS`."""
    turns = -check_rotation(degrees) // 90
    for frame in frames:
        yield replace(frame, image=np.ascontiguousarray(np.rot90(frame.image, turns))) if turns else frame


def suggest_options(frame: Frame, intrinsics: Intrinsics) -> str | None:
    """Return which rotation or unit of the depths would give an image a floor; None if none would.

    Args:
        frame: of depths, in which no floor was found, or none at a usual height of the camera.
        intrinsics: of the image.
    """
    known = frame.image[np.isfinite(frame.image) & (frame.image > 0)]
    if not len(known):
        return None
    factor, size = MEDIAN_DEPTH / float(np.median(known)), (frame.image.shape[1], frame.image.shape[0])
    for scale in (1.0, factor):
        scaled = replace(frame, image=frame.image * np.float32(scale))
        for degrees in SOUGHT:
            (turned,) = rotate_frames([scaled], degrees)
            locator = DepthLocator(rotate_intrinsics(intrinsics, degrees, size))
            locator.locate(turned.image)
            if locator.floor is None:
                continue
            unit = _describe_unit(locator.floor.height / scale, frame.depth_scale)
            if not degrees:
                return unit
            mounted = "upside down" if degrees == 180 else "sideways"
            turn = (
                f"is the camera mounted {mounted}? --rotate {degrees} turns the images so that they show one"
            )
            return turn if unit is None else f"{turn}; {unit}"
    return None


def _describe_unit(height: float, depth_scale: float) -> str | None:
    """Return the units of the depths by which the camera is at a usual height; None if it is at one now.

    height: of the camera above the floor in metres, by the present unit. depth_scale: the present unit.
    """
    if is_usual(height):
        return None
    heights = {scale: height * depth_scale / scale for scale in DEPTH_SCALES}
    likely = sorted(filter(lambda s: is_usual(heights[s]), heights), key=lambda s: abs(np.log(heights[s])))
    units = [f"--depth-scale {s:g} ({DEPTH_SCALES[s]}): {heights[s]:.2g} m" for s in likely]
    present = f"with {depth_scale:g} values a metre the floor is {height:.3g} m below the camera"
    return f"{present}; with {', or with '.join(units)}" if units else present


def is_usual(height: float) -> bool:
    """Return whether a camera on a robot may be so high above the floor, in metres."""
    return MIN_USUAL_HEIGHT <= height <= MAX_USUAL_HEIGHT


@dataclass(frozen=True)
class View:
    """What images show that are turned: the height of the camera above the floor, and how many people."""

    degrees: int
    height: float
    people: int


def _view(frames: Sequence[Frame], intrinsics: Intrinsics, degrees: int) -> View | None:
    """Return what turned images show; None if less than half of them show a floor."""
    size = (frames[0].image.shape[1], frames[0].image.shape[0])
    locator, people, seen = DepthLocator(rotate_intrinsics(intrinsics, degrees, size)), 0, 0
    for frame in rotate_frames(frames, degrees):
        people += len(locator.locate(frame.image)[0])
        seen += locator.sees_floor
    if locator.floor is None or 2 * seen < len(frames):
        return None
    return View(degrees, locator.floor.height, people)


def find_better_view(
    frames: Sequence[Frame], intrinsics: Intrinsics, height: float
) -> tuple[View, View] | None:
    """Return what the images show as they are, and turned, if a floor and people are more likely there.

    Between walls each of them is a floor to a camera that is turned, and what is on the floor may look like
    people. More likely is a floor at a usual height of the camera with people in most images, if it is
    nearer, or if there are few people on the other one.

    Args:
        frames: of depths, in order. height: of the camera above the floor that other images show.
    """
    now = _view(frames, intrinsics, 0) or View(0, height, 0)
    likely = list[View]()
    for degrees in ROTATIONS[1:]:
        view = _view(frames, intrinsics, degrees)
        if view is None or not is_usual(view.height) or 2 * view.people < len(frames):
            continue
        is_nearer = view.height < NEARER * now.height
        if is_nearer or view.people > MORE * now.people or not is_usual(now.height):
            likely.append(view)
    return (now, min(likely, key=lambda view: view.height)) if likely else None


class FloorObserver:
    """Observes in how many images a locator finds the floor, and explains why not.

    Args:
        locator: of depth images. intrinsics: of the images.
    """

    def __init__(self, locator: DepthLocator, intrinsics: Intrinsics) -> None:
        self._locator, self._intrinsics = locator, intrinsics
        self._images, self._found = 0, 0
        self._without: Frame | None = None
        self._last: Frame | None = None
        self._some = deque[Frame](maxlen=MAX_VIEWED)  # the first ones, then images 16, 32, 64, ...

    def observe(self, frame: Frame) -> None:
        """Count an image after the locator has seen it."""
        self._images += 1
        self._last = frame
        if self._images & (self._images - 1) == 0 or self._images <= MAX_VIEWED:
            self._some.append(frame)
        if self._locator.sees_floor:
            self._found += 1
        elif self._without is None and np.isfinite(frame.image).any():
            self._without = frame

    def explain(self, *, has_people: bool) -> str | None:
        """Return a note about a floor that is in few images, at an unusual height, or more likely elsewhere.

        Args:
            has_people: whether people were tracked: then the height is not in doubt.
        """
        floor: Floor | None = self._locator.floor
        better = None
        if floor is not None and 2 * self._found >= self._images:
            better = find_better_view(self._some, self._intrinsics, floor.height)
        if better is not None:
            return _describe_views(*better, len(self._some))
        if 2 * self._found < self._images:
            found = f"the floor was found in {self._found} of {self._images} images"
            frame = self._without or self._last
        elif floor is not None and not has_people and not is_usual(floor.height):
            found, frame = f"the floor is {floor.height:.3g} m below the camera", self._last
        else:
            return None
        suggestion = None if frame is None else suggest_options(frame, self._intrinsics)
        return found if suggestion is None else f"{found}; {suggestion}"


def _describe_views(now: View, turned: View, images: int) -> str:
    mounted = "upside down" if turned.degrees == 180 else "sideways"
    return (
        f"the floor is {now.height:.3g} m below the camera and {images} images show {now.people}"
        f" people; turned, they show one {turned.height:.3g} m below it and {turned.people} people:"
        f" is the camera mounted {mounted}? --rotate {turned.degrees} turns the images"
    )
