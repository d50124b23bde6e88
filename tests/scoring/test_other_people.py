"""People of another domain: the own domain's people as the others give the same scores."""

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.decision import strategies
from lcorpp.errors import DomainError
from lcorpp.experiments import ComparisonOptions, compare_strategies

CHOSEN = strategies(["P", "LCORPP"])


def run(domain, people, trials=200):
    """Return (strategies, 2): accuracy and return."""
    options = ComparisonOptions(CHOSEN, trials=trials, people=people)
    scores = compare_strategies(domain, options).scores
    return np.array([(own.accuracy.estimate, own.return_.estimate) for own in scores])


def test_the_own_people_are_the_same():
    domain = load_domain("intention")
    assert run(domain, load_domain("intention")) == pytest.approx(run(domain, None))


def test_noise_and_rewards_are_those_of_the_people():
    """A robot that expects 30 % noise never errs among people without."""
    domain = load_domain("intention")
    without = load_domain("intention", changes={"simulation": {"noise": 0.0}})
    assert run(domain, without)[0, 0] == 1.0
    misled = load_domain("intention", preset="low")
    own, others = run(misled, misled)[1], run(misled, domain)[1]
    assert own == pytest.approx(others)  # its people are drawn from the true program, too


def test_people_that_a_robot_does_not_know_are_refused(tmp_path):
    domain = load_domain("intention")
    with pytest.raises(DomainError, match="has no attribute intention, which is shared in"):
        run(domain, load_domain("shopping"))
    with pytest.raises(DomainError, match="people of another domain are simulated"):
        ComparisonOptions(CHOSEN, trials=None, people=domain)


def test_the_option(lcorpp):
    arguments = (
        "run",
        "intention",
        "--classifier",
        "channel",
        "--strategy",
        "P",
        "--trials",
        "50",
        "--no-cache",
    )
    one, other = lcorpp(*arguments), lcorpp(*arguments, "--truth", "intention")
    assert one.code == other.code == 0, other.err
    assert one.out.partition("SARSOP")[0] == other.out.partition("SARSOP")[0]
    wrong = lcorpp("run", "intention", "--exact", "--truth", "intention")
    assert wrong.code == 2
    assert "--truth: people of another domain are sampled, not enumerated with --exact" in wrong.err
    wrong = lcorpp(*arguments, "--truth", "museum")
    assert "has no attribute intention, which is shared in" in wrong.err
