"""Resumable downloads with checksums: pooch, with a downloader that continues partial files.

The partial file is NAME.part. It is resumed only if the server confirms that the file is unchanged (If-Range,
RFC 9110), or if a checksum is compared at the end.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from lcorpp.errors import DataError, FileError
from lcorpp.files import make_folder

_COMMIT = "https://raw.githubusercontent.com/bu-air-lab/LCORPP/22588a31205ab74e9c235f92154322f8dbded525"
AUTHORS = {
    f"{_COMMIT}/interposx.csv": "10163a4d43b90e3327ba0020595d59bde0c382d713067d6f343fb7eab50411ec",
    f"{_COMMIT}/interposy.csv": "9f0981e222feab1597f8065fee934053ae492014a7b0f81d3cc6eda9a7ed8752",
}
"""Files that the paper's authors released, at the last commit of their repository: URL -> SHA-256."""

CHUNK_BYTES = 1 << 12
"""Bytes written at once; a cut connection loses at most as many."""
CHUNKS_PER_REPORT = 16
"""Chunks per progress report."""

MAX_ATTEMPTS = 4
"""Consecutive attempts without a new byte after which a download fails."""
INITIAL_WAIT, TIMEOUT = 0.5, 30.0
"""Seconds before the second attempt, doubled each time; and the time limit for an answer."""

Progress = Callable[[int, int | None], None]
"""Callback with (bytes received, bytes in all or None)."""


def fetch_authors(folder: str | Path, *, progress: Progress | None = None) -> tuple[Path, ...]:
    """Download the authors' 123 tracks, `interposx.csv` and `interposy.csv`; existing files remain.

    The repository has no licence file: the tracks belong to its authors.

    Raises:
        FileError, DataError: as `fetch`.
    """
    return tuple(fetch(url, folder, sha256=digest, progress=progress) for url, digest in AUTHORS.items())


