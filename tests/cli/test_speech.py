"""The commands listen and observe: what they print, and their errors."""

from shutil import which
from subprocess import run

import pytest
import typer

from lcorpp.cli.speech import listen, observe
from lcorpp.errors import ActionFailedError, DataError, DomainError, FileError

app = typer.Typer()
app.command()(listen.listen)
app.command()(observe.observe)


def call(*arguments):
    app([str(argument) for argument in arguments], standalone_mode=False)


@pytest.mark.skipif(not which("flite"), reason="flite is not installed")
def test_a_recording_is_heard(tmp_path, capsys):
    pytest.importorskip("pocketsphinx", reason="pocketsphinx is not installed")
    run(["flite", "-voice", "slt", "-t", "yes please", "-o", str(tmp_path / "yes.wav")], check=True)
    call("listen", "intention", "--preset", "heard", "--file", tmp_path / "yes.wav")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["observation", "pos"]
    assert lines[1].split(maxsplit=1) == ["heard", "yes please"]


def test_errors_of_listen(tmp_path, monkeypatch):
    (tmp_path / "bad.wav").write_bytes(b"RIFF")
    with pytest.raises(DataError, match=r"bad\.wav: not a wave file of PCM"):
        call("listen", "--preset", "heard", "--file", tmp_path / "bad.wav")
    with pytest.raises(FileError, match=r"none\.wav: cannot be read"):
        call("listen", "--preset", "heard", "--file", tmp_path / "none.wav")
    with pytest.raises(DomainError, match=r"museum: \[planning.utterances\] is missing"):
        call("listen", "museum", "--file", tmp_path / "bad.wav")
    with pytest.raises(DataError, match=r"bad\.wav: no confidence of a recogniser"):
        call("listen", "--confidence", tmp_path / "bad.wav")
    monkeypatch.setitem(__import__("sys").modules, "pocketsphinx", None)
    (tmp_path / "empty.wav").write_bytes(b"")
    with pytest.raises(DataError):
        call("listen", "--preset", "heard", "--file", tmp_path / "empty.wav")
    with pytest.raises(ActionFailedError, match=r"pip install 'lcorpp\[speech\]'"):
        call("listen", "--preset", "heard")


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        (("--noise", "pink"), DataError, "expected one of clean"),
        (("--said", "expected=2"), DataError, "expected a probability"),
        (("--recordings", "no/such/folder"), FileError, "there is no such folder of recordings"),
        (("--voices", "nobody:a"), DataError, "expected one of flite:VOICE"),
        (("museum",), DomainError, "expected .planning.utterances."),
    ],
)
def test_errors_of_observe(tmp_path, arguments, error, words):
    pytest.importorskip("pocketsphinx", reason="pocketsphinx is not installed")
    with pytest.raises(error, match=words):
        call("observe", *arguments, "--out", tmp_path)
    assert not list(tmp_path.iterdir())  # before any work
