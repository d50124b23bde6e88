"""OpenCV, an optional package."""

from __future__ import annotations

from typing import Any

from lcorpp.errors import DataError


def import_cv2() -> Any:
    """Return the module cv2, set to one thread: small images gain nothing from more.

    Raises:
        DataError: OpenCV is not installed.
    """
    try:
        import cv2
    except ImportError:
        raise DataError("OpenCV is not installed; pip install 'lcorpp[camera]'") from None
    cv2.setNumThreads(1)
    return cv2
