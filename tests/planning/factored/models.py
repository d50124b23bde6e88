"""Factored models that several tests share."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from lcorpp.planning import Factored, Table, Variable, cpt

# The 1 x 3 rock sample of PomdpX's documentation: the exit is east of the middle, the rock in the west.
ROVER: dict[str, object] = {
    "states": {"rover": "left middle exit", "rock": "good bad"},
    "observed": "rover",
    "actions": "west east check sample",
    "observations": {"sensor": "good bad"},
    "start": {"rover": "middle", "rock": "uniform"},
    "transition": {
        "rover": cpt(
            "action rover",
            {
                "* *": "same",
                "west left": "exit",
                "west middle": "left",
                "east left": "middle",
                "east middle": "exit",
                "sample middle": "exit",
            },
        ),
        "rock": cpt("action rover rock", {"* * *": "same", "sample left *": "bad"}),
    },
    "observation": cpt(
        "action rover' rock'",
        {
            "* * *": "good",
            "check left -": [[1, 0], [0, 1]],
            "check middle -": [[0.8, 0.2], [0.2, 0.8]],
        },
    ),
    "reward": {
        "moving": cpt("action rover", {"east middle": 10, "west left": -100}),
        "sampling": cpt(
            "action rover rock",
            {"sample middle *": -100, "sample left good": 10, "sample left bad": -10},
        ),
    },
    "discount": 0.95,
}


def rover(**changes: object) -> Factored:
    """Return the rover problem with some changes."""
    return Factored.of(**{**ROVER, **changes})  # type: ignore[arg-type]


@st.composite
def _distribution(draw: st.DrawFn, size: int) -> list[float]:
    weights = draw(st.lists(st.integers(0, 4), min_size=size, max_size=size).filter(any))
    return (np.array(weights) / sum(weights)).tolist()


@st.composite
def _tables(
    draw: st.DrawFn, children: list[str], others: list[str], sizes: dict[str, int]
) -> tuple[Table, ...]:
    """Draw a table for each child, or one for two of them, that depends on others and previous children."""
    left, before, tables = list(children), [], []
    while left:
        own = [left.pop(0) for _ in range(draw(st.integers(1, min(2, len(left)))))]
        parents = (
            draw(st.lists(st.sampled_from([*others, *before]), unique=True, max_size=3))
            if others or before
            else []
        )
        shape = [sizes[name] for name in (*parents, *own)]
        width = int(np.prod(shape[len(parents) :]))
        rows = [draw(_distribution(width)) for _ in range(int(np.prod(shape)) // width)]
        tables.append(Table.of(tuple(parents), tuple(own), np.reshape(rows, shape)))
        before += own
    return tuple(draw(st.permutations(tables)))


@st.composite
def factored_models(draw: st.DrawFn) -> Factored:
    """Draw small random factored problems with many zeros."""

    def variables(letter: str, least: int, most: int) -> list[Variable]:
        return [
            Variable(
                f"{letter}{i}",
                tuple(f"{letter}{j}" for j in range(draw(st.integers(1, 3)))),
                observed=letter == "x" and draw(st.booleans()),
            )
            for i in range(draw(st.integers(least, most)))
        ]

    states, actions, looks = variables("x", 1, 3), variables("a", 1, 2), variables("o", 0, 2)
    sizes = {v.name: len(v.values) for v in (*states, *actions, *looks)}
    sizes |= {v.name + "'": len(v.values) for v in states}
    before, acts, seen = ([v.name for v in vs] for vs in (states, actions, looks))
    after = [name + "'" for name in before]
    rewards = {}
    for i in range(draw(st.integers(0, 2))):
        parents = draw(st.lists(st.sampled_from([*before, *after, *acts, *seen]), unique=True, max_size=3))
        shape = [sizes[name] for name in parents]
        count = int(np.prod(shape, dtype=int))
        values = draw(st.lists(st.integers(-3, 3), min_size=count, max_size=count))
        rewards[f"r{i}"] = Table.of(tuple(parents), (), np.reshape(np.array(values) / 3, shape))
    return Factored(
        tuple(states),
        tuple(actions),
        tuple(looks),
        draw(_tables(before, [], sizes)),
        draw(_tables(after, [*acts, *before], sizes)),
        draw(_tables(seen, [*acts, *after], sizes)),
        rewards,
        draw(st.sampled_from([0.5, 0.95])),
    )
