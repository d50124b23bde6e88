"""The next states of simulated people: the possible ones, with the intervals of the dense table."""

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.planning.sparse import SparseTables
from lcorpp.simulation import SimulationModel


@pytest.mark.parametrize("name", ["intention", "shopping"])
def test_the_intervals_are_those_of_the_dense_table(name):
    domain = load_domain(name)
    model, dense = SimulationModel(domain), domain.pomdp.transition.dense
    for a in range(dense.shape[0]):
        for s in range(dense.shape[1]):
            states, ends = model.find_successors(a, s)
            assert states == np.flatnonzero(dense[a, s]).tolist()
            assert ends == [*np.cumsum(dense[a, s])[states[:-1]].tolist(), 1.0]


def test_a_large_model_needs_no_dense_transitions(monkeypatch):
    """With a thousand shared values the dense table would exceed its limit."""
    domain = load_domain("shopping", preset="small")
    feedback = domain.simulation.feedback_model
    monkeypatch.setattr(SparseTables, "dense", None)
    assert len(SimulationModel(domain).feedback) == len(feedback)
