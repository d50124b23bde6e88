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
    """The interface of what locates people on the floor in images.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.camera import Frame, track_people
        >>> class Pressure:  # a mat as a `Locator`: its image has the pressure of each square metre
        ...     def locate(self, image):
        ...         positions = np.argwhere(image > 0) + 0.5
        ...         return positions, np.tile(0.1 * np.eye(2), (len(positions), 1, 1))
        >>> frames = [Frame(n / 5, np.eye(3), f"frame {n}") for n in range(3)]
        >>> [len(samples) for frame, samples in track_people(frames, Pressure())]
        [0, 0, 9]
    """

    def locate(self, image: npt.NDArray[Any], /) -> tuple[Array, Array]:
        """Return (n, 2) positions in metres and their (n, 2, 2) covariances. image: as a `Frame` has it."""


class ImageLocator:
    """Locate people by a detector of their feet in colour images, and a camera above the floor.

    Args:
        detector: e.g. of `make_detector`. camera: of the images.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.camera import GroundCamera, ImageLocator
        >>> camera = GroundCamera([[0, 0, 150], [-1.5, 0, 120], [0, 1, -60]], (160, 120))  # 1.5 m high
        >>> locator = ImageLocator(lambda image: [[80, 110]], camera)  # a detector that finds one person
        >>> positions, covariances = locator.locate(np.zeros((120, 160, 3), np.uint8))
        >>> positions.round(2).tolist(), np.sqrt(covariances[0].diagonal()).round(2).tolist()
        ([[3.0, 0.0]], [0.24, 0.13])
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

    Examples:
        >>> import numpy as np
        >>> from lcorpp.camera import Frame, GroundCamera, ImageLocator, track_people
        >>> camera = GroundCamera([[0, 0, 150], [-1.5, 0, 120], [0, 1, -60]], (160, 120))  # 1.5 m high
        >>> locator = ImageLocator(lambda image: [[80, 110]], camera)  # a detector that finds one person
        >>> frames = [Frame(n / 10, np.zeros((120, 160, 3), np.uint8), f"frame {n}") for n in range(5)]
        >>> [(frame.time, len(samples)) for frame, samples in track_people(frames, locator)]
        [(0.0, 0), (0.1, 0), (0.2, 3), (0.3, 1), (0.4, 1)]
    """
    tracker = tracker or Tracker()
    for frame in frames:
        try:
            samples = tracker.update(frame.time, *locator.locate(frame.image))
        except DataError as error:
            raise DataError(f"{frame.place}: {error}") from error
        yield frame, samples
