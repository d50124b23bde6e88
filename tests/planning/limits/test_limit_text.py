"""Limits as text: what they count, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.errors import ModelError
from lcorpp.planning import Limit, format_pomdp, read_limit

POMDP = load_domain("intention").pomdp


@pytest.mark.parametrize(
    ("text", "actions", "states", "kind", "more_than", "bound"),
    [
        ("greet:not_interested<=.02", "greet", "not_interested_*", "probability", 0, 0.02),
        (
            " greet , turn : interested_turned <= 1e-1 ",
            "greet turn",
            "interested_turned",
            "probability",
            0,
            0.1,
        ),
        (
            "report_*:*_turned > 2 <= 1",
            "report_interested report_not_interested",
            "turned",
            "probability",
            2,
            1,
        ),
        ("total(greet)<=3", "greet", "alive", "total", 0, 3),
        ("discounted( * : term ) <= 0", "all", "term", "discounted", 0, 0),
    ],
)
def test_a_limit_counts_actions_in_states(text, actions, states, kind, more_than, bound):
    limit = read_limit(POMDP, text)
    assert (limit.kind, limit.more_than, limit.bound) == (kind, more_than, bound)
    named = POMDP.actions if actions == "all" else actions.split()
    rows = np.array([action in named for action in POMDP.actions])
    groups = {
        "not_interested_*": [1, 3],
        "interested_turned": [2],
        "turned": [0, 1, 2, 3],
        "alive": [0, 1, 2, 3],
        "term": [4],
    }
    columns = np.isin(np.arange(5), groups[states])
    assert limit.cost.tolist() == np.outer(rows, columns).astype(float).tolist()


def test_a_condition_is_about_initial_states():
    limit = read_limit(POMDP, "greet|not_interested <= .02")
    assert limit.given.tolist() == [False, True, False, True, False]
    assert limit.name == "greet|not_interested"


def test_costs_of_a_file(tmp_path):
    from dataclasses import replace

    costs = replace(POMDP, reward=np.abs(POMDP.reward))
    path = tmp_path / "costs.pomdp"
    path.write_text(format_pomdp(costs))
    limit = read_limit(POMDP, f"discounted({path}) <= 20")
    assert limit.cost.tolist() == costs.reward.tolist()
    with pytest.raises(ModelError, match=r"expected total\("):
        read_limit(POMDP, f"{path} <= 0.5")
    path.write_text(format_pomdp(POMDP))
    with pytest.raises(ModelError, match="is -80; expected costs from 0"):
        read_limit(POMDP, f"total({path}) <= 20")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected "),
        ("greet", "<= BOUND"),
        ("greet <= ", "'' is not a number"),
        ("greet <= x", "'x' is not a number"),
        ("greet <= -0.1", "expected a number from 0"),
        ("greet <= nan", "expected a number from 0"),
        ("greet <= 1.01", "above 1"),
        ("greeet <= 0.1", "no action 'greeet'; expected one of"),
        ("greet:interest <= 0.1", "no state 'interest'; expected one of"),
        ("greet,:term <= 0.1", "no action ''"),
        ("greet>-1 <= 0.1", "not the count of an event"),
        (f"greet>{'1' * 5000} <= 0.1", "not the count of an event"),
        ("greet:<= 0.1", "<= BOUND"),
        ("greet <= 1_0", "'1_0' is not a number"),
        ("greet>21 <= 0.1", "expected 0 to 20"),
        ("total(greet>2) <= 1", "not the count of an event"),
        ("mean(greet) <= 1", "expected [total|discounted]"),
        ("greet| <= 1", "expected [total|discounted]"),
        ("total(missing.pomdp) <= 1", "missing.pomdp"),
    ],
)
def test_wrong_texts(text, message):
    from lcorpp.errors import LcorppError

    with pytest.raises(LcorppError) as error:
        read_limit(POMDP, text)
    assert message in str(error.value)


def test_wrong_numbers():
    with pytest.raises(ModelError, match="the costs of an event are 0 or 1"):
        Limit("a", [[0.5]], 0.1)
    with pytest.raises(ModelError, match="costs are finite numbers"):
        Limit("a", [[-1.0]], 0.1, "total")
    with pytest.raises(ModelError, match="unknown kind 'mean'; expected one of"):
        Limit("a", [[1.0]], 0.1, "mean")
    with pytest.raises(ModelError, match="`given` has shape"):
        Limit("a", [[1.0]], 0.1, given=[True, False])
