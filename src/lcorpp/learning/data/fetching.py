"""Downloads that are checked, and that go on where they were cut: pooch, with a downloader that resumes.

What has come so far is kept beside the file as NAME.part. It is only gone on with if the server says that the
file is the same one still (If-Range, RFC 9110), or where a checksum will tell in the end.
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
"""The files that the paper's authors released, at the last commit of their repository, with their SHA-256."""

CHUNK = 1 << 12
"""Bytes that are written at once, and lost at most when a connection is cut."""
REPORT = 16
"""Of so many chunks one is reported."""

ATTEMPTS = 4
"""Failures one after the other, none of which brought a byte, that end a download."""
FIRST_WAIT, TIMEOUT = 0.5, 30.0
"""Seconds before the second attempt, doubled each time; and without a sign of the server."""

Progress = Callable[[int, int | None], None]
"""Told (bytes that have come, bytes in all where that is known)."""


def fetch_authors(folder: str | Path, *, progress: Progress | None = None) -> tuple[Path, ...]:
    """Download the authors' 123 tracks, `interposx.csv` and `interposy.csv`; what is there already stays.

    The repository has no licence file: the tracks are its authors'.

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
    wait: float = FIRST_WAIT,
) -> Path:
    """Download a file into a folder under its own name; one that is there already, and right, stays.

    Args:
        url: http or https. folder: is made where it is missing.
        sha256: the checksum that the file must have, 64 hexadecimal digits; None accepts any.
        wait: seconds before a second attempt; they double.

    Returns:
        Where the file is.

    Raises:
        FileError: the server cannot be reached or has no such file, or a file cannot be written; what has
            come is kept, and the next call goes on with it.
        DataError: the address or the checksum is none, the file that came, or that was there, has another
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
            raise DataError(
                f"{target}: is there, but with another checksum; remove it or give another folder"
            )
        return target
    pooch.get_logger().setLevel("WARNING")
    download = ResumingDownload(target, checked=sha256 is not None, progress=progress, wait=wait)
    known = None if sha256 is None else f"sha256:{sha256.lower()}"
    try:
        pooch.retrieve(url, known, fname=name, path=target.parent, downloader=download)
    except requests.RequestException as error:
        raise FileError(f"{url}: {_reason(error)}{download.kept()}") from None
    except OSError as error:
        raise FileError(f"{target}: cannot be written: {error.strerror or error}{download.kept()}") from None
    except ValueError as error:  # pooch compared the checksums
        raise DataError(f"{url}: not the file expected: {error}") from None
    return target


class ResumingDownload:
    """What pooch calls to bring a file: it goes on with what an earlier call has left.

    Args:
        target: where the file will be in the end; NAME.part and NAME.part.version lie beside it.
        checked: whether a checksum will be compared.
    """

    def __init__(self, target: Path, *, checked: bool, progress: Progress | None, wait: float) -> None:
        self._part = target.with_name(f"{target.name}.part")
        self._version = target.with_name(f"{target.name}.part.version")
        self._checked, self._progress, self._wait = checked, progress, wait

    def __call__(self, url: str, output_file: str, pooch: object) -> None:
        """Bring `url`; called by pooch, which compares the checksum afterwards.

        Raises:
            requests.RequestException: it failed several times without a byte that is new, or for good.
        """
        import requests

        failures, wait = 0, self._wait
        while True:
            before = self._size()
            try:
                if self._bring(url):
                    break
                error: Exception = requests.ConnectionError("the connection was cut")
            except requests.HTTPError as refused:
                if refused.response.status_code < 500 and refused.response.status_code != 429:
                    raise
                error = refused
            except requests.RequestException as cut:
                error = cut
            failures = 0 if self._size() > before else failures + 1
            if failures == ATTEMPTS:
                raise error
            time.sleep(wait if failures else 0)
            wait = 2 * wait if failures else self._wait
        self._version.unlink(missing_ok=True)
        os.replace(self._part, output_file)

    def kept(self) -> str:
        """A sentence on what is kept for the next time, empty if that is nothing."""
        size = self._size()
        return (
            f"; {size} bytes are kept in {self._part.name}, and the next call goes on there" if size else ""
        )

    def _size(self) -> int:
        return self._part.stat().st_size if self._part.exists() else 0

    def _bring(self, url: str) -> bool:
        """One options; whether the file is whole after it."""
        import requests

        have, version = self._size(), self._known_version()
        headers = {"Accept-Encoding": "identity"}  # parts of a compressed answer could not be put together
        if have and (version or self._checked):
            headers["Range"] = f"bytes={have}-"
            if version:
                headers["If-Range"] = version
        with requests.get(url, headers=headers, stream=True, timeout=TIMEOUT) as answer:
            if answer.status_code == 416:  # there is nothing after what we have
                if answer.headers.get("Content-Range") == f"bytes */{have}":
                    return True
                self._part.unlink()
                return False
            answer.raise_for_status()
            start, total = _extent(answer, have)
            self._remember(answer)
            with open(self._part, "r+b" if start else "wb") as file:
                size = file.seek(start)
                for number, chunk in enumerate(answer.iter_content(CHUNK)):
                    size += file.write(chunk)
                    if self._progress is not None and (number % REPORT == 0 or size == total):
                        self._progress(size, total)
        return total is None or size >= total

    def _known_version(self) -> str:
        """What tells the version of the file that the part is of: a strong ETag or a date, or nothing."""
        return self._version.read_text("ascii").strip() if self._version.exists() else ""

    def _remember(self, answer: Any) -> None:
        tag = answer.headers.get("ETag", "")
        version = tag if tag and not tag.startswith("W/") else answer.headers.get("Last-Modified", "")
        self._version.write_text(version.encode("ascii", "ignore").decode(), "ascii")


def _extent(answer: Any, have: int) -> tuple[int, int | None]:
    """Where the answer's first byte belongs, and how long the file is, None if that is not said."""
    if answer.status_code == 206:
        told = re.fullmatch(r"bytes (\d+)-\d+/(\d+|\*)", answer.headers.get("Content-Range", ""))
        if told and int(told[1]) == have:
            return have, None if told[2] == "*" else int(told[2])
        import requests

        raise requests.exceptions.InvalidHeader(f"it sent another part than asked for, not from byte {have}")
    length = answer.headers.get("Content-Length", "")
    return 0, int(length) if length.isdigit() else None


def _reason(error: Any) -> str:
    """What went wrong, in few words."""
    import requests

    if isinstance(error, requests.HTTPError):
        return f"the server answered {error.response.status_code} {error.response.reason}"
    if isinstance(error, requests.Timeout):
        return f"the server said nothing for {TIMEOUT:g} s"
    if isinstance(error, requests.ConnectionError):
        words = str(_deepest(error)).rsplit(": ", 1)[-1]
        return f"cannot be reached, or the connection was cut ({words}); is this machine online?"
    return str(error)


def _deepest(error: BaseException) -> BaseException:
    """What an error of requests is wrapped around."""
    inner = getattr(error, "reason", None) or next((a for a in error.args if isinstance(a, Exception)), None)
    return _deepest(inner) if isinstance(inner, BaseException) else error
