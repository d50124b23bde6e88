"""The corridor in ir-sim: the robot drives, people come, answer and leave."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.errors import DecisionError
from lcorpp.simulation import Population

pytest.importorskip("irsim", reason="ir-sim is not installed")

FOLDER = Path(__file__).parents[2] / "examples" / "robot"
sys.path.insert(0, str(FOLDER))

from corridor import Corridor  # noqa: E402
from walkers import DOORS, EQUAL_PATIENCE, Patience, draw_visitors  # noqa: E402

DOMAIN = load_domain("intention")


def draw(seconds: float = 120.0, **options):
    rng = np.random.default_rng(3)
    return draw_visitors(Population(DOMAIN), rng, seconds=seconds, per_minute=6.0, **options)


def run_until(corridor: Corridor, end: float) -> None:
    while corridor.time < end:
        corridor.step()


def test_navigation_reaches_its_goal():
    corridor = Corridor([], DOMAIN)
    assert corridor.goal_state == "none"
    corridor.navigate(1.0, 1.5, math.pi)
    while corridor.goal_state == "active":
        corridor.step()
    x, y, heading = corridor.pose
    assert corridor.goal_state == "succeeded"
    assert math.dist((x, y), (1.0, 1.5)) < 0.15
    assert abs(math.remainder(heading - math.pi, math.tau)) < 0.15
    assert 2.0 < corridor.time < 10.0


def test_a_blocked_path_is_aborted():
    """A box between the robot and the goal: the robot stops before it and gives up."""
    corridor = Corridor([], DOMAIN, boxes=[(0.0, 1.6, 3.0, 0.2)])
    corridor.navigate(0.0, 3.0)
    while corridor.goal_state == "active":
        corridor.step()
    assert corridor.goal_state == "aborted"
    assert 0.3 < corridor.pose[1] < 1.2
    assert corridor.time < 15
    stopped = corridor.pose
    corridor.step()
    assert corridor.pose == pytest.approx(stopped)


def test_cancel_stops():
    corridor = Corridor([], DOMAIN)
    corridor.navigate(0.0, 3.0)
    run_until(corridor, 1.0)
    corridor.cancel()
    stopped = corridor.pose
    run_until(corridor, 2.0)
    assert corridor.goal_state == "cancelled"
    assert corridor.pose == pytest.approx(stopped)
    assert stopped[1] > 0.2


def test_a_velocity_drives_until_the_next_command():
    corridor = Corridor([], DOMAIN)
    corridor.set_velocity(0.4, 0.0)
    run_until(corridor, 2.0)
    assert corridor.pose == pytest.approx((0.0, 0.8, math.pi / 2), abs=1e-3)
    corridor.set_velocity(0.0, 0.5)
    run_until(corridor, 3.0)
    assert corridor.pose[2] == pytest.approx(math.pi / 2 + 0.5, abs=1e-3)


def test_the_wall_stops_the_robot():
    corridor = Corridor([], DOMAIN)
    corridor.set_velocity(-0.8, 0.0)
    run_until(corridor, 4.0)
    assert corridor.pose[1] > -0.7


def test_people_come_wait_and_leave():
    visitors = draw()
    corridor = Corridor(visitors, DOMAIN, seed=1)
    seen = set[int]()
    while corridor.time < 300:
        corridor.step()
        seen |= {person for person, _, _ in corridor.people}
        assert all(abs(x) < 9 and -1 < y < 4 for _, x, y in corridor.people)
        assert set(corridor.kinds.values()) <= {"usual"}
    ends = {outcome.visitor.number: outcome.end for outcome in corridor.outcomes}
    assert set(ends) == {visitor.number for visitor in visitors}
    assert set(ends.values()) <= {"left", "turned away"}
    assert seen == {number for number, end in ends.items() if end == "left"}
    assert not corridor.people


def test_no_more_people_than_there_is_room_for():
    corridor = Corridor(draw(), DOMAIN, max_people=1)
    while corridor.time < 100:
        corridor.step()
        assert len(corridor.people) <= 1
    assert "turned away" in {outcome.end for outcome in corridor.outcomes}


def test_equal_seeds_give_equal_tracks():
    first, second = (Corridor(draw(), DOMAIN, seed=2) for _ in range(2))
    run_until(first, 30.0)
    run_until(second, 30.0)
    assert first.people == second.people
    assert first.people


def test_an_interested_person_waits_while_attended_to_and_is_served():
    patience = {"hurried": Patience(1.0, 1.0)}
    visitor = next(each for each in draw(patience=patience) if each.is_interested and not each.late)
    corridor = Corridor([visitor], DOMAIN)
    while not corridor.can_hear(visitor.number):
        corridor.step()
    assert corridor.answer(visitor.number, "move_forward") in {"pos", "neg"}
    run_until(corridor, corridor.time + 30)
    assert corridor.can_hear(visitor.number)
    assert corridor.report(visitor.number, "interested")
    run_until(corridor, corridor.time + 20)
    assert [outcome.end for outcome in corridor.outcomes] == ["served"]
    assert not corridor.people
    assert corridor.answer(visitor.number, "greet") == "none"
    with pytest.raises(DecisionError, match=f"person {visitor.number} is not in the corridor"):
        corridor.report(visitor.number, "interested")


def test_who_is_released_leaves_when_patience_ends():
    patience = {"hurried": Patience(1.0, 1.0)}
    visitor = next(each for each in draw(patience=patience) if each.is_interested and not each.late)
    corridor = Corridor([visitor], DOMAIN)
    while not corridor.can_hear(visitor.number):
        corridor.step()
    corridor.answer(visitor.number, "greet")
    corridor.release(visitor.number)
    run_until(corridor, corridor.time + 40)
    assert [outcome.end for outcome in corridor.outcomes] == ["left"]


def test_the_patience_of_the_kinds_and_the_doors():
    visitors = draw(20_000.0, patience={"hurried": Patience(0.5, 10.0), "patient": Patience(0.5, 70.0)})
    for kind, mean in (("hurried", 10.0), ("patient", 70.0)):
        stays = [visitor.patience for visitor in visitors if visitor.kind == kind]
        assert len(stays) / len(visitors) == pytest.approx(0.5, abs=0.05)
        assert np.mean(stays) == pytest.approx(mean, rel=0.1)
    assert {visitor.attributes["location"] for visitor in visitors} == set(DOORS)
    assert list(EQUAL_PATIENCE) == ["usual"]


def test_it_neither_prints_nor_opens_a_window(capfd):
    run_until(Corridor(draw(), DOMAIN), 5.0)
    assert capfd.readouterr() == ("", "")
