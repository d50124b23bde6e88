"""From frames to tracks: locate the people of each frame, and track them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.camera.detectors import Detector, find_feet
from lcorpp.camera.frames import Frame
from lcorpp.camera.ground_camera import GroundCamera
from lcorpp.camera.tracker import Sample, Tracker
from lcorpp.errors import DataError
from lcorpp.values import Array

FOOT_NOISE = 4.0
"""Standard deviation of a detected foot in pixels, of each coordinate."""

MIN_NOISE = 0.05
"""Standard deviation in metres that is added to each coordinate: people are not points."""

MAX_NOISE = 2.0
"""Metres; a foot whose place is less certain, near the horizon, is left out."""


class Locator(Protocol):
    """What locates people on the floor by an image."""

    def locate(self, image: npt.NDArray[Any], /) -> tuple[Array, Array]:
        """Return (n, 2) positions in metres and their (n, 2, 2) covariances. image: as a `Frame` has it."""


class ImageLocator:
    """Locate people by a detector of their feet in colour images, and a camera above the floor.

    Args:
        detector: e.g. of `make_detector`. camera: of the images.
    """

    def __init__(self, detector: Detector, camera: GroundCamera) -> None:
        self._detector, self._camera = detector, camera

    def __repr__(self) -> str:
        return f"<ImageLocator: {self._detector!r}, {self._camera!r}>"

    def locate(self, image: npt.NDArray[Any], /) -> tuple[Array, Array]:
        """Return (n, 2) positions and their (n, 2, 2) covariances, without feet at or above the horizon.

        Raises:
            DataError: the image has another size than the camera's, or the detector fails.
        """
        width, height = self._camera.size
        if image.shape != (height, width, 3):
            raise DataError(
                f"an image of shape {image.shape}; expected {(height, width, 3)}, as the camera's"
            )
        feet = find_feet(self._detector, image)
        positions = self._camera.to_metres(feet)
        covariances = self._camera.measure_covariances(feet, positions, FOOT_NOISE)
        certain = np.trace(covariances, axis1=1, axis2=2) <= MAX_NOISE**2  # False for NaN
        return positions[certain], covariances[certain] + MIN_NOISE**2 * np.eye(2)


def track_people(
    frames: Iterable[Frame], locator: Locator, tracker: Tracker | None = None
) -> Iterator[tuple[Frame, list[Sample]]]:
    """Track the people of frames.

    Args:
        frames: in the order of time. tracker: None uses a `Tracker` with its default options.

    Yields:
        Each frame, with the new samples (time, id, x, y) of `Tracker.update`.

    Raises:
        DataError: an image is unfit for the locator, or a time does not rise; the message names the frame.
    """
    tracker = tracker or Tracker()
    for frame in frames:
        try:
            samples = tracker.update(frame.time, *locator.locate(frame.image))
        except DataError as error:
            raise DataError(f"{frame.place}: {error}") from error
        yield frame, samples
