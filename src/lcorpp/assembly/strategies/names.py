"""The names of the strategies, which take longer to load, so that a command can list them."""

TABLE_NAMES = ("L", "R", "P", "L+R", "R+P", "L+P", "LCORPP")
"""Of `lcorpp.decision.STRATEGIES`."""

TRUST_NAMES = ("LCORPP+trust", "LCORPP+trust-hearing", "LCORPP+trust-asking")
"""Of `lcorpp.assembly.strategies.trust.WITH_TRUST`."""

BASELINE_NAMES = ("ask-twice", "random", "always-report")
"""Of `lcorpp.assembly.strategies.baselines.BASELINES`."""

WEIGHT, NOISE = "weight_", "noise"
"""Columns of trust in a table: the weight of each source, and the estimated noise of the answers."""
