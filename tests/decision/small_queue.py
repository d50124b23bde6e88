"""The exact small MDP of several people: people of C kinds come, wait, are attended to and leave.

Arrivals are Poisson, waiting and decisions exponential; who finds the corridor full does not come in. A state
is (n, c): n[k] people of kind k wait, the robot attends to one of kind c, or to nobody (-1).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from lcorpp.decision.attention import Candidate, choose_candidate

State = tuple[tuple[int, ...], int]
Policy = dict[tuple[int, ...], int]
"""Waiting people -> the kind that is attended to next."""


@dataclass(frozen=True)
class SmallQueue:
    """arrivals, hazards: (C,) per second. values: (C,) of a decision. seconds: (C,). room: people at most."""

    arrivals: tuple[float, ...]
    values: tuple[float, ...]
    seconds: tuple[float, ...]
    hazards: tuple[float, ...]
    room: int = 5

    @cached_property
    def kinds(self) -> range:
        return range(len(self.values))

    @cached_property
    def waiting(self) -> list[tuple[int, ...]]:
        counts = product(range(self.room + 1), repeat=len(self.values))
        return [n for n in counts if sum(n) <= self.room]

    @cached_property
    def states(self) -> list[State]:
        busy = [(n, c) for n in self.waiting for c in self.kinds if sum(n) < self.room]
        return [((0,) * len(self.values), -1), *busy]

    def list_transitions(self, state: State, policy: Policy) -> list[tuple[float, State, float]]:
        """(rate, next state, value) of all that can happen."""
        n, c = state

        def begin(waiting: tuple[int, ...], rate: float) -> tuple[float, State, float]:
            if not sum(waiting):
                return rate, (waiting, -1), 0.0
            kind = policy[waiting]
            return rate, (change(waiting, kind, -1), kind), self.values[kind]

        moves = []
        for kind in self.kinds:
            more = change(n, kind, 1)
            if c < 0:
                moves.append(begin(more, self.arrivals[kind]))
            elif sum(n) + 1 < self.room:
                moves.append((self.arrivals[kind], (more, c), 0.0))
            if n[kind]:
                moves.append((n[kind] * self.hazards[kind], (change(n, kind, -1), c), 0.0))
        if c >= 0:
            moves.append(begin(n, 1 / self.seconds[c]))
        return moves

    def evaluate(self, policy: Policy) -> tuple[float, dict[State, float]]:
        """Return the value per second in the long run, and the relative values of the states."""
        index = {state: i for i, state in enumerate(self.states)}
        size = len(index)
        equations, values = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
        for state, i in index.items():
            for rate, after, value in self.list_transitions(state, policy):
                equations[i, i] += rate
                equations[i, index[after]] -= rate
                values[i] += rate * value
        equations[:size, size] = 1.0  # the value per second
        equations[size, 0] = 1.0
        solution = np.linalg.solve(equations, values)
        return float(solution[size]), dict(zip(index, solution.tolist(), strict=False))

    def solve(self, policy: Policy) -> float:
        """Return the value per second of the best policy, by policy iteration."""
        while True:
            gain, relative = self.evaluate(policy)
            better = dict(policy)
            for n in policy:
                worth = {c: self.values[c] + relative[change(n, c, -1), c] for c in self.kinds if n[c]}
                best = max(worth, key=worth.__getitem__)
                if worth[best] > worth[policy[n]] + 1e-9:
                    better[n] = best
            if better == policy:
                return gain
            policy = better

    def make_policy(self, choose: Callable[[list[Candidate]], object]) -> Policy:
        """Return the policy of a rule that chooses among the people who wait."""
        policy = {}
        for n in self.waiting:
            people = [
                Candidate(kind, value, value, seconds, hazard)
                for kind, value, seconds, hazard in zip(
                    self.kinds, self.values, self.seconds, self.hazards, strict=True
                )
                for _ in range(n[kind])
            ]
            if people:
                policy[n] = choose(people)
        return policy

    def find_share(self, policy: Policy) -> float:
        """Return q: the share of the people who come, by value, to whom the robot attends."""
        came = sum(rate * value for rate, value in zip(self.arrivals, self.values, strict=True))
        return self.evaluate(policy)[0] / came


def change(n: tuple[int, ...], kind: int, by: int) -> tuple[int, ...]:
    return (*n[:kind], n[kind] + by, *n[kind + 1 :])


def choose_most_probable(candidates: list[Candidate]) -> object:
    return max(candidates, key=lambda each: each.probability).person


def index_policy(queue: SmallQueue, rounds: int = 6) -> tuple[Policy, float]:
    """Return the policy of the index with the share q that it leads to, and q."""
    share = 0.5
    for _ in range(rounds):
        policy = queue.make_policy(lambda people, q=share: choose_candidate(people, share=q))
        share = 0.5 * (share + queue.find_share(policy))
    return policy, share


def draw_queue(
    rng: np.random.Generator,
    *,
    equal_hazards: bool,
    equal_seconds: bool,
    kinds: int = 2,
    min_value: float = 0.1,
) -> SmallQueue:
    """Draw a queue, from light load to three times what the robot can do; stays of 8 to 120 s."""
    values = rng.uniform(min_value, 0.95, kinds)
    seconds = np.full(kinds, rng.uniform(4, 15)) if equal_seconds else rng.uniform(2, 15, kinds)
    hazards = np.exp(-rng.uniform(np.log(8), np.log(120), kinds))
    hazards = np.full(kinds, hazards[0]) if equal_hazards else hazards
    load, shares = np.exp(rng.uniform(np.log(0.3), np.log(3))), rng.dirichlet(np.full(kinds, 2.0))
    arrivals = shares * load / (shares @ seconds)
    return SmallQueue(*(tuple(part.tolist()) for part in (arrivals, values, seconds, hazards)))
