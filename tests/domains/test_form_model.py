"""The planner's model with the memory of a form: values and beliefs against independent computations."""

import itertools
from copy import copy

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.domains.form_dialogue import FormDialogue
from lcorpp.domains.form_model import FormModel
from lcorpp.errors import TooLargeError
from lcorpp.planning import Planner, solve
from lcorpp.planning.sarsop.paced_search import PacedSearch
from lcorpp.trust.answers import Noise
from lcorpp.trust.forms import ByClass, ByNumber, Repeated
from lcorpp.values import Distribution

FORMS = [ByNumber(), Repeated(3)]


@pytest.fixture(scope="module")
def intention():
    domain = load_domain("intention")
    return (
        domain,
        DomainDialogue(domain),
        Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.01)),
    )


def place(form, domain):
    return np.array([form.model.place(start, np.ones(1)) for start in domain.start_beliefs()])


@pytest.mark.parametrize("form", FORMS)
def test_with_the_stated_rows_memory_is_worth_nothing(intention, form):
    domain, base, stated = intention
    own = FormDialogue(domain, base, form)
    planner = own.make_stated_planner(stated)
    solution = solve(planner.pomdp, place(own, domain), precision=0.01)
    for start, placed in zip(domain.start_beliefs(), place(own, domain), strict=True):
        value = stated.policy.value(start)
        assert planner.policy.value(placed) == pytest.approx(value)
        assert solution.policy.value(placed) == pytest.approx(value, abs=0.02)


