"""Files are read and written with typed errors, and written completely or not at all."""

import os

import pytest

from lcorpp.errors import FileError, ParseError
from lcorpp.files import make_folder, open_atomically, open_text, read_text, sync_folder, write_atomically


def test_what_is_written_is_read(tmp_path):
    write_atomically(tmp_path / "a.txt", "ä\r\nb\n")
    assert read_text(tmp_path / "a.txt") == "ä\r\nb\n"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_byte_order_mark_is_dropped(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"\xef\xbb\xbfabc")
    assert read_text(tmp_path / "a.txt") == "abc"


@pytest.mark.parametrize("content", [b"ok\n\xff\xfe", b"a\nb\xe4c"])
def test_text_that_is_no_utf8_is_located(tmp_path, content):
    (tmp_path / "a.txt").write_bytes(content)
    with pytest.raises(FileError, match=r"a\.txt:2: not UTF-8 text"):
        read_text(tmp_path / "a.txt")


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(FileError, match=r"none\.txt: cannot be read: No such file"):
        read_text(tmp_path / "none.txt")
    with pytest.raises(FileError, match="cannot be read: Is a directory"):
        read_text(tmp_path)
    with pytest.raises(FileError, match="cannot be written: No such file"):
        write_atomically(tmp_path / "none" / "a.txt", "")
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot create the folder"):
        make_folder(tmp_path / "file")


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    write_atomically(path, "old")

    def disk_full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", disk_full)
    with pytest.raises(FileError, match="No space left"):
        write_atomically(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_parse_errors_show_the_place():
    error = ParseError("a.plog", 3, 9, "unknown value 'x'", "pr(a = x) = 1.\n")
    assert str(error) == "a.plog:3:9: unknown value 'x'\n    pr(a = x) = 1.\n            ^"


def test_a_long_line_is_shown_around_the_place():
    error = ParseError("a.pomdp", 1, 5000, "not a number", "1 " * 2499 + " x" + " 1" * 3000)
    first, shown, caret = str(error).splitlines()
    assert first.endswith("not a number")
    assert len(shown) < 130
    assert shown[caret.index("^")] == "x"


def test_a_link_is_followed_and_a_pipe_is_not_replaced(tmp_path):
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to("target")
    write_atomically(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_atomically(tmp_path / "pipe", "through")
    assert os.read(reader, 100) == b"through"
    os.close(reader)
    assert (tmp_path / "pipe").is_fifo()


def test_impossible_file_names(tmp_path):
    for call in (lambda: read_text("a\0b"), lambda: write_atomically(tmp_path / "a\0b", "")):
        with pytest.raises(FileError, match="embedded null byte"):
            call()


def test_a_file_appears_completely_or_not_at_all(tmp_path):
    (tmp_path / "a").write_text("old")

    def stop_half_way():
        with open_atomically(tmp_path / "a") as file:
            file.write(b"half")
            raise RuntimeError("in the middle")

    with pytest.raises(RuntimeError, match="in the middle"):
        stop_half_way()
    assert (tmp_path / "a").read_text() == "old"
    with open_atomically(tmp_path / "a") as file:
        file.write(b"new ")
        assert (tmp_path / "a").read_text() == "old"
        file.write(b"words")
    assert (tmp_path / "a").read_text() == "new words"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    with pytest.raises(FileError, match="cannot be written"):
        open_atomically(tmp_path / "no" / "a").__enter__()


def test_text_is_opened_line_by_line(tmp_path):
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfone\r\ntwo")
    with open_text(tmp_path / "a") as file:
        assert list(file) == ["one\n", "two"]
    with pytest.raises(FileError, match="cannot be read: No such file"):
        open_text(tmp_path / "b")


def test_the_folder_of_a_file_is_flushed_to_the_disk(tmp_path, monkeypatch):
    """A link is followed."""
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "a").write_text("")
    (tmp_path / "link").symlink_to(tmp_path / "there" / "a")
    waited, fsync = [], os.fsync
    monkeypatch.setattr("os.fsync", lambda file: waited.append(os.fstat(file).st_ino) or fsync(file))
    sync_folder(tmp_path / "link")
    assert waited == [(tmp_path / "there").stat().st_ino]
    sync_folder(tmp_path / "no" / "such")  # nothing to flush
