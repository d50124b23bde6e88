"""The sound device of the machine: play samples, record the microphone (package sounddevice)."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any

import numpy as np

from lcorpp.errors import ActionFailedError
from lcorpp.values import Array
from lcorpp.worlds.speech.waves import RATE

BLOCK_SECONDS = 0.03
"""Duration of a block of the microphone."""

EXTRA_SECONDS = 1.0
"""Seconds that a device may take beyond the sound itself."""


def play(samples: Array, rate: int) -> None:
    """Play samples (n,) and return at their end.

    Raises:
        ActionFailedError: there is no sound device, or it does not play in time.
    """
    with _name_errors() as device:
        remaining, finished = np.asarray(samples, np.float32), queue.SimpleQueue[bool]()

        def fill(block: Any, frames: int, _time: Any, _status: Any) -> None:
            nonlocal remaining
            block[:] = 0
            block[: len(remaining[:frames]), 0] = remaining[:frames]
            remaining = remaining[frames:]
            if not len(remaining):
                raise device.CallbackStop

        limit = len(samples) / rate + EXTRA_SECONDS
        with device.OutputStream(
            rate, channels=1, callback=fill, finished_callback=lambda: finished.put(True)
        ):
            try:
                finished.get(timeout=limit)
            except queue.Empty:
                raise ActionFailedError(f"the sound device has not played within {limit:.1f} s") from None


class Microphone:
    """The default microphone as a source of blocks (`lcorpp.worlds.speech.listener.Source`)."""

    def blocks(self, seconds: float) -> Iterator[Array]:
        """Yield blocks (n,) of samples at `RATE` for some seconds of the clock.

        Raises:
            ActionFailedError: there is no microphone, or it does not deliver.
        """
        arrived = queue.SimpleQueue[Array]()
        with _name_errors() as device:
            stream = device.InputStream(
                RATE,
                blocksize=round(BLOCK_SECONDS * RATE),
                channels=1,
                callback=lambda block, *_: arrived.put(block[:, 0].astype(np.float64)),
            )
            with stream:
                end = monotonic() + seconds
                while (left := end - monotonic()) > 0:
                    try:
                        yield arrived.get(timeout=min(EXTRA_SECONDS, left + BLOCK_SECONDS))
                    except queue.Empty:
                        if monotonic() < end:
                            raise ActionFailedError("the microphone delivers no sound") from None


@contextmanager
def _name_errors() -> Iterator[Any]:
    """Yield the module sounddevice; raise its errors as `ActionFailedError`."""
    try:
        import sounddevice
    except ImportError:
        raise ActionFailedError("sound needs sounddevice: pip install 'lcorpp[speech]'") from None
    except OSError as error:
        raise ActionFailedError(f"no sound: {error}; e.g. apt-get install libportaudio2") from None
    try:
        yield sounddevice
    except (sounddevice.PortAudioError, ValueError) as error:
        raise ActionFailedError(f"no sound device that can be used: {error}") from None
