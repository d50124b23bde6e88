"""Images with time stamps, and the folders of images and videos that they are read from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments
from lcorpp.camera.opencv import import_cv2
from lcorpp.errors import DataError, FileError, expected_one_of
from lcorpp.files import read_bytes

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm")
"""Endings of the names of images in a folder."""

DEPTH_SCALE = 1000.0
"""Values of depth images of 16 bits for a metre, unless another number is given: millimetres."""

MISSING_SHARE, MISSING_FRAMES = 0.01, 2
"""A video may end so much before the number of frames that it states: some containers state an estimate."""


@dataclass(frozen=True, eq=False)
class Frame:
    """An image with its time.

    time: seconds. place: the file, and the frame in it, for messages.
    image: (height, width, 3) uint8 blue, green, red; or (height, width) float32, depths in metres, NaN where
        unknown.
    depth_scale: of depths, the values in the file for a metre.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.camera import Frame
        >>> Frame(0.1, np.full((480, 640), 2.5, np.float32), "frame 1").is_depth
        True
    """

    time: float
    image: npt.NDArray[Any]
    place: str
    depth_scale: float = 1.0

    @property
    def is_depth(self) -> bool:
        """Whether the image has depths."""
        return self.image.ndim == 2


class FrameSource(Protocol):
    """A source of frames in the order of time. Iterating reads it from its beginning."""

    def __len__(self) -> int:
        """Return the number of frames; of a video as the file states it."""

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames. Raises DataError or FileError with the place of what cannot be read."""


class ImageFolder:
    """Images of one size in a folder, in the order of time.

    8-bit images are colour or grey, 16-bit images with one channel are depths in millimetres, 0 unknown, and
    those of 32 bits in metres.

    Args:
        folder: with .png, .jpg, .jpeg, .bmp, .tif, .tiff, .pgm or .ppm; other files are left out.
        rate: images a second, in the order of the names; None takes the names as times in seconds, e.g.
            1305031102.175304.png.
        depth_scale: values of the depth images for a metre; None takes the units above.

    Raises:
        FileError: the folder is missing or has no images.
        DataError: a name is not a time, two names are the same time, or the rate is not positive.

    Examples:
        >>> from pathlib import Path
        >>> import cv2
        >>> import numpy as np
        >>> from lcorpp.camera import ImageFolder
        >>> Path("images").mkdir()
        >>> for time in ("12.5", "12.6"):
        ...     _ = cv2.imwrite(f"images/{time}.png", np.zeros((48, 64, 3), np.uint8))
        >>> [(frame.time, frame.image.shape) for frame in ImageFolder("images")]
        [(12.5, (48, 64, 3)), (12.6, (48, 64, 3))]
    """

    @check_arguments
    def __init__(
        self, folder: str | Path, *, rate: float | None = None, depth_scale: float | None = None
    ) -> None:
        self._depth_scale = check_depth_scale(depth_scale)
        folder = Path(folder)
        if not folder.is_dir():
            raise FileError(f"{folder}: is not a folder")
        files = sorted(file for file in folder.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES)
        if not files:
            raise FileError(f"{folder}: has no images; {expected_one_of(IMAGE_SUFFIXES)}")
        if rate is not None:
            check_rate(rate)
            self._files = [(index / rate, file) for index, file in enumerate(files)]
            return
        self._files = sorted((_parse_time(file), file) for file in files)
        for (time, file), (again, other) in zip(self._files, self._files[1:], strict=False):
            if time == again:
                raise DataError(f"{other}: the same time as {file.name}; expected one image at {time:.15g} s")

    def __len__(self) -> int:
        return len(self._files)

    def __iter__(self) -> Iterator[Frame]:
        cv2, first = import_cv2(), None
        for time, file in self._files:
            data = np.frombuffer(read_bytes(file), dtype=np.uint8)
            try:
                pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
            except cv2.error as error:
                raise DataError(f"{file}: cannot be read as an image: {error.err}") from None
            if pixels is None:
                raise DataError(f"{file}: cannot be read as an image; it is damaged, or has another format")
            frame = make_frame(time, pixels, str(file), self._depth_scale)
            first = first or frame
            check_alike(frame, first)
            yield frame


