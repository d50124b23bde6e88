"""How the robot hears answers: a topic of a speech recogniser, or its own microphone."""

from __future__ import annotations

from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.robot.config import AnswersConfig
from lcorpp.worlds.ros.connection import RosConnection
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.ros_world import Listener, TopicListener
from lcorpp.worlds.speech import (
    FEATURES,
    Listener as SpeechListener,
    Microphone,
    Recogniser,
    Source,
    read_confidence,
)

MIN_SECONDS, MAX_SECONDS = 0.1, 30.0
"""Shorter listening is none; longer listening ends after so many seconds."""


class MicrophoneListener:
    """Answers that the robot's own recogniser hears (`lcorpp.worlds.ros.ros_world.Listener`).

    Args:
        domain: with sentences, and with what `lcorpp observe` learnt of the recogniser.
        source: of the sound.

    Raises:
        DomainError: the domain has no sentences or no recogniser.
        DataError, FileError: the recogniser cannot be used.
    """

    def __init__(self, domain: Domain, source: Source) -> None:
        planning = domain.planning
        if not planning.utterances or planning.recogniser is None:
            missing = "recogniser" if planning.utterances else "[planning.utterances]"
            raise DomainError(f"{domain.folder}/domain.toml: no {missing}; `lcorpp observe` measures one")
        confidence = read_confidence(planning.recogniser, FEATURES).keep(domain.model.observations)
        self._listener = SpeechListener(Recogniser(planning.utterances), confidence, source)

    def clear(self) -> None:
        """Do nothing: a microphone records only while it is listened to."""

    def listen(self, seconds: float) -> str | None:
        """Return the observation of the first answer, as `Listener.listen`.

        Raises:
            ActionFailedError: the microphone is missing or fails.
        """
        if seconds < MIN_SECONDS:
            return None
        return self._listener.listen(min(seconds, MAX_SECONDS)).observation


def make_listener(config: AnswersConfig, domain: Domain, connection: RosConnection) -> Listener | None:
    """Return what hears the answers; None for a robot that cannot hear.

    Raises:
        DomainError, DataError, FileError: as `MicrophoneListener`.
    """
    if config.microphone:
        return MicrophoneListener(domain, Microphone())
    if config.topic is None:
        return None
    topic, kind = config.topic
    subscription = connection.subscribe(topic, kind)
    return TopicListener(subscription, kind, domain.model.observations, config.utterances, FaultLog(topic))
