"""The simulated people of Algorithm 1."""

from pathlib import Path

import numpy as np

from lcorpp.domains import load_domain
from lcorpp.learning.store import NewTrack, Store, TrackSchema
from lcorpp.simulation.people import SimulatedSignals
from lcorpp.simulation.people_stream import GROUP_SIZE, DecisionResult, PeopleStream
from lcorpp.values import Episode

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"


def test_a_resumed_run_draws_the_people_of_an_uninterrupted_run():
    """Whatever was asked of those before, and within a group that is simulated at once."""
    domain = load_domain(ROOMS)
    ask = next(name for name in domain.pomdp.actions if domain.reported_value(name) is None)

    def meet(stream: PeopleStream, count: int, asked: int):
        met = []
        for _ in range(count):
            instance, world = stream.next()
            answers = [world.act(ask) for _ in range(asked)]
            outcome = stream.result(Episode({}, {}, None, domain.pomdp.start, (), "lab"))
            met.append((instance.signals["heading"], dict(instance.context), answers, outcome))
        return met

    sources = {"heading": SimulatedSignals.from_domain(domain, domain.senses[0])}
    stream = PeopleStream(domain, sources, seed=4)
    whole = meet(stream, 3, 1) + meet(stream, GROUP_SIZE, 2)
    for first in (3, GROUP_SIZE - 1, GROUP_SIZE):
        again = meet(PeopleStream(domain, sources, seed=4, position=first), 3, 2)
        for one, other in zip(whole[first : first + 3], again, strict=True):
            assert np.array_equal(one[0], other[0])
            assert one[1:] == other[1:]
    other, _ = PeopleStream(domain, sources, seed=5).next()
    assert not np.array_equal(whole[0][0], other.signals["heading"])


def test_the_result_of_a_decision_is_stored_with_the_track(tmp_path):
    outcome = DecisionResult("a", "b", 2.5, -7.0)
    extras = [outcome.to_extra(), {}, {"simulated": {"cost": 1}}]
    with Store(tmp_path / "s", TrackSchema(("x",), 1, ("a", "b"))) as store:
        store.extend([NewTrack([[row, 1.0]], "b", extra=extra) for row, extra in enumerate(extras)])
        store.relabel(store.snapshot().tracks[0].id, "a")  # a person knows better now: the report stays
        assert [DecisionResult.from_stored(stored) for stored in store.snapshot()] == [outcome, None, None]