@pytest.mark.parametrize("form", FORMS)
def test_beliefs_follow_the_rows_of_the_memory(intention, form):
    """Against Bayes' rule on the answers alone, with rows drawn at random."""
    domain, base, _ = intention
    own = FormDialogue(domain, base, form)
    tables = own.tables * np.random.default_rng(1).uniform(0.5, 1.5, own.tables.shape)
    tables /= tables.sum(axis=2, keepdims=True)
    model = own.model.make_model(tables)
    planner = own.follow(Planner(own.model.lift(intention[2].policy, model), model))
    history = [("greet", "pos"), ("greet", "neg"), ("turn", "none"), ("turn", "pos"), ("greet", "neg")]
    history += [("move_forward", "pos"), ("turn", "neg"), ("greet", "neg")]
    belief = domain.pomdp.start
    for n, (action, observation) in enumerate(history, 1):
        belief = planner.update(belief, action, observation)
        cells = own.find_answers(history[:n])
        likelihood = np.prod([tables[cell // 3, :, cell % 3] for cell in cells], axis=0)
        np.testing.assert_allclose(domain.marginal(belief).probabilities, likelihood / likelihood.sum())
    assert belief[[0, 1]].sum() == 0  # the robot has turned


def test_beliefs_follow_the_class_of_the_person(intention):
    """Against Bayes' rule with a hidden class; contradictory answers mean that it is the unreliable one."""
    domain, base, stated = intention
    own = FormDialogue(domain, base, ByClass())
    tables = own.answers.make_tables(own.answers.add_noise(Noise((0.0, 0.9))))
    shares = np.array([0.7, 0.3])
    own.planners = StatedPlanners(own, stated)
    planner = own.make_planner(tables, shares)
    history = [("greet", "pos"), ("greet", "neg"), ("move_forward", "pos"), ("turn", "none"), ("turn", "pos")]
    prior = np.array([0.2, 0.8])
    belief = domain.prior(Distribution(domain.values, prior))
    for n, (action, observation) in enumerate(history, 1):
        belief = planner.update(belief, action, observation)
        cells = own.find_answers(history[:n])
        by_class = [
            np.prod([tables[cell // 3 * 2 + c, :, cell % 3] for cell in cells], axis=0) for c in (0, 1)
        ]
        expected = prior * (shares @ np.array(by_class))
        np.testing.assert_allclose(domain.marginal(belief).probabilities, expected / expected.sum())
    restored = FormDialogue(domain, base, ByClass())
    restored.planners = StatedPlanners(restored, stated)
    again = restored.restore(own.state())
    start = domain.prior(Distribution(domain.values, prior))
    np.testing.assert_allclose(
        again.update(start, "greet", "pos"), own.make_planner(tables, shares).update(start, "greet", "pos")
    )


class StatedPlanners:
    """Returns the stated policy for each model."""

    def __init__(self, own, stated):
        self._own, self._stated = own, stated

    def __call__(self, tables, make_model):
        self._tables, model = tables, make_model(tables)
        return Planner(self._own.model.lift(self._stated.policy, model), model)

    def state(self):
        return self._tables.tolist()

    def restore(self, state, make_model):
        return self(np.array(state), make_model)


def test_people_who_contradict_themselves_are_asked_less_if_they_may_be_unreliable(intention):
    """Half of the people answer at random; compared with the same mean rate of wrong answers for all."""
    domain, base, _ = intention
    own = FormDialogue(domain, base, ByClass())
    tables = own.answers.make_tables(own.answers.add_noise(Noise((-0.1, 0.9))))
    mean = np.repeat(tables.reshape(3, 2, 2, 3).mean(axis=1), 2, axis=0)
    counts = []
    for known in (tables, mean):
        model, starts = own.model.make_model(known), own.place_starts(domain.start_beliefs())
        search = PacedSearch(model, starts, precision=0.2)
        search.advance(trials=60)
        planner = own.follow(Planner(search.make_policy(), model))
        belief, asked = domain.prior(Distribution(domain.values, [0.5, 0.5])), 0
        while domain.reported_value(action := planner.action(belief)) is None and asked < 50:
            observation = "none" if action == "turn" and asked == 0 else ("pos", "neg")[asked % 2]
            belief = planner.update(belief, action, observation)
            asked += 1
        counts.append(asked)
    assert counts[0] < counts[1]


def test_a_repeated_question_with_a_certain_answer_tells_nothing_and_is_not_asked(intention):
    domain, base, _ = intention
    own = FormDialogue(domain, base, Repeated(3))
    tables = own.tables.reshape(3, 4, 2, 3).copy()
    tables[:, 1:] = np.eye(3)[None, :, None]
    model = own.model.make_model(tables.reshape(12, 2, 3))
    planner = own.follow(Planner(solve(model, place(own, domain), precision=0.01)))
    belief = planner.update(domain.pomdp.start, "greet", "pos")
    np.testing.assert_allclose(planner.update(belief, "greet", "pos"), belief)
    for answers in (("pos", "neg", "pos"), ("neg", "neg", "neg"), ("neg", "pos", "pos")):
        answer_of = dict(zip(("greet", "move_forward", "turn"), answers, strict=True))
        asker = own.follow(Planner(solve(model, place(own, domain), precision=0.01)))
        belief, asked = domain.pomdp.start, list[str]()
        while domain.reported_value(action := asker.action(belief)) is None:
            belief = asker.update(belief, action, answer_of[action])
            asked.append(action)
        assert 1 <= len(asked) == len(set(asked))


def test_a_form_with_too_many_states_is_refused():
    domain = load_domain("shopping", preset="small")
    with pytest.raises(TooLargeError, match="the form of answers 'repeated' has more than 200 states"):
        FormModel(domain, DomainDialogue(domain), Repeated(len(domain.pomdp.observations)))


@pytest.mark.parametrize("form", [ByClass(), Repeated(3)])
def test_a_belief_about_a_known_person_is_that_after_the_earlier_answers(intention, form):
    """A person of whom the robot knows nothing is new; a class that is known in part has its probability."""
    domain, base, _ = intention
    own = FormDialogue(domain, base, form)
    prior, n, n_values = domain.pomdp.start, form.n_classes, len(domain.values)
    new = np.tile(domain.marginal(prior).probabilities, (n, 1)) / n
    np.testing.assert_allclose(
        own.model.place_known(prior, [(None, new.ravel())]), own.model.place(prior, np.full(n, 1 / n))
    )
    joint = np.random.default_rng(2).dirichlet(np.ones(n * n_values))
    belief = domain.prior(Distribution(domain.values, joint.reshape(n, -1).sum(axis=0)))
    placed = own.model.place_known(belief, [(None, joint)])
    for c in range(n):
        for v, value in enumerate(domain.values):
            states = (own.model.states[:, 1] == c) & (
                own.model._value_of[own.model.states[:, 0]] == domain.values.index(value)
            )
            assert placed[states].sum() == pytest.approx(joint[c * n_values + v])


def test_no_belief_is_lost_where_another_conversation_starts(intention):
    """After a turn the robot is in other states; only what it can ask again is remembered."""
    domain, base, _ = intention
    own = FormDialogue(domain, base, Repeated(3))
    values = np.array([0.2, 0.8])
    prior = domain.prior(Distribution(domain.values, values))
    ends = list(itertools.product(("pos", "neg"), repeat=3))
    for greet, turn, move in ends:
        history = [("greet", greet), ("turn", turn), ("move_forward", move)]
        memory = own.find_memory(history)
        placed = own.model.place_known(prior, [(None, 0.3 * values), (memory, 0.7 * values)])
        np.testing.assert_allclose(own.model.collapse(placed), prior)
        again = own.find_answers([("greet", greet)], memory)
        assert again != own.find_answers([("greet", greet)])  # it counts as asked before


def test_a_person_with_repeated_answers_is_continued(intention):
    """Two conversations of a person, the second from the memory of the first, are one conversation."""
    domain, base, stated = intention
    own = FormDialogue(domain, base, Repeated(3))
    tables = own.tables * np.random.default_rng(3).uniform(0.5, 1.5, own.tables.shape)
    tables /= tables.sum(axis=2, keepdims=True)
    model = own.model.make_model(tables)
    planner = own.follow(Planner(own.model.lift(stated.policy, model), model))
    first, second = [("greet", "pos"), ("greet", "neg")], [("greet", "neg"), ("greet", "pos")]
    whole, belief = copy(planner), domain.pomdp.start
    for action, observation in [*first, *second]:
        belief = whole.update(belief, action, observation)
    memory = own.find_memory(first)
    assert own.find_answers(first) + own.find_answers(second, memory) == own.find_answers([*first, *second])
    assert own.find_memory(second, memory) == own.find_memory([*first, *second])
    between = domain.pomdp.start
    earlier = copy(planner)
    for action, observation in first:
        between = earlier.update(between, action, observation)
    values = domain.marginal(between).probabilities
    again = own.start_known(planner, lambda: [(None, 0 * values), (memory, values)])
    again_belief = domain.prior(domain.marginal(between))
    for action, observation in second:
        again_belief = again.update(again_belief, action, observation)
    np.testing.assert_allclose(
        domain.marginal(again_belief).probabilities, domain.marginal(belief).probabilities
    )