class Video:
    """The frames of a video file.

    Args:
        file: of a format that OpenCV reads, e.g. .avi or .mp4.
        rate: frames a second; None takes the file's.

    Raises:
        FileError: the file is missing.
        DataError: it is not a video that OpenCV reads, or has no valid rate; or OpenCV is not installed.

    Examples:
        >>> import cv2
        >>> import numpy as np
        >>> from lcorpp.camera import Video
        >>> writer = cv2.VideoWriter("people.avi", cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (64, 48))
        >>> for _ in range(3):
        ...     writer.write(np.zeros((48, 64, 3), np.uint8))
        >>> writer.release()
        >>> [(round(frame.time, 3), frame.image.shape) for frame in Video("people.avi")]
        [(0.0, (48, 64, 3)), (0.1, (48, 64, 3)), (0.2, (48, 64, 3))]
    """

    @check_arguments
    def __init__(self, file: str | Path, *, rate: float | None = None) -> None:
        self._file, cv2 = Path(file), import_cv2()
        if not self._file.is_file():
            raise FileError(f"{file}: cannot be read: no such file")
        capture = self._open()
        self._count = int(max(0, min(capture.get(cv2.CAP_PROP_FRAME_COUNT), 1e9)))
        stated = capture.get(cv2.CAP_PROP_FPS)
        capture.release()
        if rate is None and not (isfinite(stated) and 0 < stated <= 1000):
            raise DataError(f"{file}: states {stated:g} frames a second; expected a rate, e.g. --rate 10")
        self.rate = check_rate(stated if rate is None else rate)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Frame]:
        capture, index, first = self._open(), 0, None
        try:
            while True:
                read, pixels = capture.read()
                if not read:
                    break
                place = f"{self._file}: frame {index + 1}"
                frame = make_frame(index / self.rate, pixels, place)
                first = first or frame
                check_alike(frame, first)
                yield frame
                index += 1
        finally:
            capture.release()
        if index < self._count - max(MISSING_FRAMES, MISSING_SHARE * self._count) or not index:
            raise DataError(
                f"{self._file}: frame {index + 1} of {self._count} cannot be read: the file is cut or"
                f" damaged; expected a whole video, or its part before {index / self.rate:.6g} s"
            )

    def _open(self) -> Any:
        cv2 = import_cv2()
        level = cv2.utils.logging.getLogLevel()
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # OpenCV prints what it tries
        try:
            capture = cv2.VideoCapture(str(self._file), cv2.CAP_FFMPEG)
        finally:
            cv2.utils.logging.setLogLevel(level)
        if not capture.isOpened():
            raise DataError(f"{self._file}: cannot be read as a video; it is damaged, or has another format")
        return capture


def make_frame(time: float, pixels: npt.NDArray[Any], place: str, depth_scale: float | None = None) -> Frame:
    """Return the frame of the pixels of a file.

    Args:
        pixels: (height, width) or (height, width, 1, 3 or 4), uint8; or depths with one channel, uint16 or
            float32.
        depth_scale: values of depths for a metre; None is 1000 for uint16, 1 for float32.

    Raises:
        DataError: pixels of another kind.
    """
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[..., 0]
    if pixels.dtype == np.uint8 and pixels.ndim == 2:
        return Frame(time, np.repeat(pixels[..., None], 3, axis=2), place)
    if pixels.dtype == np.uint8 and pixels.shape[2] in (3, 4):
        return Frame(time, np.ascontiguousarray(pixels[..., :3]), place)
    if pixels.ndim == 2 and pixels.dtype in (np.uint16, np.float32):
        scale = depth_scale or (DEPTH_SCALE if pixels.dtype == np.uint16 else 1.0)
        depths = np.where(pixels > 0, pixels, np.float32(np.nan)) * np.float32(1 / scale)
        return Frame(time, depths, place, scale)
    raise DataError(
        f"{place}: an image of shape {pixels.shape}, {pixels.dtype}; expected 8 bits in colour or grey, or"
        " depths of 16 bits in millimetres or of 32 bits in metres"
    )


def check_alike(frame: Frame, first: Frame) -> None:
    """Raise a DataError if a frame is of another kind or size than the first one, or not later."""
    if frame.image.shape != first.image.shape:
        sizes = [
            f"{f.image.shape[1]} x {f.image.shape[0]} {'depths' if f.is_depth else 'pixels'}"
            for f in (frame, first)
        ]
        raise DataError(f"{frame.place}: has {sizes[0]}; expected {sizes[1]}, as {first.place}")


def check_depth_scale(depth_scale: float | None) -> float | None:
    """Return the values of a depth image for a metre. Raises DataError if it is not a number above 0."""
    if depth_scale is not None and not 0 < depth_scale < np.inf:
        raise DataError(f"the depth scale is {depth_scale:g} values a metre; expected a number above 0")
    return depth_scale


def check_rate(rate: float) -> float:
    """Return a rate in 1/s. Raises DataError if it is not a number above 0, up to 1000."""
    if not 0 < rate <= 1000:
        raise DataError(f"the rate is {rate:g} images a second; expected a number above 0, up to 1000")
    return rate


def _parse_time(file: Path) -> float:
    try:
        time = float(file.stem)
    except ValueError:
        time = np.nan
    if not isfinite(time):
        raise DataError(
            f"{file}: the name is not a time; expected seconds, e.g. 12.4{file.suffix}, or a rate (--rate)"
        )
    return time
