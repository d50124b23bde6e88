"""Files of any kind end in one error: devices, pipes without a writer or an end, NUL bytes, sizes."""

import os
import threading
from contextlib import contextmanager

import pytest

from lcorpp import input_files
from lcorpp.errors import FileError
from lcorpp.files import keep_pipes, map_text, open_text, read_bytes, read_text
from lcorpp.input_files import check_regular, is_inside

READERS = [read_text, read_bytes, map_text, lambda path: open_text(path).read()]


@pytest.fixture
def pipe(tmp_path):
    if not hasattr(os, "mkfifo"):
        pytest.skip("this system has no named pipes")
    os.mkfifo(tmp_path / "pipe")
    return tmp_path / "pipe"


@contextmanager
def writer(pipe, content, *, ends=True):
    """Write to a pipe; with `ends`, close it at once."""
    done = threading.Event()

    def write():
        try:
            with open(pipe, "wb", buffering=0) as file:
                file.write(content)
                if not ends:
                    done.wait()
        except BrokenPipeError:
            pass

    thread = threading.Thread(target=write)
    thread.start()
    yield
    done.set()
    thread.join()


@pytest.mark.parametrize("read", READERS)
@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="this system has no such device")
def test_a_device_is_no_input(read, tmp_path):
    (tmp_path / "link.plog").symlink_to("/dev/zero")
    with pytest.raises(FileError, match=r"link\.plog: cannot be read: it is a device; expected a file"):
        read(tmp_path / "link.plog")


@pytest.mark.parametrize("read", READERS)
def test_a_pipe_without_a_writer(read, pipe, monkeypatch):
    monkeypatch.setattr(input_files, "MAX_WAIT_SECONDS", 0.01)
    with pytest.raises(FileError, match=r"this pipe has no writer after 0\.01 s"):
        read(pipe)


def test_a_writer_that_writes_nothing(pipe, monkeypatch):
    monkeypatch.setattr(input_files, "MAX_SILENCE_SECONDS", 0.01)
    with writer(pipe, b"ab", ends=False), pytest.raises(FileError, match=r"writes nothing for 0\.01 s"):
        read_text(pipe)


@pytest.mark.parametrize("read", READERS)
def test_a_pipe_without_an_end(read, pipe, monkeypatch):
    monkeypatch.setattr(input_files, "MAX_PIPE_BYTES", 1000)
    with writer(pipe, b"y\n" * 10_000), pytest.raises(FileError, match="it is larger than 1000 bytes"):
        read(pipe)


@pytest.mark.parametrize("content", [b"a\nb\n", b"", b"\xff\xfea\0"])
def test_a_pipe_is_read_to_its_end(pipe, content):
    expected = "a" if b"a\0" in content else content.decode()
    with keep_pipes():
        with writer(pipe, content):
            assert read_text(pipe) == expected
        assert bytes(map_text(pipe)).decode() == expected  # the copy
        with open_text(pipe) as file:
            assert file.read() == expected


def test_the_pipes_of_the_shell(tmp_path):
    """They have no name, and their writer may have ended before they are opened."""
    if not os.path.exists("/dev/fd"):
        pytest.skip("this system has no /dev/fd")
    for content in (b"abc", b""):
        ours, theirs = os.pipe()
        os.write(theirs, content)
        os.close(theirs)
        assert read_bytes(f"/dev/fd/{ours}") == content
        os.close(ours)


@pytest.mark.parametrize("read", [read_text, map_text, lambda path: open_text(path).read()])
def test_nul_bytes_are_located(read, tmp_path):
    (tmp_path / "a.csv").write_bytes(b"a\nb\n\0")
    with pytest.raises(FileError, match=r"a\.csv:3: not UTF-8 text: a NUL byte"):
        read(tmp_path / "a.csv")


def test_sizes_are_limited_before_reading(tmp_path):
    with open(tmp_path / "sparse", "wb") as file:
        file.truncate(2**40)
    for read in (read_text, read_bytes, map_text, open_text):
        with pytest.raises(FileError, match="sparse: cannot be read: it is larger than"):
            read(tmp_path / "sparse")
    (tmp_path / "a").write_text("abc")
    assert read_text(tmp_path / "a", 3) == "abc"
    with pytest.raises(FileError, match="larger than 2 bytes"):
        read_text(tmp_path / "a", 2)


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="this system has no /proc")
def test_files_without_a_stated_size():
    assert b"Name:" in read_bytes("/proc/self/status")
    with pytest.raises(FileError, match="larger than 10 bytes"):
        read_bytes("/proc/self/status", 10)


def test_a_line_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr(input_files, "MAX_LINE_BYTES", 2**20)
    (tmp_path / "a.csv").write_bytes(b"a\n" + b"b" * (2**21))
    with open_text(tmp_path / "a.csv") as file:
        assert next(file) == "a\n"
        with pytest.raises(FileError, match="line 2 is longer than 1 MB"):
            next(file)


def test_places_in_a_folder(tmp_path):
    (tmp_path / "in" / "below").mkdir(parents=True)
    (tmp_path / "in" / "out").symlink_to(tmp_path)
    folder = tmp_path / "in"
    assert is_inside(folder / "below" / "a", folder)
    assert is_inside(folder / "below" / ".." / "a", folder)
    for path in (folder / ".." / "a", tmp_path / "a", folder / "out" / "a", tmp_path / "inside"):
        assert not is_inside(path, folder)


def test_libraries_open_files_and_folders_only(tmp_path, pipe):
    check_regular(tmp_path)
    with pytest.raises(FileError, match="it is a pipe or a device; expected a file"):
        check_regular(pipe)
    with pytest.raises(FileError, match="No such file"):
        check_regular(tmp_path / "none")
