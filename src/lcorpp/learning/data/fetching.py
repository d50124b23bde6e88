"""Downloads with checksums, by pooch: a file appears complete or not at all."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, FileError
from lcorpp.files import make_folder, set_default_mode

_COMMIT = "https://raw.githubusercontent.com/bu-air-lab/LCORPP/22588a31205ab74e9c235f92154322f8dbded525"
AUTHORS = {
    f"{_COMMIT}/interposx.csv": "10163a4d43b90e3327ba0020595d59bde0c382d713067d6f343fb7eab50411ec",
    f"{_COMMIT}/interposy.csv": "9f0981e222feab1597f8065fee934053ae492014a7b0f81d3cc6eda9a7ed8752",
}
"""Files that the paper's authors released, at the last commit of their repository: URL -> SHA-256."""

CHUNK_BYTES = 1 << 16
"""Bytes read at once, after which progress is reported."""

TIMEOUT_SECONDS = 30.0
"""Seconds without a byte after which a download fails."""

Progress = Callable[[int, int | None], None]
"""Callback with (bytes received, bytes in all or None)."""


@check_arguments
def fetch_authors(folder: str | Path, *, progress: Progress | None = None) -> tuple[Path, ...]:
    """Download the authors' 123 tracks, `interposx.csv` and `interposy.csv`; existing files remain.

    The repository has no licence file: the tracks belong to its authors.

    Args:
        folder: created if missing.
        progress: callback with (bytes received, bytes in all or None).

    Returns:
        The paths of both files.

    Raises:
        FileError: the server cannot be reached or is cut off, or a file cannot be written.
        DataError: a downloaded or existing file has another checksum.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.learning import fetch_authors
        >>> _ = Path("interposx.csv").write_text("another file")
        >>> fetch_authors(".")  # before anything is downloaded
        Traceback (most recent call last):
            ...
        lcorpp.errors.DataError: ...interposx.csv: exists, but has another checksum; remove it or choose ...
    """
    return tuple(fetch(url, folder, sha256=digest, progress=progress) for url, digest in AUTHORS.items())


def fetch(
    url: str, folder: str | Path, *, sha256: str | None = None, progress: Progress | None = None
) -> Path:
    """Download a file into a folder under its own name; an existing file is never replaced.

    Args:
        url: http or https. folder: created if missing.
        sha256: the expected checksum, 64 hexadecimal digits; None accepts any file.

    Returns:
        The path of the file.

    Raises:
        FileError: the server cannot be reached, has no such file or is cut off, or a file cannot be written.
        DataError: the address or the checksum is malformed, or the downloaded or existing file has another
            checksum.
    """
    try:
        address = urlsplit(url)
    except ValueError as error:
        raise DataError(f"{url!r} is not the address of a file: {error}") from None
    name = unquote(address.path).rsplit("/", 1)[-1]
    if address.scheme not in ("http", "https") or name in ("", ".", "..") or "\0" in name:
        raise DataError(f"{url!r} is not the address of a file; expected http(s)://SERVER/.../NAME")
    if sha256 is not None and not re.fullmatch("[0-9a-fA-F]{64}", sha256):
        raise DataError(f"{sha256!r} is not a checksum; expected the 64 hexadecimal digits of a SHA-256")
    try:
        import pooch
        import requests
        import urllib3.exceptions
    except ModuleNotFoundError as error:
        raise DataError(f"a download needs {error.name}: pip install 'lcorpp[fetch]'") from None

    target = make_folder(folder).resolve() / name
    known = None if sha256 is None else f"sha256:{sha256.lower()}"
    pooch.get_logger().setLevel("WARNING")
    download = pooch.HTTPDownloader(
        progressbar=_ProgressBar(progress) if progress else False,
        chunk_size=CHUNK_BYTES,
        timeout=TIMEOUT_SECONDS,
        headers={"Accept-Encoding": "identity"},  # the bytes counted are those of the file
    )
    try:
        if target.exists():
            if not target.is_file():
                raise FileError(f"{target}: exists, but is not a file; remove it or choose another folder")
            if sha256 is not None and pooch.file_hash(str(target)) != sha256.lower():
                raise DataError(
                    f"{target}: exists, but has another checksum; remove it or choose another folder"
                )
            return target
        pooch.retrieve(url, known, fname=name, path=target.parent, downloader=download)
        set_default_mode(target)
    except requests.RequestException as error:
        raise FileError(f"{url}: {_describe_error(error)}") from None
    except OSError as error:
        raise FileError(f"{target}: cannot be written: {error.strerror or error}") from None
    except urllib3.exceptions.LocationParseError as error:
        raise DataError(f"{url!r} is not the address of a file: {error}") from None
    except ValueError as error:  # pooch compared the checksums
        raise DataError(f"{url}: not the file expected: {error}") from None
    return target


class _ProgressBar:
    """A progress bar as pooch expects it, which calls a function."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._done, self.total = progress, 0, 0  # pooch sets total, 0 if it is unknown

    def update(self, count: int) -> None:
        """Add bytes; pooch counts the last chunk as a whole one."""
        self._done += count
        self._progress(min(self._done, self.total) if self.total else self._done, self.total or None)

    def reset(self) -> None:
        """Do nothing: pooch adds the total number once more at the end."""

    def close(self) -> None:
        """Do nothing."""


def _describe_error(error: Any) -> str:
    """Describe an error of requests in a short phrase."""
    import requests

    if isinstance(error, requests.HTTPError):
        return f"the server answered {error.response.status_code} {error.response.reason}"
    if isinstance(error, requests.Timeout):
        return f"the server did not answer for {TIMEOUT_SECONDS:g} s"
    if isinstance(error, requests.exceptions.ChunkedEncodingError):
        return "the connection was cut; no part is kept"
    if isinstance(error, requests.ConnectionError):
        system = re.search(r"\[Errno -?\d+\] ([^\"')]+)", str(error))
        reason = f" ({system[1]})" if system else ""
        return f"cannot be reached, or the connection was cut{reason}; is this machine online?"
    return str(error)
