"""Numpy archives (.npz) with a JSON header: no pickles, and no small file of huge content."""

from __future__ import annotations

import io
import json
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from lcorpp.errors import DataError, LcorppError
from lcorpp.versioned_json import JsonFormat

if TYPE_CHECKING:
    from pathlib import Path

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


def pack_archive(
    form: JsonFormat, header: Mapping[str, Any], arrays: Mapping[str, object], *, compress: bool = True
) -> bytes:
    """Return an archive of arrays, and of the fields of a header in the array that the format names."""
    import numpy as np

    buffer, text = io.BytesIO(), json.dumps(form.header | dict(header))
    save: Any = np.savez_compressed if compress else np.savez
    save(buffer, **{_name_header(form): np.array(text)}, **arrays)
    return buffer.getvalue()


def unpack_archive(
    form: JsonFormat, content: bytes
) -> tuple[dict[str, Any], dict[str, npt.NDArray[np.generic[Any]]]]:
    """Return the header and the arrays of `pack_archive`; errors as of `locate_damage`."""
    arrays = read_arrays(content)
    return form.read(str(arrays.pop(_name_header(form)))), arrays


def _name_header(form: JsonFormat) -> str:
    return form.name.removeprefix("lcorpp ")


@contextmanager
def locate_damage(path: str | Path, what: str) -> Iterator[None]:
    """Return a context in which an archive is read.

    Args:
        what: the content, for messages, e.g. "circuit".

    Raises:
        DataError: the archive is damaged, or its content raises a typed error.
    """
    try:
        yield
    except LcorppError as error:
        raise DataError(f"{path}: not a {what} that can be used: {error}") from None
    except DAMAGE_ERRORS as error:
        raise DataError(f"{path}: not a stored {what}, or a damaged one: {error}") from None


def read_arrays(content: bytes) -> dict[str, npt.NDArray[np.generic[Any]]]:
    """Return the arrays of a numpy archive by their names.

    Raises:
        DataError: the content is much larger than its file.
        DAMAGE_ERRORS: it is not an archive, or damaged.
    """
    import numpy as np

    if not zipfile.is_zipfile(io.BytesIO(content)):
        raise ValueError("it is not a numpy archive")
    check_size(content)
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def check_size(content: bytes) -> None:
    """Raise `DataError` if a zip archive has much more content than it is large."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > max(FREE_BYTES, MAX_RATIO * len(content)):
        raise DataError(f"its content is {size >> 20} MB in a file of {len(content)} bytes; expected less")
