"""One step of a small problem, written out: backups of all beliefs, of some, and plans that go on for ever.

Sources: Smallwood and Sondik, Operations Research 1973 (alpha vectors); Hansen, Solving POMDPs by searching
in policy space, UAI 1998 (the value of a controller).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solvers.exact.pruning import prune
from lcorpp.planning.sparse import MAX_BYTES
from lcorpp.values import Array

Indices = npt.NDArray[np.intp]


class Controller(NamedTuple):
    """Plans: each begins with an action and goes on with a plan that depends on what is observed.

    actions: (n,). links: (n, O) numbers of the plans that follow.
    """

    actions: Indices
    links: Indices


class Backup(NamedTuple):
    """The value one step earlier, for all beliefs.

    vectors: (K, S). actions: (K,). witnesses: (K, S) where each was best when it was chosen.
    loss: at no belief are they further below the truth of this step.
    """

    vectors: Array
    actions: Indices
    witnesses: Array
    loss: float


class Steps:
    """T, Z and R of a problem as dense tables; rows that miss a sum of 1 by rounding are scaled.

    transition: (A, S, S). observing: (A, O, S) P(o | a, s'). reward: (A, S). discount: gamma.
    seen: for each action the observations that can follow it.

    Raises:
        ModelError: the tables are too large.
    """

    def __init__(self, pomdp: Pomdp, discount: float | None = None) -> None:
        """`discount`: another one than the model's, for a finite number of steps."""
        T, Z = pomdp.transition.dense, pomdp.observation.dense
        self.transition: Array = T / T.sum(axis=2, keepdims=True)
        self.observing = np.ascontiguousarray((Z / Z.sum(axis=2, keepdims=True)).transpose(0, 2, 1))
        self.reward = pomdp.reward
        self.discount = pomdp.discount if discount is None else discount
        self.actions, self.observations, self.states = self.observing.shape
        reached: npt.NDArray[np.bool_] = np.any(T > 0, axis=1)
        self.seen = [
            np.flatnonzero((self.observing[a] * reached[a]).any(axis=1)) for a in range(self.actions)
        ]

    @property
    def most_prunings(self) -> int:
        """How many prunings a backup of all beliefs adds up the losses of, at most."""
        return 2 * max(len(seen) for seen in self.seen)

    def backup(self, vectors: Array, beliefs: Array, *, tolerance: float, deadline: float = np.inf) -> Backup:
        """The value one step earlier: incremental pruning.

        For each action and observation the vectors are carried one step back; those of the observations are
        added up one observation after the other, each time with the sums pruned at once.

        Args:
            vectors: (K, S) the value afterwards.
            beliefs: (n, S) where some may be best.
            tolerance: what every single pruning may lose.
            deadline: on the monotonic clock.

        Raises:
            OutOfTime: the deadline passed first.
            ModelError: the sums of two sets do not fit into memory.

        Source: Cassandra, Littman and Zhang, Incremental pruning, UAI 1997, Figure 2.
        """
        found, loss = [], 0.0
        for a in range(self.actions):
            part = self._backup_action(a, vectors, beliefs, tolerance, deadline)
            found.append(part)
            loss = max(loss, part.loss)
            beliefs = np.concatenate([beliefs, part.witnesses])
        candidates = np.concatenate([part.vectors for part in found])
        actions = np.concatenate([part.actions for part in found])
        pruned = prune(candidates, beliefs, tolerance=tolerance, deadline=deadline)
        rows = pruned.rows
        return Backup(candidates[rows], actions[rows], pruned.witnesses, loss + pruned.loss)

    def _backup_action(
        self, action: int, vectors: Array, beliefs: Array, tolerance: float, deadline: float
    ) -> Backup:
        loss, parts = 0.0, []
        for o in self.seen[action]:
            carried = (self.transition[action] @ (self.observing[action, o] * vectors).T).T
            carried *= self.discount
            pruned = prune(carried, beliefs, tolerance=tolerance, deadline=deadline)
            parts.append((carried[pruned.rows], pruned.witnesses))
            loss += pruned.loss
        parts.sort(key=lambda part: len(part[0]))
        sums, witnesses = parts[0]
        for added, others in parts[1:]:
            self._check(len(sums) * len(added))
            candidates = (sums[:, None, :] + added).reshape(-1, self.states)
            near = np.concatenate([witnesses, others, beliefs])
            pruned = prune(candidates, near, tolerance=tolerance, deadline=deadline)
            sums, witnesses = candidates[pruned.rows], pruned.witnesses
            loss += pruned.loss
        return Backup(self.reward[action] + sums, np.full(len(sums), action), witnesses, loss)

    def _check(self, count: int) -> None:
        if 8 * count * self.states > MAX_BYTES:
            raise ModelError(
                f"the exact value needs sums of {count} vectors over {self.states} states, too many to hold;"
                " solve it by sarsop or perseus"
            )

    def look_ahead(self, vectors: Array, beliefs: Array) -> Controller:
        """The best plans at some beliefs.

        Args:
            vectors: (K, S) what may follow; a link is a row of it. beliefs: (n, S).
        """
        n = len(beliefs)
        best = np.full(n, -np.inf)
        actions, links = np.zeros(n, dtype=np.intp), np.zeros((n, self.observations), dtype=np.intp)
        for a in range(self.actions):
            spread = beliefs @ self.transition[a]
            value = beliefs @ self.reward[a]
            # what cannot be observed may be followed by anything: by what is best after the action alone
            follow = np.repeat((spread @ vectors.T).argmax(axis=1)[:, None], self.observations, axis=1)
            for o in self.seen[a]:
                worth = (spread * self.observing[a, o]) @ vectors.T
                leader = worth.argmax(axis=1)
                level = worth[np.arange(n), leader]
                value += self.discount * level
                possible = (spread * self.observing[a, o]).any(axis=1)
                follow[possible, o] = leader[possible]
            better = value > best
            best[better], actions[better], links[better] = value[better], a, follow[better]
        return Controller(actions, links)

    def carried(self, plans: Controller, vectors: Array) -> Array:
        """(n, S) the values of plans whose links are rows of vectors (K, S)."""
        found = np.empty((len(plans.actions), self.states))
        for a in np.unique(plans.actions):
            rows = np.flatnonzero(plans.actions == a)
            following = np.zeros((len(rows), self.states))
            for o in self.seen[a]:
                following += self.observing[a, o] * vectors[plans.links[rows, o]]
            found[rows] = self.reward[a] + self.discount * (self.transition[a] @ following.T).T
        return found

    def value(self, plans: Controller) -> Array:
        """(n, S) the values of plans whose links are among themselves, not above the truth."""
        from scipy.sparse import csr_array, eye_array, linalg

        n, S = len(plans.actions), self.states
        rows, columns, values = [], [], []
        for k in range(n):
            a = int(plans.actions[k])
            for o in self.seen[a]:
                step = self.transition[a] * self.observing[a, o]
                source, target = np.nonzero(step)
                rows.append(k * S + source)
                columns.append(int(plans.links[k, o]) * S + target)
                values.append(step[source, target])
        place = np.concatenate(rows), np.concatenate(columns)
        matrix = self.discount * csr_array((np.concatenate(values), place), shape=(n * S, n * S))
        reward = self.reward[plans.actions].reshape(-1)
        found = linalg.spsolve((eye_array(n * S) - matrix).tocsc(), reward)
        # what promises no more than its own step earns is not above the truth, however the solver rounds
        lacking = max(0.0, float((found - reward - matrix @ found).max()))
        return np.asarray(found - lacking / (1 - self.discount)).reshape(n, S)

    def blind(self) -> Array:
        """(A, S) the values of doing one action for ever."""
        every = np.arange(self.actions)
        return self.value(Controller(every, np.repeat(every[:, None], self.observations, axis=1)))
