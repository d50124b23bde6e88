"""Downloads against a server on this machine that cuts connections and changes its file."""

from __future__ import annotations

import hashlib
import socket
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import DataError, FileError
from lcorpp.learning.data.fetching import AUTHORS, fetch, fetch_authors

from .server import TAG, serving

CONTENT = np.random.default_rng(0).bytes(300_000)
DIGEST = hashlib.sha256(CONTENT).hexdigest()
REAL = Path(__file__).parents[4] / "shared" / "data" / "authors"


@pytest.fixture
def web(monkeypatch):
    monkeypatch.setenv("NO_PROXY", "*")
    with serving(CONTENT) as made:
        yield made


def test_a_file_is_downloaded_completely_and_only_once(web, tmp_path):
    reports = []
    file = fetch(web.url, tmp_path / "new", sha256=DIGEST, progress=lambda *at: reports.append(at))
    assert file == tmp_path / "new" / "people here.csv"
    assert file.read_bytes() == CONTENT
    assert reports[-1] == (300_000, 300_000)
    assert fetch(web.url, tmp_path / "new", sha256=DIGEST.upper()) == file
    assert web.asked == [(None, None)]
    assert [path.name for path in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize("digest", [DIGEST, None])
def test_a_download_survives_repeated_cuts(web, tmp_path, digest):
    web.cut = 70_000
    assert fetch(web.url, tmp_path, sha256=digest, wait=0).read_bytes() == CONTENT
    starts = [int(asked.strip("bytes=-")) if asked else 0 for asked, _ in web.asked]
    assert len(starts) == 5
    assert starts == sorted(starts)
    assert all(condition == TAG for _, condition in web.asked[1:])
    assert len(list(tmp_path.iterdir())) == 1


def test_a_second_call_resumes_the_partial_file(web, tmp_path):
    web.cut = 100_000
    part = tmp_path / "people here.csv.part"

    def stop(done, total):
        web.cut = 0

    with pytest.raises(
        FileError, match=r"\d+ bytes are kept in people here\.csv\.part, and the next call resumes"
    ):
        fetch(web.url, tmp_path, wait=0, progress=stop)
    kept = part.stat().st_size
    assert 0 < kept <= 100_000
    assert part.read_bytes() == CONTENT[:kept]
    web.cut = None
    assert fetch(web.url, tmp_path, wait=0).read_bytes() == CONTENT
    assert web.asked[-1] == (f"bytes={kept}-", TAG)


def left(folder, content, tag=TAG):
    (folder / "people here.csv.part").write_bytes(content)
    (folder / "people here.csv.part.version").write_text(tag)


def test_a_file_that_changed_meanwhile_is_downloaded_again(web, tmp_path):
    left(tmp_path, b"of an older version", '"older"')
    assert fetch(web.url, tmp_path).read_bytes() == CONTENT
    assert web.asked == [("bytes=19-", '"older"')]


@pytest.mark.parametrize(
    ("content", "ranges", "requests"),
    [(CONTENT[:1000], False, 1), (CONTENT, True, 1), (CONTENT + b"and more", True, 2)],
    ids=["server-without-ranges", "already-complete", "too-long"],
)
def test_partial_files_that_cannot_be_continued(web, tmp_path, content, ranges, requests):
    left(tmp_path, content)
    web.ranges = ranges
    assert fetch(web.url, tmp_path, sha256=DIGEST, wait=0).read_bytes() == CONTENT
    assert len(web.asked) == requests


def test_without_a_version_only_a_checksum_allows_to_resume(web, tmp_path):
    web.tag = ""
    left(tmp_path, CONTENT[:1000], "")
    assert fetch(web.url, tmp_path).read_bytes() == CONTENT
    assert web.asked.pop() == (None, None)
    (tmp_path / "people here.csv").unlink()
    left(tmp_path, CONTENT[:1000], "")
    assert fetch(web.url, tmp_path, sha256=DIGEST).read_bytes() == CONTENT
    assert web.asked.pop() == ("bytes=1000-", None)


def test_a_file_with_another_checksum_is_not_kept(web, tmp_path):
    with pytest.raises(DataError, match="not the file expected: SHA256 hash of downloaded file"):
        fetch(web.url, tmp_path, sha256="0" * 64)
    assert list(tmp_path.iterdir()) == []
    left(tmp_path, b"x" * 1000)  # the rest of the right file does not make it right
    with pytest.raises(DataError, match="not the file expected"):
        fetch(web.url, tmp_path, sha256=DIGEST)
    assert fetch(web.url, tmp_path, sha256=DIGEST).read_bytes() == CONTENT


def test_a_file_of_the_user_is_never_replaced(web, tmp_path):
    (tmp_path / "people here.csv").write_text("mine")
    with pytest.raises(DataError, match="exists, but has another checksum; remove it"):
        fetch(web.url, tmp_path, sha256=DIGEST)
    assert (tmp_path / "people here.csv").read_text() == "mine"
    assert web.asked == []


def test_errors_of_the_server_are_reported(web, tmp_path):
    web.status = 404
    with pytest.raises(FileError, match="the server answered 404 Not Found"):
        fetch(web.url, tmp_path, wait=0)
    assert len(web.asked) == 1
    web.status = 503
    with pytest.raises(FileError, match="the server answered 503 Service Unavailable"):
        fetch(web.url, tmp_path, wait=0)
    assert len(web.asked) == 5


def test_an_unreachable_server_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("NO_PROXY", "*")
    with socket.socket() as taken:  # bound, but not listening
        taken.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{taken.getsockname()[1]}/a.csv"
        with pytest.raises(FileError, match=r"cannot be reached, .*refused.* is this machine online\?"):
            fetch(url, tmp_path, wait=0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "url", ["people.csv", "ftp://there/a.csv", "http://there/", "http://there/..", "x:/a"]
)
def test_a_malformed_address_is_an_error(tmp_path, url):
    with pytest.raises(DataError, match="is not the address of a file"):
        fetch(url, tmp_path)


def test_a_malformed_checksum_is_an_error(tmp_path):
    with pytest.raises(DataError, match="'beef' is not a checksum; expected the 64 hexadecimal digits"):
        fetch("http://there/a.csv", tmp_path, sha256="beef")


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot create the folder"):
        fetch("http://there/a.csv", tmp_path / "file")


@pytest.mark.skipif(not REAL.is_dir(), reason="the authors' data is not here (shared/data/authors)")
def test_the_checksums_are_those_of_the_authors_files(tmp_path):
    for url in AUTHORS:
        name = url.rsplit("/", 1)[-1]
        (tmp_path / name).write_bytes((REAL / name).read_bytes())
    assert [file.name for file in fetch_authors(tmp_path)] == ["interposx.csv", "interposy.csv"]
