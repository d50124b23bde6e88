"""Any model as an environment of Gymnasium, for whatever learns or plans against one."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief, update
from lcorpp.planning.evaluation.absorbing import zero_reward_states
from lcorpp.planning.evaluation.sampling import InverseCdfSampler
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Belief

try:
    import gymnasium
    from gymnasium.spaces import Discrete
except ImportError:
    raise ModelError(
        "an environment needs gymnasium, which is not installed: pip install 'lcorpp[gym]'"
    ) from None


ID = "lcorpp/Pomdp-v0"
"""The name to make one by: `gymnasium.make(ID, pomdp=...)`."""


class PomdpEnvironment(gymnasium.Env):  # type: ignore[misc]
    """A POMDP with S states, A actions and O observations, acted in from the outside.

    Actions are numbers below A, and observations numbers below O; `reset` observes nothing, which is told
    by the number O. The reward of a step is the model's expected one, of the action in the hidden state it
    was taken in; it is not discounted. An episode terminates in a state from which no reward but 0 can be
    reached, and is never truncated here: `gymnasium.wrappers.TimeLimit` does that.

    The info of each step holds
        belief: (S,) of one who saw what was observed, by Bayes' rule from the start belief.
        state: the index of the hidden state. An agent must not look; a score or a test may.

    Args:
        pomdp: the world.
        start: (S,) where episodes begin; the model's own when None.
        render_mode: "ansi" makes `render` tell the last step in a line of text.

    Raises:
        ModelError: `start` is not a distribution over the states, or there is no such render mode.
    """

    metadata = {"render_modes": ["ansi"], "render_fps": 4}  # noqa: RUF012

    def __init__(
        self, pomdp: Pomdp, start: npt.ArrayLike | None = None, render_mode: str | None = None
    ) -> None:
        if render_mode not in (None, "ansi"):
            raise ModelError(f"the render mode is None or 'ansi', not {render_mode!r}")
        self.pomdp, self.render_mode = pomdp, render_mode
        self.start = check_belief(pomdp, pomdp.start if start is None else start)
        self.action_space = Discrete(len(pomdp.actions))
        self.observation_space = Discrete(len(pomdp.observations) + 1)
        self._over = zero_reward_states(pomdp)
        begin = SparseBeliefs.of(self.start[None])
        self._start, self._transition, self._observation = (
            InverseCdfSampler(rows.begins, columns, values)
            for rows, columns, values in (
                (begin, begin.states, begin.weights),
                (pomdp.transition, pomdp.transition.columns, pomdp.transition.values),
                (pomdp.observation, pomdp.observation.columns, pomdp.observation.values),
            )
        )
        self._state, self._belief, self._told = -1, self.start, "nothing has happened"

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.int64, dict[str, Any]]:
        """Begin an episode: the number O, for nothing observed, and the info. `options` has no keys.

        Raises:
            ModelError: there are options.
        """
        super().reset(seed=seed)
        if options:
            raise ModelError(f"an environment of a POMDP has no options, and so not {sorted(options)}")
        self._state = self._drawn(self._start, 0)
        self._belief = self.start
        self._told = "nothing has happened"
        return np.int64(len(self.pomdp.observations)), self._info()

    def step(self, action: np.int64) -> tuple[np.int64, float, bool, bool, dict[str, Any]]:
        """Act: the observation, the reward, whether all is over, False, and the info.

        Raises:
            ModelError: there is no such action, or `reset` was never called.
            ObservationError: the belief has lost the hidden state to rounding; it is named.
        """
        pomdp = self.pomdp
        if self._state < 0:
            raise ModelError("an environment is reset before its first step")
        if not self.action_space.contains(action):
            raise ModelError(
                f"an action is a whole number from 0 to {len(pomdp.actions) - 1}, not {action!r}"
            )
        a, S = int(action), len(pomdp.states)
        reward = float(pomdp.reward[a, self._state])
        self._state = self._drawn(self._transition, a * S + self._state)
        observation = self._drawn(self._observation, a * S + self._state)
        self._belief = update(pomdp, self._belief, a, observation)
        self._told = (
            f"{pomdp.actions[a]}: reward {reward:g}, observed {pomdp.observations[observation]},"
            f" now in {pomdp.states[self._state]}"
        )
        return np.int64(observation), reward, bool(self._over[self._state]), False, self._info()

    def render(self) -> str | None:
        """The last step in words, where the render mode is "ansi"."""
        return self._told if self.render_mode == "ansi" else None

    def _drawn(self, draws: InverseCdfSampler, row: int) -> int:
        return int(draws.draw(np.array([row]), np.array([self.np_random.random()]))[0])

    def _info(self) -> dict[str, Any]:
        belief: Belief = self._belief.copy()
        return {"belief": belief, "state": self._state}


if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point=PomdpEnvironment)
