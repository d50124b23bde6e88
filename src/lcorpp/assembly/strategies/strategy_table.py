"""The tables of strategies; their functions load on first use, so that a command can list the names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

TABLE_NAMES = ("L", "R", "P", "L+R", "R+P", "L+P", "LCORPP")
"""Of `lcorpp.decision.STRATEGIES`."""

TRUST_NAMES = ("LCORPP+trust", "LCORPP+trust-hearing", "LCORPP+trust-asking")
"""Of `lcorpp.assembly.strategies.trust.WITH_TRUST`."""


LIMITS_NAME = "LCORPP+limits"
"""Of `lcorpp.assembly.strategies.limits.WITH_LIMITS`."""


@dataclass(frozen=True)
class Baseline:
    """A row of the table of baselines; its fields are those of `lcorpp.decision.Strategy`.

    change: the name of the function of `lcorpp.assembly.strategies.baselines` that changes the robot, None if
        it only leaves parts out. draws: the function takes a random generator, too.
    """

    learns: bool = False
    reasons: bool = False
    plans: bool = False
    change: str | None = None
    draws: bool = False


BASELINE_TABLE: Mapping[str, Baseline] = {
    "ask-twice": Baseline(learns=True, reasons=True, plans=True, change="ask_twice"),
    "random": Baseline(change="act_at_random", draws=True),
    "always-report": Baseline(learns=True, reasons=True),
}
"""Strategies beside the table of the paper, by name. `always-report` is L+R, and without senses R."""

WEIGHT, FORM, NOISE, ASK_COST = "weight_", "form_", "noise", "ask_cost"
"""Columns of trust in a table: the weight of each source and of each form of answers, the estimated noise of
the answers, and the estimated cost a person, in reward units, of questions that were asked to learn."""
