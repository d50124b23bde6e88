"""The index of attention in exact small models: its gain over the highest posterior first, and the largest.

    OMP_NUM_THREADS=1 python benchmarks/robot/attention_models.py [--models 150] [--seed 2]

Each row is a family of random models (`tests/decision/small_queue.py`), each column an exponent of q.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.decision.small_queue import Policy, SmallQueue, choose_most_probable, draw_queue

from lcorpp.decision.attention import EXPONENT, choose_candidate

EXPONENTS, ROUNDS = (1, 2, 3, 4), 6
TWO_KINDS = partial(draw_queue, equal_hazards=False, equal_seconds=True)
FAMILIES = {
    "two kinds": TWO_KINDS,
    "equal hazards": partial(TWO_KINDS, equal_hazards=True),
    "close values, .5 to .95": partial(TWO_KINDS, min_value=0.5),
    "three kinds": partial(TWO_KINDS, kinds=3),
    "unequal durations": partial(TWO_KINDS, equal_seconds=False),
}


def find_policy(queue: SmallQueue, exponent: float) -> Policy:
    """Return the policy of the index with another exponent, and the share that it leads to."""
    share = 0.5
    for _ in range(ROUNDS):
        weight = share ** (exponent / EXPONENT)
        policy = queue.make_policy(partial(choose_candidate, share=weight))
        share = 0.5 * (share + queue.find_share(policy))
    return policy


def main(
    models: Annotated[int, typer.Option(min=2, help="In each family.")] = 150,
    seed: Annotated[int, typer.Option(min=0)] = 2,
) -> None:
    """Print a row for each family: mean gain, the worst model, and how many models are below."""
    titles = " | ".join(f"w = q^{exponent}" for exponent in EXPONENTS)
    rows = [f"| models | optimal policy | {titles} |", "|---" * (len(EXPONENTS) + 2) + "|"]
    for name, draw in FAMILIES.items():
        rng, gains = np.random.default_rng(seed), list[list[float]]()
        for _ in range(models):
            queue = draw(rng)
            base_policy = queue.make_policy(choose_most_probable)
            base, _ = queue.evaluate(base_policy)
            values = [queue.solve(base_policy)]
            values += [queue.evaluate(find_policy(queue, exponent))[0] for exponent in EXPONENTS]
            gains.append([value / base - 1 for value in values])
        optimal, *columns = np.array(gains).T
        cells = [
            f"{own.mean():+.3%}, worst {min(own.min(), 0.0):.2%}, {(own < -1e-9).sum()} below"
            for own in columns
        ]
        rows.append(f"| {name} | {optimal.mean():+.3%} | {' | '.join(cells)} |")
    Console().print("\n".join(rows), markup=False, soft_wrap=True)


if __name__ == "__main__":
    typer.run(main)
