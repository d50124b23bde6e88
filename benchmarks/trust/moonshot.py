"""The remaining regret of trust if half of the knowledge is wrong and the noise unknown, and its causes.

    OMP_NUM_THREADS=1 python benchmarks/trust/moonshot.py [--streams 48] [--people 2000] [--wrong 6]
        [--seed 0] [--jobs 2] [--out TABLE.md]

Each stream has its own world: some of the 12 numbers of the robot's knowledge, drawn at random, are replaced
by others (uniform in .05 to .95 and at least .2 away; all values of a variable keep at least .05), and the
rate of wrong answers is uniform in .1 to .3, where the robot's model states .1 and .2. Nobody labels
anything. The omniscient robot is LCORPP with the true numbers and noise.

At snapshots between two people, what trust has learnt is kept fixed, and exact mean returns give its regret
without sampling noise, and the parts of it:

- prior: of the mixture's prior beliefs, with true noise and the best policy for it;
- noise: of the estimated noise, with true priors and the best policy for that estimate;
- policy: of the policy in use instead of that;
- together: what the three cost more, or less, at the same time;
- asking: the difference of what asked people bring to what was expected of them without.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import strategies
from lcorpp.domains import Domain
from lcorpp.files import write_atomically
from lcorpp.planning import Planner, Pomdp
from lcorpp.planning.planner import TransferPlanner
from lcorpp.protocols import Reasoner as ReasonerProtocol
from lcorpp.reasoning import Reasoner
from lcorpp.trust import Trust
from lcorpp.values import Array
from worlds import (
    BASELINES,
    RIGHT,
    Numbers,
    World,
    make_domain,
    meet_people,
    score_exactly,
    solve_precisely,
)

NOISE_RANGE = 0.1, 0.3
MIN_NUMBER, MIN_CHANGE = 0.05, 0.2
FIRST_PERSON, MAX_REGRET = 500, 1.6
"""The regret counts from this person on; the aim is 1% of the span of the rewards."""

SNAPSHOT_EVERY = 500
"""Number of people from one snapshot to the next. Between two, the regret is taken to be linear."""

BELIEF_DIGITS = 4
"""Of the beliefs in exact scores of a policy: without effect on the first two digits of the regret."""

PARTS = ("prior", "noise", "policy", "together", "asking")
LCORPP = strategies(["LCORPP"])


def draw_numbers(wrong: int, rng: np.random.Generator) -> Numbers:
    """Return the right numbers with `wrong` of the 12 replaced."""
    right = np.array([[*RIGHT[0][i], RIGHT[1][i], RIGHT[2][i]] for i in RIGHT[0]])
    while True:
        numbers = right.copy()
        places = rng.permutation(right.size)[:wrong]
        numbers.flat[places] = rng.uniform(MIN_NUMBER, 1 - MIN_NUMBER, wrong)
        is_far = np.abs(numbers - right).flat[places] >= MIN_CHANGE
        if is_far.all() and (numbers[:, :2].sum(axis=1) <= 1 - MIN_NUMBER).all():
            rows = dict(zip(RIGHT[0], numbers.tolist(), strict=True))
            times = {identity: (row[0], row[1]) for identity, row in rows.items()}
            return times, {i: row[2] for i, row in rows.items()}, {i: row[3] for i, row in rows.items()}


def run_stream(number: int, wrong: int, people: int, seed: int) -> dict[str, float]:
    """Return the noise of a stream, its regret from person `FIRST_PERSON` on, and the parts of it."""
    began, rng = process_time(), np.random.default_rng([seed, number])
    world = World(draw_numbers(wrong, rng), rng.uniform(*NOISE_RANGE))
    domain, truth = make_domain(world), make_domain(world, omniscient=True)
    stated = solve_precisely(domain)
    baselines = score_exactly(domain, Reasoner(domain.program), stated, strategies(BASELINES))
    scorer = Scorer(truth)
    trust = set_up_trust(domain, Reasoner(domain.program), stated)
    returns, snapshots = np.zeros(people), list[dict[str, float]]()
    for i, return_ in enumerate(meet_people(domain, trust, people, rng)):
        returns[i] = return_
        if i + 1 >= FIRST_PERSON and (i + 1 - FIRST_PERSON) % SNAPSHOT_EVERY == 0:
            snapshots.append(scorer.take_apart(trust))
    late, is_asked = np.arange(people) >= FIRST_PERSON, np.arange(people) % trust.options.ask_every == 0
    parts = {
        name: float(np.trapezoid([own[name] for own in snapshots]) / (len(snapshots) - 1))
        for name in snapshots[0]
    }
    expected = scorer.optimal - sum(parts.values())
    parts["asking"] = (expected - returns[late & is_asked].mean()) / trust.options.ask_every
    return {
        "level": world.noise,
        "regret": sum(parts.values()),
        "simulated": scorer.optimal - returns[late].mean(),
        "best of four": scorer.optimal - max(baselines.values()),
        **parts,
        "cpu": process_time() - began,
    }


class RoundingPlanner(Planner):
    """A planner with rounded beliefs, of which different answers reach fewer."""

    def update_many(self, beliefs: Array, actions: Sequence[str], observations: Sequence[str]) -> Array:
        """Return the beliefs (n, S) after an action and an observation in each of n beliefs."""
        return np.round(super().update_many(beliefs, actions, observations), BELIEF_DIGITS)


class Scorer:
    """Takes the regret of trust apart, by exact mean returns in a world.

    Args:
        truth: the domain of the omniscient robot. optimal: its mean return.
    """

    def __init__(self, truth: Domain) -> None:
        self._truth, self._reasoner, self._planner = truth, Reasoner(truth.program), solve_precisely(truth)
        self.optimal = self._score(self._reasoner, self._planner)
        self._solved: dict[bytes, Planner] = {}

    def take_apart(self, trust: Trust) -> dict[str, float]:
        """Return the regret of trust, without asking, as parts that sum to it."""
        assert isinstance(trust.planner, Planner | TransferPlanner)
        model = trust.planner.pomdp
        used = RoundingPlanner(replace(trust.planner.policy, fingerprint=""), model)
        estimated = self._solve(model)
        prior = self.optimal - self._score(trust, self._planner)
        hearing = self._score(self._reasoner, estimated)
        noise = self.optimal - hearing
        policy = hearing - self._score(self._reasoner, used)
        together = self.optimal - self._score(trust, used) - prior - noise - policy
        return {"prior": prior, "noise": noise, "policy": policy, "together": together}

    def _score(self, reasoner: ReasonerProtocol, planner: Planner) -> float:
        return score_exactly(self._truth, reasoner, planner, LCORPP)["LCORPP"]

    def _solve(self, model: Pomdp) -> Planner:
        """Return the best planner for an estimated model."""
        key = model.observation.dense.tobytes()
        if key not in self._solved:
            domain = replace(self._truth, planning=replace(self._truth.planning, model=model))
            self._solved[key] = RoundingPlanner(solve_precisely(domain).policy, model)
        return self._solved[key]


def describe(results: Sequence[Mapping[str, float]], options: str) -> str:
    """Return the table: mean regret and its parts, by noise."""
    names = ["regret", "simulated", *PARTS, "best of four"]
    noise = np.array([result["level"] for result in results])
    lines = [
        f"{options}; {sum(result['cpu'] for result in results):.0f} s of CPU",
        "",
        f"| noise | streams | {' | '.join(names)} | at most {MAX_REGRET:g} |",
        "|---" * (len(names) + 3) + "|",
    ]
    edges = np.linspace(*NOISE_RANGE, 5)
    rows = [(f"{a:.2f} to {b:.2f}", (noise >= a) & (noise < b)) for a, b in pairwise(edges)]
    for label, chosen in [*rows, ("all", noise > 0)]:
        if chosen.any():
            own = [result for result, is_in in zip(results, chosen, strict=True) if is_in]
            columns = [np.array([result[name] for result in own]) for name in names]
            spread = [column.std(ddof=1) / len(own) ** 0.5 if len(own) > 1 else np.nan for column in columns]
            cells = [f"{c.mean():.2f} ± {s:.2f}" for c, s in zip(columns, spread, strict=True)]
            share = f"{np.mean(columns[0] <= MAX_REGRET):.0%}"
            lines.append(f"| {label} | {len(own)} | {' | '.join(cells)} | {share} |")
    return "\n".join(lines) + "\n"


def main(
    streams: Annotated[int, typer.Option(min=1)] = 48,
    people: Annotated[int, typer.Option(min=FIRST_PERSON + SNAPSHOT_EVERY)] = 2000,
    wrong: Annotated[int, typer.Option(min=0, max=12, help="Wrong numbers of the knowledge.")] = 6,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: Annotated[int, typer.Option(min=1)] = 1,
    out: Annotated[Path | None, typer.Option(dir_okay=False)] = None,
) -> None:
    """Simulate the streams; print the table, and write it."""
    calls = (delayed(run_stream)(number, wrong, people, seed) for number in range(streams))
    results = list(Parallel(n_jobs=jobs, verbose=5)(calls))
    options = f"{streams} streams of {people} people, {wrong} numbers wrong, seed {seed}"
    table = describe(results, options)
    print(table)
    if out is not None:
        write_atomically(out, table.encode())


if __name__ == "__main__":
    typer.run(main)
