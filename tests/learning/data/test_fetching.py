"""Downloads against a server on this machine that cuts connections."""

from __future__ import annotations

import hashlib
import socket
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import DataError, FileError
from lcorpp.learning.data.fetching import AUTHORS, fetch, fetch_authors

from .server import serving

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
    assert reports == sorted(reports)
    assert (reports[0], reports[-1]) == ((1 << 16, 300_000), (300_000, 300_000))
    assert fetch(web.url, tmp_path / "new", sha256=DIGEST.upper()) == file
    assert web.requests == 1
    assert [path.name for path in file.parent.iterdir()] == [file.name]
    (tmp_path / "any").touch()
    assert file.stat().st_mode == (tmp_path / "any").stat().st_mode


def test_progress_without_a_length(web, tmp_path):
    web.length = False
    reports = []
    file = fetch(web.url, tmp_path, progress=lambda *at: reports.append(at))
    assert file.read_bytes() == CONTENT
    assert {total for _, total in reports} == {None}


@pytest.mark.parametrize("digest", [DIGEST, None])
def test_a_download_that_is_cut_leaves_nothing(web, tmp_path, digest):
    web.cut = 100_000
    with pytest.raises(FileError, match=r"people%20here\.csv: the connection was cut; no part is kept"):
        fetch(web.url, tmp_path, sha256=digest)
    assert list(tmp_path.iterdir()) == []
    web.cut = None
    assert fetch(web.url, tmp_path, sha256=digest).read_bytes() == CONTENT


def test_a_file_with_another_checksum_is_not_kept(web, tmp_path):
    with pytest.raises(DataError, match="not the file expected: SHA256 hash of downloaded file"):
        fetch(web.url, tmp_path, sha256="0" * 64)
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_the_user_is_never_replaced(web, tmp_path):
    (tmp_path / "people here.csv").write_text("mine")
    with pytest.raises(DataError, match="exists, but has another checksum; remove it"):
        fetch(web.url, tmp_path, sha256=DIGEST)
    assert (tmp_path / "people here.csv").read_text() == "mine"
    (tmp_path / "people here.csv").unlink()
    (tmp_path / "people here.csv").mkdir()
    with pytest.raises(FileError, match="exists, but is not a file; remove it"):
        fetch(web.url, tmp_path)
    assert web.requests == 0


@pytest.mark.parametrize(("status", "phrase"), [(404, "Not Found"), (503, "Service Unavailable")])
def test_errors_of_the_server_are_reported(web, tmp_path, status, phrase):
    web.status = status
    with pytest.raises(FileError, match=f"the server answered {status} {phrase}"):
        fetch(web.url, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_name_too_long_for_the_disk_is_an_error(web, tmp_path):
    with pytest.raises(FileError, match="cannot be written: File name too long"):
        fetch(f"{web.url}/{'a' * 300}", tmp_path)


def test_an_unreachable_server_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("NO_PROXY", "*")
    with socket.socket() as taken:  # bound, but not listening
        taken.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{taken.getsockname()[1]}/a.csv"
        with pytest.raises(
            FileError,
            match=r"/a\.csv: cannot be reached, .* \(Connection refused\); is this machine online\?",
        ):
            fetch(url, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "url", ["people.csv", "ftp://there/a.csv", "http://there/", "http://there/..", "x:/a", "http://a..b/c"]
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
