"""Detectors of people in colour images: OpenCV's HOG detector, and background subtraction."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, to_numbers
from lcorpp.camera.ground_camera import GroundCamera
from lcorpp.camera.occupancy import Mask, OccupancySearch, Person
from lcorpp.camera.opencv import import_cv2
from lcorpp.errors import DataError, expected_one_of
from lcorpp.user_code import UserFunction, split_function
from lcorpp.values import Array

Image = npt.NDArray[np.uint8]
Pixels = npt.NDArray[np.float32]

DETECTORS = ("background", "hog")
"""The names of the detectors."""

MAX_WIDTH = 480
"""Pixels; background subtraction reduces wider images by a whole factor to about this width."""


MIN_BRIGHTNESS, MIN_BRIGHT_PIXELS = 16, 16
"""Pixels that are darker say nothing about a change of light; without so many brighter ones it is unknown."""


class Detector(Protocol):
    """The interface of a detector of people in images; functions have it.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.camera import find_feet
        >>> def detect_white(image):  # a `Detector`: (n, 2) columns and rows
        ...     return np.argwhere(image.min(axis=2) == 255)[:, ::-1]
        >>> image = np.zeros((120, 160, 3), np.uint8)
        >>> image[110, 80] = 255
        >>> find_feet(detect_white, image).tolist()
        [[80.0, 110.0]]
    """

    def __call__(self, image: Image, /) -> npt.ArrayLike:
        """Return people as (n, 2) feet (column, row), or (n, 4) boxes (left, top, width, height), in pixels.

        image: (height, width, 3) blue, green, red.
        """


@check_arguments
def make_detector(name: str, camera: GroundCamera) -> Detector:
    """Return a detector by its name: `background`, `hog`, or a user's function as FILE.py:NAME.

    Args:
        camera: of the images, for `background`.

    Raises:
        DataError: the name is unknown, the user's file fails, or OpenCV is not installed.

    Examples:
        >>> from pathlib import Path
        >>> import numpy as np
        >>> from lcorpp.camera import GroundCamera, make_detector
        >>> _ = Path("mine.py").write_text("def find(image): return [[80, 110]]")
        >>> camera = GroundCamera([[0, 0, 150], [-1.5, 0, 120], [0, 1, -60]], (160, 120))  # 1.5 m high
        >>> make_detector("mine.py:find", camera)(np.zeros((120, 160, 3), np.uint8))
        [[80, 110]]
    """
    if name == "background":
        return BackgroundDetector(camera)
    if name == "hog":
        return HogDetector()
    own = split_function(name)
    if own is None:
        raise DataError(f"unknown detector {name!r}; {expected_one_of((*DETECTORS, 'FILE.py:NAME'))}")
    return UserFunction(Path(own[0]), own[1], DataError)


def find_feet(detector: Detector, image: Image) -> Array:
    """Return the (n, 2) feet of the people that a detector finds: of boxes the middle of the bottom.

    Args:
        image: (height, width, 3) blue, green, red.

    Raises:
        DataError: the detector fails, or returns something else.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.camera import find_feet
        >>> image = np.zeros((120, 160, 3), np.uint8)
        >>> find_feet(lambda image: [[70, 50, 20, 60]], image).tolist()  # a box: left, top, width, height
        [[80.0, 110.0]]
    """
    found = to_numbers(detector(image), f"the result of {detector!r}")
    if not found.size:
        return np.empty((0, 2))
    if found.ndim != 2 or found.shape[1] not in (2, 4) or not np.isfinite(found).all():
        raise DataError(
            f"the result of {detector!r} has shape {found.shape} or is not finite; expected (n, 2) feet or"
            " (n, 4) boxes"
        )
    if found.shape[1] == 2:
        return found
    return np.stack([found[:, 0] + found[:, 2] / 2, found[:, 1] + found[:, 3]], axis=1)


class HogDetector:
    """People standing upright, by histograms of oriented gradients and OpenCV's linear SVM for them.

    It finds people from about 96 pixels high after images are enlarged by `scale`.

    Args:
        scale: above 0, up to 8.

    Raises:
        DataError: the scale is out of range, or OpenCV is not installed.

    Source: Dalal and Triggs, Histograms of Oriented Gradients for Human Detection, CVPR 2005.

    Examples:
        >>> import cv2
        >>> import numpy as np
        >>> from lcorpp.camera import HogDetector
        >>> image = np.full((300, 300, 3), 200, np.uint8)
        >>> for x, y, a, b in [(150, 70, 13, 13), (150, 125, 26, 45), (139, 200, 8, 50), (161, 200, 8, 50)]:
        ...     _ = cv2.ellipse(image, (x, y), (a, b), 0, 0, 360, (0, 0, 0), -1)  # head, trunk, legs
        >>> HogDetector()(image).round().tolist()
        [[115.0, 49.0, 66.0, 200.0]]
    """

    MARGIN = (0.22, 0.08)
    """Shares of a detected window, on each side, that lie beside and above or below the person."""

    MIN_WEIGHT = 0.9
    """Minimum score of the SVM."""

    OVERLAP = 0.4
    """Of two windows with a larger intersection over union, the one of the lower score is left out."""

    def __init__(self, *, scale: float = 1.5) -> None:
        if not 0 < scale <= 8:
            raise DataError(f"HogDetector: scale is {scale:g}; expected a number above 0, up to 8")
        self._cv2, self._scale = import_cv2(), scale
        self._hog = self._cv2.HOGDescriptor()
        self._hog.setSVMDetector(self._cv2.HOGDescriptor_getDefaultPeopleDetector())

    def __repr__(self) -> str:
        return f"HogDetector(scale={self._scale:g})"

    def __call__(self, image: Image, /) -> Array:
        """Return (n, 4) boxes of people: left, top, width, height in pixels."""
        large = self._cv2.resize(image, None, fx=self._scale, fy=self._scale)
        if large.shape[0] < 128 or large.shape[1] < 64:
            return np.empty((0, 4))  # smaller than the detector's window
        windows, weights = self._hog.detectMultiScale(large, winStride=(8, 8), scale=1.05, groupThreshold=0)
        if not len(windows):
            return np.empty((0, 4))
        boxes = np.asarray(windows, dtype=np.float64) / self._scale
        kept = self._cv2.dnn.NMSBoxes(
            boxes.tolist(), np.ravel(weights).tolist(), self.MIN_WEIGHT, self.OVERLAP
        )
        boxes = boxes[np.asarray(kept, dtype=np.intp).ravel()]
        margin = boxes[:, 2:] * self.MARGIN
        return np.concatenate([boxes[:, :2] + margin, boxes[:, 2:] - 2 * margin], axis=1)


class BackgroundDetector:
    """People who move in front of a constant background, for a camera that does not move.

    A pixel is foreground if it differs from the background, after the change of the light of the whole image
    is removed. `OccupancySearch` explains the foreground by people of human size on the floor. The background
    begins as the mean of the first images and then follows slowly, and more slowly where people are.

    Where a person leaves who was part of the background, the foreground has no edges of its own: its contour
    is the contour of the person in the background. Such a ghost is not a person: the background is renewed.
    Where the background has edges everywhere that are as strong as a person's, people are taken for ghosts;
    and so may be, for some seconds, who is in the first image and moves slowly.

    Args:
        camera: above the floor; the images have its size.

    Raises:
        DataError: OpenCV is not installed.

    Source: for ghosts after Cucchiara, Grana, Piccardi and Prati, Detecting Moving Objects, Ghosts, and
    Shadows in Video Streams, PAMI 2003; here edges replace optical flow.

    Examples:
        >>> import cv2
        >>> import numpy as np
        >>> from lcorpp.camera import BackgroundDetector, GroundCamera
        >>> camera = GroundCamera([[0, 0, 150], [-1.5, 0, 120], [0, 1, -60]], (160, 120))  # 1.5 m high
        >>> detector, image = BackgroundDetector(camera), np.full((120, 160, 3), 90, np.uint8)
        >>> len(detector(image))  # the background
        0
        >>> _ = cv2.rectangle(image, (52, 53), (68, 110), (200, 200, 200), -1)  # 1.7 m tall at 3 m
        >>> camera.to_metres(detector(image)).round(1).tolist()
        [[3.1, 0.6]]
    """

    MIN_DIFFERENCE, NOISE_FACTOR = 10.0, 4.0
    """A pixel of the foreground differs by more than the first and the second times the median difference."""

    RATE, PERSON_RATE, GHOST_RATE = 0.01, 0.001, 0.2
    """Share of a new image in the background: outside of the boxes of people, inside, and in ghosts."""

    MIN_EDGE_RATIO = 1.5
    """Minimum ratio of the edges along the contour of a person in the image and in the background."""

    MIN_CONTOUR = 8
    """Minimum number of pixels of a contour for this test."""

    def __init__(self, camera: GroundCamera) -> None:
        self._cv2, self._camera = import_cv2(), camera
        factor = max(1, round(camera.size[0] / MAX_WIDTH))
        width, height = (max(1, side // factor) for side in camera.size)
        self._size = (width, height)
        self._search = OccupancySearch(camera, self._size)
        self._background = np.empty((0, 0, 3), dtype=np.float32)
        self._count = 0

    def __repr__(self) -> str:
        return "BackgroundDetector()"

    def __call__(self, image: Image, /) -> Array:
        """Return the (n, 2) feet of people in pixels. Raises DataError for an image of another size."""
        small = self._reduce(image)
        if not self._count:
            self._background = small.copy()
        background = self._background * _measure_light(small, self._background)
        foreground = self._find_foreground(small, background)
        people = self._search.search(foreground)
        is_ghost = self._find_ghosts(small, background, foreground, people)
        self._follow(small, foreground, people, is_ghost)
        feet = [person.foot for person, ghost in zip(people, is_ghost, strict=True) if not ghost]
        return np.array(feet).reshape(-1, 2)

    def _reduce(self, image: Image) -> Pixels:
        width, height = self._camera.size
        if image.shape != (height, width, 3) or image.dtype != np.uint8:
            raise DataError(
                f"an image of shape {image.shape}, {image.dtype}; expected {(height, width, 3)}, uint8"
            )
        reduced: Pixels = self._cv2.resize(image, self._size, interpolation=self._cv2.INTER_AREA)
        return reduced.astype(np.float32)

    def _find_foreground(self, image: Pixels, background: Pixels) -> Mask:
        cv2 = self._cv2
        difference = cv2.absdiff(image, background).max(axis=2)
        threshold = self.MIN_DIFFERENCE + self.NOISE_FACTOR * float(np.median(difference[::4, ::4]))
        mask = (difference > threshold).astype(np.uint8)
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
        mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((5, 3), np.uint8))
        return np.asarray(mask, dtype=np.bool_)

    def _find_ghosts(
        self, image: Pixels, background: Pixels, foreground: Mask, people: Sequence[Person]
    ) -> list[bool]:
        """Return whether the foreground in each box is a ghost."""
        if not people:
            return []
        cv2, square = self._cv2, np.ones((3, 3), np.uint8)

        def find_edges(pixels: npt.NDArray[np.float32] | npt.NDArray[np.uint8]) -> Pixels:
            edges: Pixels = cv2.morphologyEx(pixels, cv2.MORPH_GRADIENT, square)
            return edges

        contour = find_edges(foreground.astype(np.uint8)) > 0
        own, behind = (find_edges(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)) for pixels in (image, background))
        ghosts = []
        for person in people:
            line = np.zeros(foreground.shape, dtype=np.bool_)
            line[person.box] = contour[person.box]
            if line.sum() < self.MIN_CONTOUR:
                ghosts.append(False)
                continue
            ratio = float(own[line].sum()) / max(float(behind[line].sum()), 1.0)
            ghosts.append(ratio < self.MIN_EDGE_RATIO)
        return ghosts

    def _follow(
        self, image: Pixels, foreground: Mask, people: Sequence[Person], is_ghost: Sequence[bool]
    ) -> None:
        """Update the background."""
        self._count += 1
        rates = np.full(foreground.shape, max(self.RATE, 1 / self._count), dtype=np.float32)
        for person in people:
            rates[person.surroundings] = self.PERSON_RATE
        for person, ghost in zip(people, is_ghost, strict=True):
            if ghost:
                rates[person.box][foreground[person.box]] = self.GHOST_RATE
        self._background += rates[..., None] * (image - self._background)


def _measure_light(image: Pixels, background: Pixels) -> Pixels:
    """Return (3,) the median ratio of image and background: the change of light and exposure."""
    some, before = image[::8, ::8].reshape(-1, 3), background[::8, ::8].reshape(-1, 3)
    bright = before.min(axis=1) > MIN_BRIGHTNESS
    if bright.sum() < MIN_BRIGHT_PIXELS:
        return np.ones(3, dtype=np.float32)
    ratios: Pixels = np.median(some[bright] / before[bright], axis=0).astype(np.float32)
    return ratios
