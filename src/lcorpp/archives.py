"""Read numpy archives (.npz) of foreign origin: no pickles, and no small file of huge content."""

from __future__ import annotations

import io
import struct
import tokenize
import zipfile
import zlib
from typing import TYPE_CHECKING, Any

from lcorpp.errors import DataError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

MAX_RATIO = 100
"""Maximum of the content's size in terms of the file's, above `FREE_BYTES`: no tracks are so regular."""

FREE_BYTES = 2**30
"""Content of this size may be compressed to any size, e.g. the padding of tracks."""

DAMAGE_ERRORS = (
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, MemoryError),
    *(EOFError, OSError, zipfile.BadZipFile, zlib.error, struct.error),
    *(SyntaxError, tokenize.TokenError),  # numpy parses the headers of arrays as Python
)
"""The exceptions of numpy, zipfile and json for damaged files."""


def read_arrays(content: bytes) -> dict[str, npt.NDArray[np.generic[Any]]]:
    """Return the arrays of a numpy archive by their names.

    Raises:
        DataError: the content is much larger than its file.
        DAMAGE_ERRORS: it is no archive, or damaged.
    """
    import numpy as np

    if not zipfile.is_zipfile(io.BytesIO(content)):
        raise ValueError("it is no numpy archive")
    check_size(content)
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def check_size(content: bytes) -> None:
    """Raise `DataError` if a zip archive has much more content than it is large."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > max(FREE_BYTES, MAX_RATIO * len(content)):
        raise DataError(f"its content is {size >> 20} MB in a file of {len(content)} bytes; expected less")
