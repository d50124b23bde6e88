"""`[[planning.limits]]`: limits in the names of a domain."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.domains.sections.limits import DomainLimit
from lcorpp.errors import DomainError


def load(text, **planning):
    """Return the domain intention with a limit, and the limit."""
    changes = {"planning": {"limits": [{"limit": text}], **planning}}
    domain = load_domain("intention", changes=changes)
    return domain, domain.planning.limits[0]


def test_values_are_those_of_people():
    domain, limit = load("greet,turn:not_interested > 1 <= 0.1")
    assert limit.cost.tolist() == [[0, 0], [0, 1], [0, 1], [0, 0], [0, 0]]
    assert (limit.more_than, limit.kind, limit.bound, dict(limit.condition)) == (1, "probability", 0.1, {})
    own = limit.make_limit(domain.planning.state_values)
    assert own.cost[1].tolist() == [0, 1, 0, 1, 0]  # the terminal state has no person


def test_wrong_reports():
    _, limit = load("wrong <= 0.1")
    assert limit.cost[3:].tolist() == [[0, 1], [1, 0]]
    _, limit = load("wrong:interested <= 0.1")
    assert limit.cost[3:].tolist() == [[0, 0], [1, 0]]


def test_conditions_are_about_attributes():
    _, limit = load("greet | not_interested & location=classroom,library <= 0.1")
    assert dict(limit.condition) == {"intention": ("not_interested",), "location": ("classroom", "library")}
    person = {"intention": "not_interested", "location": "library"}
    assert limit.concerns(person)
    assert not limit.concerns({**person, "intention": "interested"})


def test_scores_of_decisions():
    event = DomainLimit("a", np.eye(2), 0.1, more_than=1)
    assert event.score(np.array([0.0, 1.0, 2.0])).tolist() == [0, 0, 1]
    total = DomainLimit("a", 2 * np.eye(2), 0.1, "total")
    assert total.score(np.array([0.0, 4.0])).tolist() == [0, 4]


def test_several_shared_variables():
    domain = load_domain("shopping")
    name, value = domain.reasoning.shared[0], domain.program.attributes[domain.reasoning.shared[0]].values[0]
    action = domain.pomdp.actions[0]
    changes = {"planning": {"limits": [{"limit": f"{action}:{name}={value} <= 0.1"}]}}
    (limit,) = load_domain("shopping", changes=changes).planning.limits
    assert limit.cost[0].sum() == len(domain.values) / len(domain.program.attributes[name].values)
    with pytest.raises(DomainError, match=f"names no variable; expected {name}=VALUE"):
        load_domain("shopping", changes={"planning": {"limits": [{"limit": f"{action}:{value} <= 0.1"}]}})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("greet", "<= BOUND"),
        ("wave <= 0.1", "no action 'wave'; expected one of"),
        ("greet:maybe <= 0.1", "intention is never 'maybe'; expected one of"),
        ("greet:time=morning <= 0.1", "'time' is not shared; expected one of intention|'time' is not shared"),
        ("greet|mood=good <= 0.1", "no attribute 'mood'; expected one of"),
        ("greet|time=noon <= 0.1", "time is never 'noon'; expected one of"),
        ("greet <= 2", "above 1"),
    ],
)
def test_wrong_limits(text, message):
    with pytest.raises(DomainError, match=message) as error:
        load(text)
    assert "limit" in str(error.value)


def test_wrong_tables():
    with pytest.raises(DomainError, match="unknown key"):
        load_domain("intention", changes={"planning": {"limits": [{"limit": "greet <= 1", "bound": 1}]}})
    with pytest.raises(DomainError, match=r"limit is missing|limit.*missing"):
        load_domain("intention", changes={"planning": {"limits": [{"name": "a"}]}})
    twice = [{"limit": "greet <= 1"}, {"limit": "greet <= 0.5"}]
    with pytest.raises(DomainError, match="another limit has the name 'greet'"):
        load_domain("intention", changes={"planning": {"limits": twice}})
    with pytest.raises(DomainError, match="expected a list of different probabilities"):
        load("greet <= 1", limit_noise=[2])
    changes = {"planning": {"limits": [{"limit": "greet <= 1"}], "limit_noise": [0.1]}}
    with pytest.raises(DomainError, match=r"feedback.* is missing"):
        load_domain("intention", preset="limit_5", changes=changes)
    with pytest.raises(DomainError, match="answers have a form, whose noise is its own"):
        load_domain("engagement", changes=changes)


def test_a_simulated_model_has_no_limits(tmp_path):
    from lcorpp.domains.loading import SHIPPED_FOLDER

    knowledge = (SHIPPED_FOLDER / "intention" / "knowledge.plog").read_text()
    (tmp_path / "knowledge.plog").write_text(knowledge)
    (tmp_path / "model.py").write_text(MODEL)
    (tmp_path / "domain.toml").write_text(DOMAIN)
    with pytest.raises(DomainError, match="is simulated; limits need a model with tables"):
        load_domain(tmp_path)


DOMAIN = """
[reasoning]
program = "knowledge.plog"
observed = ["time", "location"]
target = "intention"

[planning]
model = "model.py:Asking"

[[planning.limits]]
limit = "greet <= 1"

[planning.reports]
report_interested = "interested"
report_not_interested = "not_interested"
"""

MODEL = """
class Asking:
    actions = ("greet", "report_interested", "report_not_interested")
    observations = ("pos", "neg")
    discount = 0.9

    def start(self, value, rng):
        return value

    def step(self, state, action, rng):
        return (state if action == "greet" else None), "pos", -1.0

    def likelihood(self, observation, state, action, next_state):
        return 0.5

    def shared(self, state):
        return state
"""
