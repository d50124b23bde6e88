"""Voices: programs that turn text into speech, each a process with a time-out, and recorded sentences."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

from lcorpp.errors import ActionFailedError, DataError, FileError, expected_one_of
from lcorpp.values import Array
from lcorpp.workers import end_with_thread
from lcorpp.worlds.speech.sound_device import play
from lcorpp.worlds.speech.waves import MAX_SECONDS, read_wave

MAX_LENGTH = 1000
"""Maximum number of characters of a text."""

TIMEOUT = 20.0
"""Seconds that a program may take for a text."""

VOICES = ("flite:VOICE", "espeak-ng:VOICE", "piper:MODEL.onnx", "wave:FILE.wav", "wave:FOLDER")
"""The texts that `parse_voice` reads."""


class Voice(Protocol):
    """The voice of a robot."""

    @property
    def name(self) -> str:
        """For tables, e.g. ``flite:slt``."""

    def synthesise(self, text: str) -> tuple[Array, int]:
        """Return the speech of a text: samples (n,) from -1 to 1, and their number per second.

        Raises:
            ActionFailedError: the program is missing, fails, or exceeds its time-out.
            DataError: the text is empty, too long or unprintable.
        """

    def say(self, text: str) -> None:
        """Play the speech of a text on the default sound device, and return at its end.

        Raises:
            ActionFailedError: as above, or there is no sound device.
        """


@dataclass(frozen=True)
class ProgramVoice:
    """A program that writes the speech of a text to a wave file.

    name: for tables, e.g. ``flite:slt`` or ``piper:en_US-joe-medium``.
    command: returns the program and its arguments for a text and the wave file; the text is also its input.
    timeout: seconds that a text may take.
    """

    name: str
    command: Callable[[str, Path], Sequence[str]]
    timeout: float = TIMEOUT

    def synthesise(self, text: str) -> tuple[Array, int]:
        """Return the speech of a text, see `Voice`."""
        check_text(text)
        with tempfile.TemporaryDirectory(prefix="lcorpp-voice-") as folder:
            file = Path(folder) / "speech.wav"
            run_program(self.command(text, file), text, self.timeout)
            try:
                return read_wave(file)
            except (FileError, DataError) as error:
                reason = str(error).removeprefix(f"{file}: ")
                raise ActionFailedError(f"{self.name} wrote no speech of {text!r}: {reason}") from None

    def say(self, text: str) -> None:
        """Play the speech of a text, see `Voice`."""
        play(*self.synthesise(text))


@dataclass(frozen=True)
class RecordedVoice:
    """Recorded sentences: one wave file for all texts, or a folder with a file for each.

    name: as `parse_voice` reads it.
    path: the file, or the folder; there the file of "Nice to meet you!" is ``nice_to_meet_you.wav``.
    """

    name: str
    path: Path

    def synthesise(self, text: str) -> tuple[Array, int]:
        """Return the recording of a text, see `Voice`.

        Raises:
            FileError: there is no recording.
        """
        check_text(text)
        if not self.path.is_dir():
            return read_wave(self.path)
        words = "".join(c if c.isalnum() or c == "'" else " " for c in text.lower()).split()
        return read_wave(self.path / f"{'_'.join(words)[:200]}.wav")

    def say(self, text: str) -> None:
        """Play the recording of a text, see `Voice`."""
        play(*self.synthesise(text))


def parse_voice(text: str, *, timeout: float = TIMEOUT) -> Voice:
    """Return the voice of a text such as ``flite:slt``; see `VOICES`.

    Raises:
        DataError: the text names no voice, or the time-out is not positive.
        ActionFailedError: flite is missing.
        FileError: the model of piper or the recording does not exist.
    """
    kind, _, which = text.partition(":")
    if not 0 < timeout <= MAX_SECONDS:
        raise DataError(f"the time-out of a voice is {timeout}; expected up to {MAX_SECONDS} seconds")
    if not which or not which.isprintable() or which.startswith("-"):
        raise DataError(f"the voice {text!r}: {expected_one_of(VOICES)}")
    if kind == "flite":
        known = list_flite_voices()
        if which not in known:  # flite itself would take another one without a word
            raise DataError(f"the voice {text!r}: flite has no voice {which!r}; {expected_one_of(known)}")
        return ProgramVoice(
            text, lambda said, file: ("flite", "-voice", which, "-t", said, "-o", str(file)), timeout
        )
    if kind == "espeak-ng":
        return ProgramVoice(
            text, lambda said, file: ("espeak-ng", "-v", which, "--stdin", "-w", str(file)), timeout
        )
    if kind not in ("piper", "wave"):
        raise DataError(f"the voice {text!r}: {expected_one_of(VOICES)}")
    path = Path(which)
    if not path.exists():
        raise FileError(f"the voice {text!r}: there is no {path}")
    if kind == "wave":
        return RecordedVoice(text, path)
    name = f"piper:{path.stem}"  # not where the model lies
    return ProgramVoice(name, lambda said, file: ("piper", "-m", which, "-f", str(file)), timeout)


@cache
def list_flite_voices() -> tuple[str, ...]:
    """Return the names of flite's voices.

    Raises:
        ActionFailedError: flite is missing, or fails.
    """
    _, _, names = run_program(("flite", "-lv"), "", TIMEOUT).partition(":")
    return tuple(names.split())


def check_text(text: str) -> None:
    """Check a text for a voice.

    Raises:
        DataError: it has no letter or digit, is too long, or has characters that cannot be printed.
    """
    if not isinstance(text, str) or not any(c.isalnum() for c in text):
        raise DataError(f"the text {text!r} cannot be spoken; expected words")
    if len(text) > MAX_LENGTH or not text.isprintable():
        raise DataError(
            f"the text {text[:40]!r}... cannot be spoken; expected a line of at most {MAX_LENGTH} letters"
        )


def run_program(command: Sequence[str], text: str, timeout: float) -> str:
    """Run a program with a text as its input; return its output.

    Raises:
        ActionFailedError: the program is missing, fails, or takes more than `timeout` seconds; then it is
            killed.
    """
    name = command[0]
    try:
        done = subprocess.run(
            end_with_thread(command), input=text.encode(), capture_output=True, timeout=timeout, check=False
        )
    except subprocess.TimeoutExpired:
        raise ActionFailedError(f"{name} took more than {timeout:g} seconds and was stopped") from None
    except FileNotFoundError:
        raise ActionFailedError(
            f"there is no program {name!r}; install it, e.g. apt-get install flite espeak-ng, or pip install"
            " piper-tts"
        ) from None
    except OSError as error:
        raise ActionFailedError(f"{name} cannot be run: {error.strerror or error}") from None
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        raise ActionFailedError(f"{name} failed: {lines[-1][:300] if lines else f'code {done.returncode}'}")
    return done.stdout.decode(errors="replace")
