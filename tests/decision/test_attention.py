"""The index of attention: against an exact small MDP, in its limits, and with a share that is learnt."""

from dataclasses import replace
from math import exp, inf

import numpy as np
import pytest

from lcorpp.decision.attention import Candidate, ServedShare, choose_candidate, compute_index
from lcorpp.errors import DecisionError
from tests.decision.small_queue import SmallQueue, choose_most_probable, draw_queue, index_policy

ANN = Candidate("Ann", 0.9, 0.9, 10.0, 1 / 100)
BOB = Candidate("Bob", 0.8, 0.8, 10.0, 1 / 5)


def test_the_index_by_hand():
    """Ann: .9 / 10 (1 - .64 e^-.1); Bob: .8 / 10 (1 - .64 e^-2): Bob leaves sooner, so he comes first."""
    assert compute_index(ANN, 0.8, 10.0) == pytest.approx(0.09 * (1 - 0.64 * exp(-0.1)))
    assert compute_index(BOB, 0.8, 10.0) == pytest.approx(0.08 * (1 - 0.64 * exp(-2.0)))
    assert choose_candidate([ANN, BOB], share=0.8) == "Bob"


def test_in_overload_the_value_per_second_decides():
    assert choose_candidate([ANN, BOB], share=0.0) == "Ann"
    assert choose_candidate([replace(ANN, seconds=20.0), BOB], share=0.0) == "Bob"


def test_equal_hazards_give_the_order_of_value_per_second():
    rng = np.random.default_rng(0)
    for share in (0.0, 0.3, 0.7, 1.0):
        people = [Candidate(i, 0.5, v, s, 0.02) for i, (v, s) in enumerate(rng.uniform(0.1, 9, (5, 2)))]
        best = max(people, key=lambda each: each.value / max(each.seconds, 1.0))
        assert choose_candidate(people, share=share) == best.person


def test_who_leaves_at_once_is_never_worth_less_than_their_value_now():
    assert compute_index(replace(BOB, hazard=inf), 1.0, 10.0) == pytest.approx(0.08)


def test_nobody_is_chosen_if_nobody_is_worth_it():
    assert choose_candidate([], share=0.5) is None
    assert choose_candidate([replace(ANN, value=0.0), replace(BOB, value=-1.0)], share=0.5) is None
    assert choose_candidate([replace(ANN, value=0.0), BOB], share=0.5) == "Bob"


def test_the_small_queue_is_right():
    """One kind, no impatience worth naming, room for three: an M/M/1/3 queue, whose throughput is known."""
    queue = SmallQueue((0.2,), (1.0,), (4.0,), (1e-12,), room=3)
    policy = queue.make_policy(choose_most_probable)
    load = 0.8
    blocked = load**3 * (1 - load) / (1 - load**4)
    assert queue.evaluate(policy)[0] == pytest.approx(0.2 * (1 - blocked))
    assert queue.find_share(policy) == pytest.approx(1 - blocked)


@pytest.mark.parametrize("equal_hazards", [True, False])
def test_never_below_the_highest_posterior_in_the_exact_model(equal_hazards):
    """Equal durations, q as it results from the rule itself; and part of what the best policy gains."""
    rng, gained, possible = np.random.default_rng(7), 0.0, 0.0
    for _ in range(60):
        queue = draw_queue(rng, equal_hazards=equal_hazards, equal_seconds=True)
        base_policy = queue.make_policy(choose_most_probable)
        base, _ = queue.evaluate(base_policy)
        gain, _ = queue.evaluate(index_policy(queue)[0])
        assert gain >= base * (1 - 1e-9)
        gained, possible = gained + gain / base - 1, possible + queue.solve(base_policy) / base - 1
    assert gained >= 0.3 * possible


def test_near_the_best_policy_with_unequal_durations():
    rng, gained, possible = np.random.default_rng(2), 0.0, 0.0
    for _ in range(30):
        queue = draw_queue(rng, equal_hazards=False, equal_seconds=False)
        base_policy = queue.make_policy(choose_most_probable)
        base, _ = queue.evaluate(base_policy)
        gained += queue.evaluate(index_policy(queue)[0])[0] / base - 1
        possible += queue.solve(base_policy) / base - 1
    assert gained >= 0.9 * possible


def test_the_share_falls_with_the_load():
    queue = SmallQueue((0.02, 0.02), (0.9, 0.6), (10.0, 10.0), (1 / 60, 1 / 15))
    shares = [index_policy(replace(queue, arrivals=(rate, rate)))[1] for rate in (0.01, 0.03, 0.1, 0.3)]
    assert shares == sorted(shares, reverse=True)


def test_the_share_is_learnt():
    """Two of three are attended to, whatever the prior is, and those without value do not count."""
    served = ServedShare()
    assert served.share == 0.5
    for i in range(3000):
        served.record(0.9, attended=bool(i % 3))
        served.record(-1.0, attended=False)
    assert served.share == pytest.approx(2 / 3, abs=0.01)
    assert repr(served) == "<ServedShare: 0.67>"


def test_people_who_find_no_room_lower_the_share():
    """An M/M/1/3 queue of load .8: the share of the arrivals that find it full is known (Erlang)."""
    served, rng, present = ServedShare(), np.random.default_rng(0), 0
    for _ in range(40_000):  # arrivals at .02 per second, services at .025
        rate = 0.02 * (present < 3) + 0.025 * (present > 0)
        seconds = rng.exponential(1 / rate)
        served.record_presence(present, seconds / 100)  # within the memory
        present += 1 if rng.uniform() < 0.02 * (present < 3) / rate else -1
    blocked = 0.8**3 * (1 - 0.8) / (1 - 0.8**4)
    assert served.share == pytest.approx(0.5 * (1 - blocked), abs=0.02)


def test_rare_numbers_of_people_do_not_count_as_full():
    served = ServedShare()
    for _ in range(100):
        served.record_presence(2, 5.0)
        served.record_presence(5, 5.0)
        served.record_presence(9, 0.05)  # e.g. false detections
    assert served.share == pytest.approx(0.25, abs=0.01)


def test_a_constant_number_of_people_says_nothing():
    served = ServedShare()
    for _ in range(10):
        served.record_presence(2, 60.0)
    assert served.share == 0.5


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("probability", 1.5, "the probability of the candidate 'Ann' is 1.5; expected a number in [0, 1]"),
        ("value", inf, "the value of the candidate 'Ann' is inf; expected a finite number"),
        ("seconds", -1.0, "the seconds of the candidate 'Ann' is -1.0; expected a finite number, 0 or more"),
        ("hazard", float("nan"), "the hazard of the candidate 'Ann' is nan; expected a number, 0 or more"),
    ],
)
def test_the_words_of_a_bad_candidate(name, value, words):
    with pytest.raises(DecisionError) as caught:
        replace(ANN, **{name: value})
    assert str(caught.value) == words


def test_the_words_of_a_bad_share():
    with pytest.raises(
        DecisionError, match=r"the share of served people is 2; expected a number in \[0, 1\]"
    ):
        choose_candidate([ANN], share=2)
