"""Decision diagrams: levels, arcs and their outcomes."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from lcorpp.reasoning import Reasoner, parse_plog
from lcorpp.reasoning.circuit.trellis import build_trellis
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions.transition_system import build_transition_system

COINS = parse_plog(
    "coin = {heads, tails}. c1, c2 : coin. random(c1). random(c2). :- c1=tails, c2=tails.", file="coins.plog"
)
HALF = Fraction(1, 2)


def test_two_coins_that_do_not_both_show_tails():
    """The example of the module's docstring."""
    trellis = build_trellis(build_transition_system(ground_program(COINS, {})))
    assert trellis.level_sizes == [1, 2, 1]
    assert trellis.arcs == [([0, 0], [0, 1], [0, 1]), ([0, 0, 1], [0, 0, 0], [2, 3, 2])]
    assert trellis.outcomes == [((0,), HALF), ((1,), HALF), ((0,), HALF), ((1,), HALF)]
    assert repr(trellis) == "Trellis(coins.plog: 2 steps, 4 states, 5 arcs)"


def test_sums_over_paths_are_sums_over_worlds():
    worlds = WorldQueries(build_trellis(build_transition_system(ground_program(COINS, {}))))
    assert worlds.count() == 3
    assert worlds.compute_exact_weights("c1", {}) == {"heads": HALF, "tails": Fraction(1, 4)}
    assert worlds.compute_float_weights("c1", {"c2": "tails"}) == {"heads": 0.25}


def test_short_representations():
    circuit = Reasoner(COINS).compile(["c1"], "c2")
    assert repr(circuit) == "Circuit(coins.plog: c2 given c1; 2 layers)"
    assert repr(circuit.layers[0].total) == "Matrix(2 x 1, 2 entries)"
    (world,) = circuit.most_probable({})
    assert repr(world) == "PossibleWorld(1/3: {c1=heads, c2=heads})"
    many = Reasoner(parse_plog("i = {1..99}. p : i -> boolean. random(p(I)). #domain i(I)."))
    long = many.compile(["p"], ["p(1)", "p(2)"])
    for value in (long, long.most_probable({})[0], long.world_queries.trellis.system.program):
        assert len(repr(value)) < 200
    np.testing.assert_array_equal(long.ending.shape, (1,))
