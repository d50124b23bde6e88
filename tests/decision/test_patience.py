"""The estimated hazard of leaving: against known distributions, under censoring."""

import numpy as np
import pytest

from lcorpp.decision.patience import Patience
from lcorpp.errors import DecisionError


def observe(patience: Patience, kind: str, stays: np.ndarray, censored: np.ndarray) -> None:
    for stay, end in zip(stays.tolist(), censored.tolist(), strict=True):
        patience.observe(kind, min(stay, end), left=stay <= end)


def test_before_any_stay_the_prior_decides():
    assert Patience(20.0).hazard("anybody", 7.0, 10.0) == pytest.approx(1 / 20)
    assert Patience(20.0).mean_stay("anybody") == pytest.approx(20.0)


def test_one_stay_by_hand():
    """Prior of the kind: 2 departures in 80 s; one departure after 7 s: a mean stay of 87 / 3."""
    patience = Patience(40.0)
    patience.observe("hurried", 7.0, left=True)
    assert patience.mean_stay("hurried") == pytest.approx(29.0)
    rates = 6 / (5 + 6 * 29), 7 / (2 + 6 * 29)  # the first five seconds, the next five
    assert patience.hazard("hurried", 0.0, 10.0) == pytest.approx(np.mean(rates))
    assert patience.hazard("patient", 0.0, 10.0) == pytest.approx(1 / 40)


def test_the_hazard_converges_under_censoring():
    """Exponential stays of 12 s, most of them cut by the robot, which attends after 8 s on average."""
    rng, patience = np.random.default_rng(0), Patience(40.0)
    observe(patience, "hurried", rng.exponential(12, 20_000), rng.exponential(8, 20_000))
    assert patience.mean_stay("hurried") == pytest.approx(12, rel=0.03)
    for waited in (0.0, 5.0, 12.0):
        assert patience.hazard("hurried", waited, 10.0) == pytest.approx(1 / 12, rel=0.1)


def test_the_hazard_depends_on_the_time_waited():
    """Everybody leaves between 20 and 30 s: nobody before, and almost everybody then."""
    rng, patience = np.random.default_rng(1), Patience()
    observe(patience, "usual", rng.uniform(20, 30, 5000), rng.exponential(40, 5000))
    assert patience.hazard("usual", 0.0, 10.0) < 0.001
    survival = np.exp(-10 * patience.hazard("usual", 20.0, 10.0))
    assert survival < 0.2


def test_weights_count_people():
    whole, halves = Patience(), Patience()
    whole.observe("usual", 12.0, left=True)
    for _ in range(2):
        halves.observe("usual", 12.0, left=True, weight=0.5)
    assert halves.hazard("usual", 8.0, 9.0) == pytest.approx(whole.hazard("usual", 8.0, 9.0))
    assert "usual: 30.7 s" in repr(whole)


def test_the_words_of_bad_numbers():
    with pytest.raises(DecisionError, match="the expected stay is 0 seconds; expected a positive number"):
        Patience(0)
    with pytest.raises(DecisionError, match=r"a stay of -1 seconds with weight 1.0; expected finite numbers"):
        Patience().observe("usual", -1, left=True)
