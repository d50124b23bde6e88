"""Bounds for problems with a hidden value that questions do not change, as most dialogues are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.planning._native import Model, Tree, find_symmetries, mdp_bound, power_potentials
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.potentials import MAX_STATES, PairPotentials, Potential
from lcorpp.values import Array, Belief

ENTRIES_PER_SECOND = 3e5
"""Work of `PairPotentials.minimise` for each second of the time limit: about a quarter of it."""

VISITS_PER_SECOND = 5e6
"""Numbers of the model that the search for symmetries reads, for each second of the limit: a tenth of it."""

MAX_EXAMINED_STATES, MAX_NUMBERS = 2000, 5e6
"""Problems with more states, or numbers other than 0, are not examined."""

SHARES = (0.5, 0.2, 0.05)
"""Shares of a start in the other beliefs at which a potential shall be low; the rest is one state."""

LIKELY_STATES = 4
"""Number of states with which each start is mixed."""

TOLERANCE = 1e-6
"""Of the values of known states, relative to the largest reward."""

MARGIN = 1e-9
"""Relative margin of the values of known states, above their rounding errors."""


@dataclass(frozen=True)
class HiddenBounds:
    """symmetries: for each, the state whose weight each state takes (S). potentials: upper bounds."""

    symmetries: Sequence[Sequence[int]] = ()
    potentials: Sequence[Potential] = ()

    @property
    def found(self) -> bool:
        """Whether there is a symmetry or a potential; then the tree gets a graph of beliefs, too."""
        return bool(self.symmetries or self.potentials)

    def apply(self, tree: Tree) -> None:
        """Add the potentials to a tree, and a graph of beliefs with the symmetries."""
        for own in self.potentials:
            numbers = own.offset, own.scale, own.power, own.entropy
            tree.add_potential(*numbers, own.pairs, own.pair_weights, own.state)
        if self.found:
            tree.add_graph([list(symmetry) for symmetry in self.symmetries])


def find_hidden_values(pomdp: Pomdp, model: Model, starts: Sequence[Belief], seconds: float) -> HiddenBounds:
    """Return the symmetries and potentials of a problem.

    Args:
        model: the problem for the kernels.
        starts: beliefs (S,) at which the potentials shall be low.
        seconds: time limit of the search for which the bounds are; the limits of the work grow with it.
    """
    size = len(pomdp.transition.values) + len(pomdp.observation.values) + pomdp.reward.size
    if len(pomdp.states) > MAX_EXAMINED_STATES or size > MAX_NUMBERS:
        return HiddenBounds()
    seconds = min(seconds, 600.0)
    symmetries = find_symmetries(model, int(VISITS_PER_SECOND * seconds / size), seconds)
    Q = mdp_bound(model, TOLERANCE * float(np.abs(pomdp.reward).max()), seconds)
    blocks = model.export_blocks()
    within = [np.asarray(start) for start in starts if not np.ptp(blocks[np.flatnonzero(start)])]
    potentials = _find_power_potentials(model, Q, within, seconds)
    values = _raise_values(pomdp, Q.max(axis=0))
    for block in np.unique([blocks[np.flatnonzero(start)[0]] for start in within]).tolist():
        states = np.flatnonzero(blocks == block)
        if not 1 < len(states) <= MAX_STATES:
            continue
        pairs = PairPotentials(pomdp, values, states, symmetries)
        if pairs.has_questions:
            own = [start for start in within if blocks[np.flatnonzero(start)[0]] == block]
            share = int(ENTRIES_PER_SECOND * seconds / len(own))
            potentials += [pairs.minimise(start, share) for start in own]
    return HiddenBounds(symmetries, potentials)


def _find_power_potentials(
    model: Model, Q: Array, starts: Sequence[Belief], seconds: float
) -> list[Potential]:
    """Return the potentials with a norm that are the lowest at the starts, or near their likely states."""
    beliefs = list(starts)
    for start in starts:
        for state in np.argsort(-start, kind="stable")[:LIKELY_STATES]:
            for share in SHARES:
                mixed = share * start
                mixed[state] += 1 - share
                beliefs.append(mixed)
    if not beliefs:
        return []
    supports = [np.flatnonzero(belief).astype(np.int32) for belief in beliefs]
    weights = [belief[support] for belief, support in zip(beliefs, supports, strict=True)]
    begins = np.cumsum([0, *map(len, supports)]).astype(np.int64)
    found = power_potentials(model, Q, begins, np.concatenate(supports), np.concatenate(weights), seconds)
    none = np.empty((0, 2), np.int32), np.empty(0)
    return [
        Potential(offset, float(scale), float(power), 0.0, *none)
        for offset, scale, power in zip(*found, strict=True)
    ]


def _raise_values(pomdp: Pomdp, values: Array) -> Array:
    """Return values (S,) of known states that are not below their own backups, for upper bounds (S,)."""
    backups = [
        pomdp.reward[a] + pomdp.discount * pomdp.transition.backward(a, values)
        for a in range(len(pomdp.actions))
    ]
    rise = max(0.0, float((np.max(backups, axis=0) - values).max())) / (1 - pomdp.discount)
    return np.asarray(values + rise + MARGIN * float(np.abs(values).max()) / (1 - pomdp.discount))