def fetch(
    url: str,
    folder: str | Path,
    *,
    sha256: str | None = None,
    progress: Progress | None = None,
    wait: float = INITIAL_WAIT,
) -> Path:
    """Download a file into a folder under its own name; an existing file is never replaced.

    Args:
        url: http or https. folder: created if missing.
        sha256: the expected checksum, 64 hexadecimal digits; None accepts any file.
        wait: seconds before the second attempt, doubled each time.

    Returns:
        The path of the file.

    Raises:
        FileError: the server cannot be reached or has no such file, or a file cannot be written; the next
            call resumes the partial file.
        DataError: the address or the checksum is malformed, the downloaded or existing file has another
            checksum, or pooch is not installed.
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
    except ImportError:
        raise DataError("downloads need pooch; install it with: pip install pooch") from None
    target = make_folder(folder).resolve() / name
    if target.exists():
        if sha256 is not None and (target.is_dir() or pooch.file_hash(str(target)) != sha256.lower()):
            raise DataError(f"{target}: exists, but has another checksum; remove it or choose another folder")
        return target
    pooch.get_logger().setLevel("WARNING")
    download = ResumingDownload(target, checked=sha256 is not None, progress=progress, wait=wait)
    known = None if sha256 is None else f"sha256:{sha256.lower()}"
    try:
        pooch.retrieve(url, known, fname=name, path=target.parent, downloader=download)
    except OSError as error:  # those of requests are such, too
        reason = f"{target}: cannot be written: {error.strerror or error}"
        if isinstance(error, requests.RequestException):
            reason = f"{url}: {_describe_error(error)}"
        raise FileError(f"{reason}{download.describe_partial_file()}") from None
    except ValueError as error:  # pooch compared the checksums
        raise DataError(f"{url}: not the file expected: {error}") from None
    return target


class ResumingDownload:
    """A downloader for pooch that resumes the partial file of an earlier call.

    Args:
        target: the path of the complete file; NAME.part and NAME.part.version are beside it.
        checked: whether pooch compares a checksum afterwards.
    """

    def __init__(self, target: Path, *, checked: bool, progress: Progress | None, wait: float) -> None:
        self._part = target.with_name(f"{target.name}.part")
        self._version = target.with_name(f"{target.name}.part.version")
        self._checked, self._progress, self._wait = checked, progress, wait

    def __call__(self, url: str, output_file: str, pooch: object) -> None:
        """Download `url`; pooch calls this and compares the checksum afterwards.

        Raises:
            requests.RequestException: several attempts brought no new byte, or the server refused.
        """
        import requests

        failures, wait = 0, self._wait
        while True:
            before = self._size()
            try:
                if self._request(url):
                    break
                error: Exception = requests.ConnectionError("the connection was cut")
            except requests.HTTPError as refused:
                if refused.response.status_code < 500 and refused.response.status_code != 429:
                    raise
                error = refused
            except requests.RequestException as cut:
                error = cut
            failures = 0 if self._size() > before else failures + 1
            if failures == MAX_ATTEMPTS:
                raise error
            time.sleep(wait if failures else 0)
            wait = 2 * wait if failures else self._wait
        self._version.unlink(missing_ok=True)
        os.replace(self._part, output_file)

    def describe_partial_file(self) -> str:
        """Return a phrase about the partial file, empty without one."""
        size = self._size()
        return (
            f"; {size} bytes are kept in {self._part.name}, and the next call resumes there" if size else ""
        )

    def _size(self) -> int:
        return self._part.stat().st_size if self._part.exists() else 0

    def _request(self, url: str) -> bool:
        """Send one request and write its data; return whether the file is complete."""
        import requests

        have = self._size()
        version = self._version.read_text("ascii").strip() if self._version.exists() else ""
        headers = {"Accept-Encoding": "identity"}  # parts of a compressed answer cannot be joined
        if have and (version or self._checked):
            headers["Range"] = f"bytes={have}-"
            if version:
                headers["If-Range"] = version
        with requests.get(url, headers=headers, stream=True, timeout=TIMEOUT) as answer:
            if answer.status_code == 416:  # the partial file is complete, or too long
                if answer.headers.get("Content-Range") == f"bytes */{have}":
                    return True
                self._part.unlink()
                return False
            answer.raise_for_status()
            start, total = _parse_extent(answer, have)
            tag = answer.headers.get("ETag", "")
            strong = tag if tag and not tag.startswith("W/") else answer.headers.get("Last-Modified", "")
            self._version.write_text(strong.encode("ascii", "ignore").decode(), "ascii")
            with open(self._part, "r+b" if start else "wb") as file:
                size = file.seek(start)
                for number, chunk in enumerate(answer.iter_content(CHUNK_BYTES)):
                    size += file.write(chunk)
                    if self._progress is not None and (number % CHUNKS_PER_REPORT == 0 or size == total):
                        self._progress(size, total)
        return total is None or size >= total


def _parse_extent(answer: Any, have: int) -> tuple[int, int | None]:
    """Return the position of the answer's first byte and the length of the file, None if unknown."""
    if answer.status_code == 206:
        extent = re.fullmatch(r"bytes (\d+)-\d+/(\d+|\*)", answer.headers.get("Content-Range", ""))
        if extent and int(extent[1]) == have:
            return have, None if extent[2] == "*" else int(extent[2])
        import requests

        raise requests.exceptions.InvalidHeader(f"it sent another part than requested, not from byte {have}")
    length = answer.headers.get("Content-Length", "")
    return 0, int(length) if length.isdigit() else None


def _describe_error(error: Any) -> str:
    """Describe an error of requests in a short phrase."""
    import requests

    if isinstance(error, requests.HTTPError):
        return f"the server answered {error.response.status_code} {error.response.reason}"
    if isinstance(error, requests.Timeout):
        return f"the server did not answer for {TIMEOUT:g} s"
    if isinstance(error, requests.ConnectionError):
        inner: Any = error
        while inner is not None:  # the innermost cause has the system's message
            error = inner
            inner = getattr(error, "reason", None)
            if not isinstance(inner, BaseException):
                inner = next((cause for cause in error.args if isinstance(cause, Exception)), None)
        words = str(error).rsplit(": ", 1)[-1]
        return f"cannot be reached, or the connection was cut ({words}); is this machine online?"
    return str(error)
