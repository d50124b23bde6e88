"""The belief about a person as ROS messages: Intent and EngagementLevel of ROS4HRI, or JSON.

Source: REP 155 (ROS for Human-Robot Interaction), hri_msgs/EngagementLevel, hri_actions_msgs/Intent.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass

from lcorpp.values import Distribution, SharedValue, format_value
from lcorpp.worlds.ros.connection import RosConnection

INTENT, ENGAGEMENT, TEXT = "hri_actions_msgs/Intent", "hri_msgs/EngagementLevel", "std_msgs/String"

DISENGAGED, ENGAGING, ENGAGED = 1, 2, 3
"""Levels of hri_msgs/EngagementLevel."""

ENGAGE_WITH = "__intent_engage_with__"
MOTION, SPEECH = "__modality_motion__", "__modality_speech__"
PRIORITY = 128
"""The default priority of an intent."""


@dataclass(frozen=True)
class BeliefTopics:
    """The topics to which the belief is published, each may be None.

    intent: of Intent, once the robot reports `value`.
    engagement: of EngagementLevel, a pattern with {person}, see `name_person`: the band of the probability
        of `value`.
    state: of JSON as std_msgs/String: person, probability of each shared value, action.
    value: the shared value that means engagement, e.g. "interested".
    min_engaging, min_engaged: the lower ends of the bands "engaging" and "engaged".
    """

    value: SharedValue
    intent: str | None = None
    engagement: str | None = None
    state: str | None = None
    min_engaging: float = 0.3
    min_engaged: float = 0.8

    def publish(
        self, connection: RosConnection, person: str, marginal: Distribution, action: str | None = None
    ) -> None:
        """Publish the belief about a person.

        Args:
            marginal: of the shared variables. action: the robot's last action, None before the first.

        Raises:
            ConnectionLostError: the connection is lost.
        """
        probability = float(marginal[self.value])
        if self.engagement is not None:
            level = (DISENGAGED, ENGAGING, ENGAGED)[
                (probability >= self.min_engaging) + (probability >= self.min_engaged)
            ]
            topic = self.engagement.replace("{person}", name_person(person))
            connection.publish(topic, ENGAGEMENT, {"level": level})
        if self.state is not None:
            content = {
                "person": person,
                "belief": {format_value(value): round(p, 6) for value, p in marginal},
                "action": action,
            }
            connection.publish(self.state, TEXT, {"data": json.dumps(content)})

    def publish_intent(
        self, connection: RosConnection, person: str, marginal: Distribution, *, has_answered: bool
    ) -> None:
        """Publish that a person wants to engage with the robot; the confidence is the belief's.

        Args:
            has_answered: whether the person has answered, so that the modality is speech and not motion.
        """
        if self.intent is not None:
            message = {
                "intent": ENGAGE_WITH,
                "data": json.dumps({"recipient": person}),
                "source": person,
                "modality": SPEECH if has_answered else MOTION,
                "priority": PRIORITY,
                "confidence": float(marginal[self.value]),
            }
            connection.publish(self.intent, INTENT, message)


def name_person(id_: str) -> str:
    """Return an id as a part of the name of a topic: letters, digits and underscores, a letter first."""
    name = re.sub(r"\W", "_", id_, flags=re.ASCII)
    return name if name[:1].isalpha() else f"p{name}"
