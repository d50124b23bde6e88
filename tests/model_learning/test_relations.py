"""Relations of questions by the values in their names, and reports that are listed."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.errors import DataError
from lcorpp.model_learning import Episodes, Step, learn_model, write_model
from lcorpp.model_learning.baum_welch import Parameters
from lcorpp.model_learning.relations import find_relations, list_answers
from lcorpp.model_learning.structure import STAYS, Structure, list_cells, maximise

VARIABLES = ("item", "room")
VALUES = (("cup", "lab"), ("cup", "hall"), ("pen", "lab"), ("pen", "hall"))


def test_questions_that_differ_in_values_are_of_one_kind():
    actions = ("confirm_cup", "confirm_pen", "ask_room", "wait")
    observations = ("yes", "no", "lab", "hall", "none")
    relations = find_relations(VARIABLES, VALUES, actions, observations, np.arange(4))
    confirm, ask, wait = relations
    assert confirm.actions.tolist() == [0, 1]
    assert confirm.groups.tolist() == [[0, 0, 1, 1], [1, 1, 0, 0]]  # right, wrong
    assert ask.groups.tolist() == [[0, 0, 0, 0]]
    in_lab, in_hall = ask.cells[0, 0].tolist(), ask.cells[0, 1].tolist()
    assert in_lab[2] == in_hall[3] != in_lab[3] == in_hall[2]  # the named room is right, or not
    assert [in_lab[o] for o in (0, 1, 4)] == [in_hall[o] for o in (0, 1, 4)]
    assert wait.actions.tolist() == [3]


def test_names_without_values_have_no_relation():
    assert find_relations(("wish",), (("tea",), ("milk",)), ("greet",), ("pos", "neg"), np.arange(1)) == ()


def test_a_value_within_a_longer_one_is_not_named():
    values = (("interested",), ("not_interested",))
    (own,) = find_relations(("x",), values, ("is_interested", "is_not_interested"), ("yes",), np.arange(2))
    assert own.groups.tolist() == [[0, 1], [1, 0]]


def test_answers_are_listed_with_all_values():
    answers = list_answers(VARIABLES, VALUES, ("hear_cup", "none", "see_lab_pen"))
    assert sorted(answers) == [
        "hear_cup", "hear_pen", "none", "see_hall_cup", "see_hall_pen", "see_lab_cup", "see_lab_pen"
    ]  # fmt: skip


def test_numbers_of_a_relation_are_those_of_its_cells():
    """Three rooms: the named one is right in 60 of 100 steps, and both others share the rest."""
    values = (("lab",), ("hall",), ("shop",))
    answers = ("lab", "hall", "shop")
    relations = find_relations(("room",), values, ("ask",), answers, np.arange(1))
    observation = np.zeros((1, 3))
    plain = Structure(
        np.arange(3),
        np.array([STAYS]),
        observation.astype(int),
        np.arange(3)[None],
        list_cells(observation.astype(int), 3),
    )
    counts = Parameters(
        np.ones(3),
        np.concatenate([np.eye(3), np.zeros((3, 1))], axis=1)[None],
        np.array([[[10.0, 9, 1], [4, 20, 6], [14, 6, 30], [0, 0, 0]]]),
        np.ones((1, 3, 1)),
    )
    prior = replace(counts, observation=np.full((1, 4, 3), 1e-12))
    found = maximise(counts, prior, plain.relate(relations)).observation[0, :3]
    assert found == pytest.approx(np.where(np.eye(3), 0.6, 0.2))


def make_requests(count, seed):
    """Return episodes about an item of three and a room of two: one question, one confirmation, a report."""
    rng, items, rooms, episodes = np.random.default_rng(seed), ["cup", "pen", "key"], ["lab", "hall"], []
    for _ in range(count):
        item, room = rng.choice(items), rng.choice(rooms)
        steps = []
        for _ in range(rng.integers(1, 5)):
            if rng.random() < 0.5:
                wrong = [other for other in items if other != item]
                heard = item if rng.random() < 0.8 else rng.choice(wrong)
                steps.append(Step("ask_item", f"hear_{heard}", -1.0))
            else:
                named = rng.choice(rooms)
                is_right = (named == room) == (rng.random() < 0.9)
                steps.append(Step(f"confirm_{named}", "yes" if is_right else "no", -1.0))
        report = rng.choice(items), rng.choice(rooms)
        reward = 20.0 if report == (item, room) else -20.0
        steps.append(Step(f"bring_{report[0]}_{report[1]}", "none", reward))
        episodes.append(steps)
    return Episodes.of(episodes, [True] * count)


def test_few_episodes_determine_related_answers():
    learnt = learn_model(make_requests(120, seed=0), reports="bring_{item}_{room}", draws=20)
    model, names = learnt.pomdp, learnt.pomdp.observations
    for state, label in enumerate(learnt.states):
        item, room = label.split("_")[:2]
        asked = model.observation[model.action_index("ask_item")][state]
        assert asked[names.index(f"hear_{item}")] == pytest.approx(0.8, abs=0.1)
        confirmed = model.observation[model.action_index("confirm_lab")][state]
        assert confirmed[names.index("yes")] == pytest.approx(0.9 if room == "lab" else 0.1, abs=0.1)


def test_an_answer_that_was_never_recorded_has_a_probability():
    """Nobody said that it is a key, but people of cup and pen were understood."""
    episodes = []
    for item in ("cup", "pen"):
        for report in ("cup", "pen", "key"):
            reward = 20.0 if report == item else -20.0
            episodes += [[Step("ask", f"hear_{item}", -1.0), Step(f"bring_{report}", "none", reward)]] * 10
    learnt = learn_model(Episodes.of(episodes, [True] * 60), reports="bring_{item}", max_states=3, draws=2)
    ask, names = learnt.pomdp.action_index("ask"), learnt.pomdp.observations
    assert learnt.pomdp.observation[ask][learnt.states.index("key"), names.index("hear_key")] > 0.5


def test_names_that_mislead_are_not_followed():
    """People who want milk always say wine, so that the values are not alike."""
    rng, episodes = np.random.default_rng(3), []
    for _ in range(900):
        wish = rng.choice(["tea", "milk", "wine"])
        heard = {"tea": "tea", "milk": "wine", "wine": "wine"}[wish]
        report = rng.choice(["tea", "milk", "wine"])
        steps = [Step("ask", f"hear_{heard}", -1.0)] * 2
        episodes.append([*steps, Step(f"bring_{report}", "none", 9.0 if report == wish else -9.0)])
    learnt = learn_model(Episodes.of(episodes, [True] * 900), reports="bring_{wish}", max_states=3, draws=2)
    ask, wine = learnt.pomdp.action_index("ask"), learnt.pomdp.observations.index("hear_wine")
    rows = learnt.pomdp.observation[ask][:, wine]
    assert rows[learnt.states.index("milk")] == pytest.approx(1.0, abs=0.05)
    assert rows[learnt.states.index("tea")] == pytest.approx(0.0, abs=0.05)


def test_reports_are_listed(tmp_path):
    rng, episodes = np.random.default_rng(1), []
    for _ in range(200):
        wish = rng.choice(["tour", "nothing"])
        answer = {"tour": "yes", "nothing": "no"}[wish]
        report = rng.choice(["give_tour", "stay_away"])
        right = (report == "give_tour") == (wish == "tour")
        reward = {"give_tour": (20.0, -20.0), "stay_away": (5.0, -10.0)}[report][0 if right else 1]
        episodes.append([*[Step("offer", answer, -2.0)] * 2, Step(report, "none", reward)])
    reports = "wish: give_tour=tour, stay_away=nothing"
    learnt = learn_model(Episodes.of(episodes, [True] * 200), reports=reports)
    assert learnt.states == ("nothing", "tour")
    away, tour = (learnt.pomdp.action_index(name) for name in ("stay_away", "give_tour"))
    # each report has rewards of its own
    assert learnt.pomdp.reward[away, :2] == pytest.approx([5, -10], abs=1)
    assert learnt.pomdp.reward[tour, :2] == pytest.approx([-20, 20], abs=1)
    write_model(tmp_path / "own", learnt)
    domain = load_domain(tmp_path / "own")
    assert domain.planning.reports == {"give_tour": "tour", "stay_away": "nothing"}
    with pytest.raises(DataError, match="the report sing is no action; expected one of give_tour, offer"):
        learn_model(Episodes.of(episodes, [True] * 200), reports="wish: give_tour=tour, sing=nothing")
    with pytest.raises(DataError, match="expected VARIABLE: ACTION=VALUE, ACTION=VALUE"):
        learn_model(Episodes.of(episodes, [True] * 200), reports="wish: give_tour")
