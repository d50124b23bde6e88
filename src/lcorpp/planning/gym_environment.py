"""A POMDP as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.arguments import check_type
from lcorpp.planning.belief import check_belief, update
from lcorpp.planning.evaluation.mdp import zero_reward_states
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
"""The name in Gymnasium's registry: `gymnasium.make(ID, pomdp=...)`."""

NO_STEP = "no step yet"
"""What `render` returns after a reset."""


class PomdpEnvironment(gymnasium.Env):  # type: ignore[misc]
    """A Gymnasium environment of a POMDP with S states, A actions and O observations.

    Actions are integers below A, observations integers below O; `reset` returns the integer O, for no
    observation. The reward of a step is the model's expected reward of the action in the hidden state, not
    discounted. An episode terminates in a state from which only zero rewards are reachable. It is never
    truncated; `gymnasium.wrappers.TimeLimit` does that.

    The info of each step contains
        belief: (S,) the belief after all observations so far, by Bayes' rule from the start belief.
        state: the index of the hidden state, for scores and tests; an agent must not use it.

    Args:
        pomdp: the model.
        start: (S,) belief at the start of an episode; the model's own when None.
        render_mode: "ansi" makes `render` return the last step as a line of text.

    Raises:
        ModelError: `start` is not a distribution over the states, or the render mode is unknown.
    """

    metadata = {"render_modes": ["ansi"], "render_fps": 4}  # noqa: RUF012

    def __init__(
        self, pomdp: Pomdp, start: npt.ArrayLike | None = None, render_mode: str | None = None
    ) -> None:
        if render_mode not in (None, "ansi"):
            raise ModelError(f"the render mode is None or 'ansi', not {render_mode!r}")
        check_type("pomdp", pomdp, Pomdp)
        self.pomdp, self.render_mode = pomdp, render_mode
        self.start = check_belief(pomdp, pomdp.start if start is None else start)
        self.action_space = Discrete(len(pomdp.actions))
        self.observation_space = Discrete(len(pomdp.observations) + 1)
        self._absorbing = zero_reward_states(pomdp)
        begin = SparseBeliefs.of(self.start[None])
        self._start, self._transition, self._observation = (
            InverseCdfSampler(rows.begins, columns, values)
            for rows, columns, values in (
                (begin, begin.states, begin.weights),
                (pomdp.transition, pomdp.transition.columns, pomdp.transition.values),
                (pomdp.observation, pomdp.observation.columns, pomdp.observation.values),
            )
        )
        self._state, self._belief, self._last_step = -1, self.start, NO_STEP

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.int64, dict[str, Any]]:
        """Begin an episode; return the integer O (no observation) and the info. `options` must be empty.

        Raises:
            ModelError: `options` is not empty.
        """
        super().reset(seed=seed)
        if options:
            raise ModelError(f"unknown options {sorted(options)}: the environment of a POMDP has none")
        self._state = self._draw(self._start, 0)
        self._belief = self.start
        self._last_step = NO_STEP
        return np.int64(len(self.pomdp.observations)), self._make_info()

    def step(self, action: np.int64) -> tuple[np.int64, float, bool, bool, dict[str, Any]]:
        """Take an action; return observation, reward, whether the episode terminated, False, and the info.

        Raises:
            ModelError: the action is unknown, or `reset` was never called.
            ObservationError: rounding has removed the hidden state from the belief; the message names it.
        """
        pomdp = self.pomdp
        if self._state < 0:
            raise ModelError("call reset before the first step")
        if not self.action_space.contains(action):
            raise ModelError(
                f"an action is a whole number from 0 to {len(pomdp.actions) - 1}, not {action!r}"
            )
        a, S = int(action), len(pomdp.states)
        reward = float(pomdp.reward[a, self._state])
        self._state = self._draw(self._transition, a * S + self._state)
        observation = self._draw(self._observation, a * S + self._state)
        self._belief = update(pomdp, self._belief, a, observation)
        self._last_step = (
            f"{pomdp.actions[a]}: reward {reward:g}, observed {pomdp.observations[observation]},"
            f" now in {pomdp.states[self._state]}"
        )
        return np.int64(observation), reward, bool(self._absorbing[self._state]), False, self._make_info()

    def render(self) -> str | None:
        """Return the last step as text if the render mode is "ansi"."""
        return self._last_step if self.render_mode == "ansi" else None

    def _draw(self, sampler: InverseCdfSampler, row: int) -> int:
        return int(sampler.draw(np.array([row]), np.array([self.np_random.random()]))[0])

    def _make_info(self) -> dict[str, Any]:
        belief: Belief = self._belief.copy()
        return {"belief": belief, "state": self._state}


if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point=PomdpEnvironment)
