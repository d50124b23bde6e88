"""Randomised policies: a finite-state controller whose start node is drawn once for each decision."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.errors import DataError, FileError, LcorppError, ObservationError, PolicyError
from lcorpp.files import open_atomically, read_text
from lcorpp.planning.limits.controller import Controller
from lcorpp.planning.planner import ModelPlanner
from lcorpp.planning.pomdp import SUM_TOLERANCE, Pomdp
from lcorpp.values import Array, Belief, share_frozen
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp randomised policy", 1)


@dataclass(frozen=True, eq=False)
class RandomisedPolicy:
    """A controller with the probabilities of its start nodes.

    controller: n nodes. starts: (N, S) beliefs from which decisions begin.
    probabilities: (N, n) of the start node, for each of these beliefs.
    action_names, observation_names: of the model. model: its file, for messages.
    fingerprint: `Pomdp.fingerprint` of the model.

    Raises:
        PolicyError: the shapes do not match, or a row of probabilities is not a distribution.

    Examples:
        >>> from lcorpp.planning import Controller, RandomisedPolicy
        >>> greet = Controller([0, 1], [[1], [1]])  # once, then wait
        >>> RandomisedPolicy(greet, [[1.0]], [[0.2, 0.8]], ("greet", "wait"), ("none",))
        <RandomisedPolicy: 2 nodes, 1 start, start nodes are drawn>
    """

    controller: Controller
    starts: Array
    probabilities: Array
    action_names: tuple[str, ...]
    observation_names: tuple[str, ...]
    fingerprint: str = ""
    model: str = ""

    def __post_init__(self) -> None:
        for field in ("starts", "probabilities"):
            object.__setattr__(self, field, share_frozen(getattr(self, field)))
        rows, nodes = self.probabilities.shape, len(self.controller)
        if self.starts.ndim != 2 or rows != (len(self.starts), nodes) or not len(self.starts):
            raise PolicyError(f"probabilities of shape {rows}; expected {len(self.starts)} rows of {nodes}")
        for table, what in (
            (self.probabilities, "probabilities of the start nodes"),
            (self.starts, "starts"),
        ):
            if not (table.min(initial=0) >= 0 and np.abs(table.sum(axis=1) - 1).max() <= SUM_TOLERANCE):
                raise PolicyError(f"the {what} do not sum to 1")
        if self.controller.actions.max() >= len(self.action_names):
            raise PolicyError("a node has an action that the model does not have")
        if self.controller.successors.shape[1] != len(self.observation_names):
            raise PolicyError("a node needs a successor for each observation of the model")

    @classmethod
    def of(
        cls, pomdp: Pomdp, controller: Controller, starts: Array, probabilities: Array
    ) -> RandomisedPolicy:
        """Return the policy for a model."""
        names = pomdp.actions, pomdp.observations
        return cls(controller, starts, probabilities, *names, pomdp.fingerprint, pomdp.file)

    @property
    def is_deterministic(self) -> bool:
        """Whether nothing is drawn."""
        return bool((np.count_nonzero(self.probabilities, axis=1) == 1).all())

    def __repr__(self) -> str:
        drawn = "no start is drawn" if self.is_deterministic else "start nodes are drawn"
        starts = f"{len(self.starts)} start{'s' * (len(self.starts) != 1)}"
        return f"<RandomisedPolicy: {len(self.controller)} nodes, {starts}, {drawn}>"

    def find_start(self, belief: Belief) -> int:
        """Return the index of the start that is nearest to a belief (S,), in total variation."""
        return int(np.abs(self.starts - belief).sum(axis=1).argmin())

    def draw_node(self, start: int | None, prior: Belief, rng: np.random.Generator) -> int:
        """Return the start node of a decision from a start; None takes the nearest one to the prior."""
        if start is None:
            start = self.find_start(prior)
        return int(rng.choice(len(self.controller), p=self.probabilities[start]))

    def check_model(self, pomdp: Pomdp) -> None:
        """Raise a `PolicyError` if the policy is for another model."""
        if (self.action_names, self.observation_names) != (pomdp.actions, pomdp.observations):
            raise PolicyError("the policy is for another model: its actions or observations have other names")
        if self.fingerprint and self.fingerprint != pomdp.fingerprint:
            raise PolicyError("the policy is for another model: the names are the same, but not the numbers")
        if self.starts.shape[1] != len(pomdp.states):
            raise PolicyError("the policy is for another model: the number of states differs")

    def to_json(self) -> dict[str, Any]:
        """Return the policy as JSON, with names in place of indices."""
        observations = self.observation_names
        nodes = [
            {"action": self.action_names[action], "next": dict(zip(observations, row, strict=True))}
            for action, row in zip(
                self.controller.actions.tolist(), self.controller.successors.tolist(), strict=True
            )
        ]
        starts = [
            {
                "belief": belief.tolist(),
                "nodes": {str(n): float(row[n]) for n in np.flatnonzero(row)},
            }
            for belief, row in zip(self.starts, self.probabilities, strict=True)
        ]
        return {
            **FORMAT.header,
            "model": self.model,
            "fingerprint": self.fingerprint,
            "actions": list(self.action_names),
            "observations": list(observations),
            "starts": starts,
            "nodes": nodes,
        }

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> RandomisedPolicy:
        """Return the policy of `to_json`.

        Raises:
            LookupError, TypeError, ValueError: the content has another form.
            PolicyError: it is no policy.
        """
        actions, observations = tuple(content["actions"]), tuple(content["observations"])
        nodes, starts = content["nodes"], content["starts"]
        if not starts:
            raise ValueError("it has no start")
        following = [node["next"][name] for node in nodes for name in observations]
        if not all(type(own) is int and 0 <= own < len(nodes) for own in following):
            raise ValueError(f"a node has a successor outside of the {len(nodes)} nodes")
        controller = Controller(
            np.array([actions.index(node["action"]) for node in nodes], np.intp),
            np.array([[node["next"][name] for name in observations] for node in nodes], np.intp),
        )
        probabilities = np.zeros((len(starts), len(nodes)))
        for row, start in zip(probabilities, starts, strict=True):
            for node, p in start["nodes"].items():
                if str(int(node)) != node or not 0 <= int(node) < len(nodes):
                    raise ValueError(f"node {node} is outside of the {len(nodes)} nodes")
                if type(p) not in (int, float):
                    raise ValueError(f"the probability of node {node} is {p!r}, not a number")
                row[int(node)] = p
        beliefs = np.array([start["belief"] for start in starts], np.float64)
        return cls(
            controller,
            beliefs,
            probabilities,
            actions,
            observations,
            str(content["fingerprint"]),
            str(content["model"]),
        )


def write_randomised_policy(policy: RandomisedPolicy, path: str | Path) -> None:
    """Write a randomised policy to a .json file; reading it gives the same numbers.

    Raises:
        FileError: the file cannot be written.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_limit, read_randomised_policy, solve_limited
        >>> from lcorpp.planning import write_randomised_policy
        >>> pomdp = load_domain("intention").pomdp
        >>> solution = solve_limited(pomdp, [read_limit(pomdp, "greet <= 0")], precision=1)
        >>> write_randomised_policy(solution.policy, "polite.json")
        >>> len(read_randomised_policy("polite.json", pomdp).starts)
        1
    """
    text = json.dumps(policy.to_json(), indent=1)
    with open_atomically(path) as file:
        file.write(f"{text}\n".encode())


def read_randomised_policy(path: str | Path, pomdp: Pomdp) -> RandomisedPolicy:
    """Read the randomised policy of a model.

    Raises:
        FileError: the file cannot be read.
        PolicyError: it is no such policy, or the policy of another model.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_limit, read_randomised_policy, solve_limited
        >>> from lcorpp.planning import write_randomised_policy
        >>> pomdp = load_domain("intention").pomdp
        >>> solution = solve_limited(pomdp, [read_limit(pomdp, "greet <= 0")], precision=1)
        >>> write_randomised_policy(solution.policy, "polite.json")
        >>> len(read_randomised_policy("polite.json", pomdp).controller) == len(solution.policy.controller)
        True
    """
    text = read_text(path)
    try:
        policy = RandomisedPolicy.from_json(FORMAT.read(text))
        policy.check_model(pomdp)
    except FileError:
        raise
    except (DataError, PolicyError) as error:
        raise PolicyError(f"{path}: {error}") from None
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError, LcorppError) as error:
        raise PolicyError(f"{path}: it is damaged: {error}") from None
    return policy


class RandomisedPlanner(ModelPlanner):
    """The planner of one decision by a randomised policy: it draws a start node, then follows the controller.

    Its beliefs are those of the model, and are for information only.

    Args:
        policy: for the model. rng: draws the start node, once.
        start: index of the start of the policy; by default the nearest to the first belief.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import RandomisedPlanner, read_limit, solve_limited
        >>> pomdp = load_domain("intention").pomdp
        >>> solution = solve_limited(pomdp, [read_limit(pomdp, "greet,move_forward <= 0")], precision=1)
        >>> RandomisedPlanner(solution.policy, pomdp, np.random.default_rng(0)).action(pomdp.start)
        'turn'
    """

    def __init__(
        self, policy: RandomisedPolicy, pomdp: Pomdp, rng: np.random.Generator, start: int | None = None
    ) -> None:
        policy.check_model(pomdp)
        self.policy, self.pomdp = policy, pomdp
        self._rng, self._start = rng, start
        self._node: int | None = None

    def action(self, belief: Belief) -> str:
        """Return the action of the present node; the first belief (S,) selects the start."""
        if self._node is None:
            self._node = self.policy.draw_node(self._start, belief, self._rng)
        return self.policy.action_names[int(self.policy.controller.actions[self._node])]

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief (S,) after the node's action and an observation, and go to the next node.

        Raises:
            ModelError: a name is unknown.
            ObservationError: the observation is impossible.
        """
        after = super().update(belief, action, observation)
        if self._node is None:
            raise ObservationError("an observation before the first action of the decision")
        seen = self.pomdp.observation_index(observation)
        self._node = int(self.policy.controller.successors[self._node, seen])
        return after
