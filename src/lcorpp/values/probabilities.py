"""The smallest probabilities: smaller ones count as 0 or are raised to it, for the reason given."""

from __future__ import annotations

import numpy as np

MIN_NORMAL = float(np.finfo(np.float64).tiny)
"""The smallest normal double. Smaller probabilities have lost their digits and count as impossible."""

MIN_LOGARITHM = 1e-300
"""Probabilities are raised to this before their logarithm, so that it is finite."""

MIN_BRANCH = 1e-12
"""Branches of a decision that are less likely are left out: one decision in 10^12 takes such a branch."""

MIN_AVERAGED = 1e-12
"""Probabilities are raised to this before their logarithms are averaged: one classifier that excludes a class
does not exclude it alone."""

MIN_ROUNDED = 1e-4
"""The smallest probability of a row that is written with four decimals."""

MIN_CREDIBLE = 1e-3
"""Rates that are stated or estimated as 0 are raised to this: no data set of thousands justifies a smaller
one, and a forest whose trees all agree gives 0."""

MIN_LABEL = 0.005
"""A class that is less probable is left out of a corrected label: the case would be twice in the training for
nothing."""
