"""The choice of the look-ahead by what it has gained."""

from __future__ import annotations

from math import log
from types import SimpleNamespace

import pytest

from lcorpp.planning.sarsop.look_ahead import LOOK_AHEADS, MAX_DOUBLINGS, MIN_WORK_SHARE, LookAhead


class FakeSearch:
    """A search whose paths of a look-ahead multiply the gap by a factor and have as many nodes, plus one."""

    def __init__(self, factors: dict[int, float], grows: bool = True) -> None:
        self.bounds = SimpleNamespace(
            pomdp=SimpleNamespace(discount=0.9),
            tree=SimpleNamespace(node_count=1, vector_count=1, point_count=1),
        )
        self.gap, self.trials, self.factors, self.grows = 100.0, 0, factors, grows
        self.steps: list[int] = []

    def sample(self, share: float, max_depth: int, function: object) -> int:
        steps = round(log(share) / log(0.9))
        self.steps.append(steps)
        self.gap *= self.factors.get(steps, 1.0)
        self.bounds.tree.node_count += self.grows
        self.trials += 1
        return steps + 1


def run(search: FakeSearch, trials: int) -> list[int]:
    paths = LookAhead(search)  # type: ignore[arg-type]
    for _ in range(trials):
        paths.sample()
    return search.steps


@pytest.mark.parametrize("better", LOOK_AHEADS)
def test_the_look_ahead_that_gains_more_gets_most_of_the_work(better):
    steps = run(FakeSearch({better: 0.99}), 400)
    assert all(
        first == second for first, second in zip(steps[::2], steps[1::2], strict=True)
    )  # two at a time
    for k in LOOK_AHEADS:
        share = k * steps[100:].count(k) / sum(steps[100:])
        assert share >= MIN_WORK_SHARE / 2
        assert (share > 0.5) == (k == better)


def test_it_follows_a_change_of_what_gains():
    search = FakeSearch({LOOK_AHEADS[0]: 0.99})
    paths = LookAhead(search)  # type: ignore[arg-type]
    for _ in range(200):
        paths.sample()
    search.factors = {LOOK_AHEADS[1]: 0.99}
    before = len(search.steps)
    for _ in range(200):
        paths.sample()
    later = search.steps[before + 60 :]
    assert LOOK_AHEADS[1] * later.count(LOOK_AHEADS[1]) > 0.5 * sum(later)


def test_it_looks_further_while_nothing_changes():
    steps = run(FakeSearch({}, grows=False), 30)
    assert max(steps) >= min(LOOK_AHEADS) * 2**MAX_DOUBLINGS
    moving = run(FakeSearch({}), 30)
    assert set(moving) == set(LOOK_AHEADS)
    search = FakeSearch({}, grows=False)
    paths = LookAhead(search)  # type: ignore[arg-type]
    for _ in range(10):
        paths.sample()
    assert search.steps[-1] not in LOOK_AHEADS
    search.bounds.tree.vector_count += 1  # something changes at last
    paths.sample()
    assert search.steps[-1] in LOOK_AHEADS
