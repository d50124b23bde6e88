"""Gaze of a person and a robot: whether they look at each other, and how near they are.

Sources: Webb, Giuliani and Lemaignan, Measuring visual social engagement from proxemics and gaze, RO-MAN
2022, for the formulas; the defaults of ROS4HRI's node hri_engagement for the numbers.
"""

from __future__ import annotations

import numpy as np

from lcorpp.values import Array

LOOKS_ANGLE = np.radians(20.0)
"""Largest angle between a face and the direction to the robot at which the person looks at the robot."""

FIELD_OF_VIEW = np.radians(60.0)
"""Half the field of attention, of people and of the robot."""

MAX_DISTANCE = 4.0
"""Metres beyond which nobody is engaged."""


def is_looking(gaze_angle: Array) -> Array:
    """(...) 1 where the person looks at the robot, 0 where not; NaN stays NaN."""
    return np.where(np.isnan(gaze_angle), np.nan, (gaze_angle <= LOOKS_ANGLE).astype(np.float64))


def compute_mutual_gaze(gaze_angle: Array, robot_angle: Array) -> Array:
    """(...) how much person and robot look at each other: 1 if straight, 0 outside of the field of attention.

    Args:
        gaze_angle: (...) between the face and the direction to the robot, radians. robot_angle: (...) between
            the robot's head and the direction to the person.
    """
    return _compute_gaze(gaze_angle) * _compute_gaze(robot_angle)


def compute_social_engagement(gaze_angle: Array, robot_angle: Array, face_distance: Array) -> Array:
    """(...) the visual social engagement of a person and a robot: mutual gaze over distance, at most 1.

    It is 0 beyond `MAX_DISTANCE`.

    Args:
        face_distance: (...) metres; the angles are those of `compute_mutual_gaze`.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning.features.gaze import compute_social_engagement
        >>> gaze = np.radians([0.0, 30.0, 30.0])
        >>> compute_social_engagement(gaze, np.zeros(3), np.array([2.0, 2.0, 5.0])).round(3)
        array([0.5  , 0.333, 0.   ])
    """
    mutual = compute_mutual_gaze(gaze_angle, robot_angle)
    engagement = np.minimum(1.0, mutual / np.maximum(face_distance, 1e-6))
    return np.where(face_distance > MAX_DISTANCE, 0.0 * engagement, engagement)


def _compute_gaze(angle: Array) -> Array:
    """(...) how near a direction is to the axis of a head: 1 on the axis, 0 outside of the field."""
    ratio = np.tan(np.minimum(angle, FIELD_OF_VIEW)) / np.tan(FIELD_OF_VIEW)
    return np.asarray(1.0 - ratio, dtype=np.float64)
