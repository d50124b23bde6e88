"""`lcorpp export`: the page as a file, and what it refuses before the training."""

import pytest


@pytest.fixture
def untrained(monkeypatch):
    """Fails a test that begins to train or solve."""

    def fail(*arguments, **options):
        raise AssertionError("the command has begun to work")

    monkeypatch.setattr("lcorpp.web.setup.set_up_robot", fail)


def test_export_writes_one_file(lcorpp, tmp_path):
    ended = lcorpp("export", "--to", tmp_path / "new" / "page", "--tracks", 40, "--epochs", 1)
    assert (ended.code, ended.err) == (0, "")
    assert [file.name for file in (tmp_path / "new" / "page").iterdir()] == ["index.html"]
    assert f"wrote {tmp_path / 'new' / 'page' / 'index.html'}: " in ended.out
    assert "kB compressed" in ended.out


@pytest.mark.usefixtures("untrained")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--learner", "forest"], "the exported page cannot run Forest; expected an LSTM of the motion"),
        (["--learner", "none"], "unknown learner 'none'"),
        (["--learner", "summaries", "--epochs", "3"], "makes no passes over the data"),
        (["--classifier", "missing.npz"], "missing.npz"),
        (["shopping", "--learner", "lstm"], "shopping has no sense of tracks that a pointer could give"),
        (["nowhere"], "nowhere"),
    ],
)
def test_export_refuses_options_at_once(lcorpp, tmp_path, arguments, message):
    ended = lcorpp("export", *arguments, "--to", tmp_path / "page")
    assert ended.code == 2
    assert message in ended.err
    assert not (tmp_path / "page").exists()


@pytest.mark.usefixtures("untrained")
def test_export_refuses_a_file_as_folder(lcorpp, tmp_path):
    (tmp_path / "file").write_text("text")
    ended = lcorpp("export", "--to", tmp_path / "file")
    assert ended.code == 2
    assert ended.err == f"lcorpp: {tmp_path / 'file'}: cannot create the folder: File exists\n"


@pytest.mark.usefixtures("untrained")
def test_export_refuses_a_folder_in_the_place_of_the_page(lcorpp, tmp_path):
    (tmp_path / "index.html").mkdir()
    ended = lcorpp("export", "--to", tmp_path)
    assert ended.code == 2
    assert "index.html: cannot be written: Is a directory" in ended.err


def test_export_needs_a_folder(lcorpp):
    ended = lcorpp("export")
    assert ended.code == 2
    assert "--to" in ended.err
