"""The world of a robot that may watch: a person's stream of predictions, and the world of the dialogue."""

from __future__ import annotations

from collections.abc import Iterable

from lcorpp.early_decision.extension import OVER, WATCH
from lcorpp.early_decision.stream_model import StreamModel
from lcorpp.errors import WorldError
from lcorpp.learning import Prediction
from lcorpp.protocols import World
from lcorpp.values import Array


class StreamWorld:
    """Answers `watch` from a stream of predictions, and leaves all other actions to another world.

    `watch` waits for the next prediction of so many points as the next stage has, and returns its bin. Where
    a gap in the samples skipped that number, the first prediction after it counts. The stream is over, and
    `watch` returns `stream_over` at once, after the last stage, after the last prediction, when the person's
    id begins a new track, and after any other action, to which the person may react.

    Args:
        stream: the model that the domain was extended by.
        predictions: of a `StreamingClassifier` for the person, in order; it ends when the person leaves. A
            live source ends it after a time-out, too, as `watch` waits for it.
        world: executes the actions of the dialogue.

    Attributes:
        seconds: that the robot has watched, by the ages of the stages. probability: the last prediction for
            the first class of the stream that counted, uncalibrated; None before.
    """

    def __init__(self, stream: StreamModel, predictions: Iterable[Prediction], world: World) -> None:
        self._stream, self._predictions, self._world = stream, iter(predictions), world
        self._stage, self._is_over = 0, False
        self._track: int | None = None
        self.seconds = 0.0
        self.probability: float | None = None

    @property
    def source(self) -> str:
        """What answers in the dialogue, for messages; "" if it has no name."""
        return str(getattr(self._world, "source", ""))

    def act(self, action: str) -> str:
        """Watch until the next stage, or execute an action of the dialogue.

        Raises:
            WorldError: a prediction has not one probability for each class. Or as the world of the dialogue.
        """
        if action != WATCH:
            self._is_over = True
            return self._world.act(action)
        if self._is_over or self._stage == len(self._stream.points):
            return OVER
        self.seconds = self._stream.seconds[self._stage]
        probabilities = self._find_next()
        if probabilities is None:
            self._is_over = True
            return OVER
        self.probability = float(probabilities[0])
        shown = self._stream.find_bins(self._stage, probabilities[:1])[0]
        self._stage += 1
        return f"bin_{shown + 1}"

    def report(self, action: str) -> None:
        """Execute the report in the world of the dialogue."""
        self._world.report(action)

    def _find_next(self) -> Array | None:
        """Return the next prediction of as many points as the next stage; None if the track ends before."""
        for prediction in self._predictions:
            if self._track is None:
                self._track = prediction.track
            if prediction.track != self._track:
                return None
            if prediction.probabilities is not None and prediction.points >= self._stream.points[self._stage]:
                if prediction.probabilities.shape != (len(self._stream.classes),):
                    raise WorldError(
                        f"a prediction of {len(prediction.probabilities)} classes; expected"
                        f" {' and '.join(self._stream.classes)}"
                    )
                return prediction.probabilities
        return None
