"""A domain's POMDP as questions: kinds, answers, models with other rows, and what cannot be followed."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.errors import DomainError
from lcorpp.planning import SparseTables


@pytest.fixture(scope="module")
def intention():
    return load_domain("intention")


def test_each_action_with_its_rows_is_a_kind_of_question(intention):
    dialogue = DomainDialogue(intention)
    # to move forward, to greet, and to turn successfully; whether the robot has turned changes no row
    assert dialogue.tables[:, 0, 0].tolist() == [0.9, 0.8, 0.9]
    assert dialogue.tables.shape == (3, 2, 3)


def test_answers_are_counted_and_an_unsuccessful_turn_is_none(intention):
    dialogue = DomainDialogue(intention)
    history = [("greet", "pos"), ("turn", "none"), ("turn", "neg"), ("move_forward", "pos")]
    kinds = {float(table[0, 0] + k / 100): k for k, table in enumerate(dialogue.tables)}
    assert len(kinds) == 3
    greet, move, turn = 1, 0, 2
    assert dialogue.find_answers(history) == [3 * greet, 3 * turn + 1, 3 * move]


def test_a_model_with_other_rows_changes_these_rows_only(intention):
    dialogue = DomainDialogue(intention)
    tables = dialogue.tables.copy()
    tables[1] = [[0.6, 0.4, 0], [0.3, 0.7, 0]]  # greet
    model, stated = dialogue.make_model(tables), intention.pomdp
    changed = model.observation.dense != stated.observation.dense
    greet = stated.action_index("greet")
    assert set(np.nonzero(changed)[0].tolist()) == {greet}
    for state, row in (("interested_turned", [0.6, 0.4, 0]), ("not_interested_not_turned", [0.3, 0.7, 0])):
        np.testing.assert_allclose(model.observation.dense[greet, stated.state_index(state)], row)
    same = dialogue.make_model(dialogue.tables)
    np.testing.assert_array_equal(same.observation.dense, stated.observation.dense)


@pytest.mark.parametrize(("name", "preset", "kinds"), [("museum", None, 3), ("shopping", "small", 9)])
def test_other_domains_have_questions(name, preset, kinds):
    domain = load_domain(name, preset=preset)
    dialogue = DomainDialogue(domain)
    assert dialogue.tables.shape == (kinds, len(domain.values), len(domain.pomdp.observations))
    np.testing.assert_allclose(dialogue.tables.sum(axis=2), 1)


def test_the_question_to_learn_from_is_informative_and_cheap(intention):
    assert DomainDialogue(intention).question == "greet"


def change(domain, **tables):
    pomdp = replace(domain.pomdp, **{name: SparseTables.of(table) for name, table in tables.items()})
    return replace(domain, planning=replace(domain.planning, model=pomdp))


def test_hidden_variables_of_the_planner_are_refused(intention):
    observation = intention.pomdp.observation.dense.copy()
    turn = intention.pomdp.action_index("turn")
    observation[turn, :2] = observation[turn, 2:4]  # an unsuccessful turn is answered, too
    with pytest.raises(DomainError, match="after 'turn' and 'pos' the planner's own variables may"):
        DomainDialogue(change(intention, observation=observation))


def test_dynamics_that_depend_on_the_shared_value_are_refused(intention):
    transition = intention.pomdp.transition.dense.copy()
    turn = intention.pomdp.action_index("turn")
    transition[turn, 0, [0, 2]] = [0.5, 0.5]
    with pytest.raises(DomainError, match="the effect of 'turn' on the planner's own variables depends on"):
        DomainDialogue(change(intention, transition=transition))


def test_a_model_without_informative_observations_is_refused(intention):
    observation = np.zeros_like(intention.pomdp.observation.dense)
    observation[:, :, 2] = 1
    observation[2, 2:4] = [0.5, 0.5, 0]  # a successful turn is heard, whoever it is
    with pytest.raises(DomainError, match="no observation depends on the shared variables"):
        DomainDialogue(change(intention, observation=observation))


@pytest.mark.parametrize(
    ("history", "message"),
    [
        ([("dance", "pos")], "unknown action 'dance'; expected one of move_forward, greet"),
        ([("greet", "maybe")], "unknown observation 'maybe'; expected one of pos, neg, none"),
        ([("greet", "none")], "the observation 'none' is impossible after 'greet'"),
    ],
)
def test_histories_that_the_model_excludes_are_refused(intention, history, message):
    with pytest.raises(DomainError, match=message):
        DomainDialogue(intention).find_answers(history)
