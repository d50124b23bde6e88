"""Visitors walk off to one of three sides, on a path of twelve points."""

import numpy as np

SIDES = {"lab": -1.0, "office": 0.0, "store": 1.0}


def trajectory(person, rng):
    along = np.linspace(0, 3, 12)
    across = SIDES[person["goal"]] * along / 3 + rng.normal(0, 0.4, 12).cumsum() / 4
    return np.stack([along, across])
