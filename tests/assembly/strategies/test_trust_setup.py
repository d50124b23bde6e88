"""Trust of a domain, with and without hearing: from the setup to decisions."""

import numpy as np
import pytest

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot, dt_control
from lcorpp.domains import load_domain
from lcorpp.planning import Planner, solve
from lcorpp.reasoning import Reasoner
from lcorpp.simulation import NoisyChannel
from lcorpp.simulation.people import Population
from lcorpp.simulation.table_dynamics import SimulationModel
from lcorpp.values import Instance


@pytest.fixture(scope="module")
def intention():
    domain = load_domain("intention", preset="paper")
    return domain, Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.1))


def run(intention, count, **switches):
    """Return the mean return with trust, that of LCORPP with the same people, and the trust."""
    domain, planner = intention
    reasoner = Reasoner(domain.program)
    trust = set_up_trust(domain, reasoner, planner, **switches)
    rng, model = np.random.default_rng(5), SimulationModel(domain)
    people = Population(domain).sample(count, rng)
    channels = {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.senses}
    signals = {name: channel.simulate(people, rng) for name, channel in channels.items()}
    returns = []
    for i, person in enumerate(people):
        context = {name: person[name] for name in domain.observed}
        instance = Instance({name: own[i] for name, own in signals.items()}, context)
        worlds = [model.make_world(person, np.random.default_rng([5, i])) for _ in range(2)]
        episode = dt_control(Robot(channels, trust, trust.make_planner(), domain), instance, worlds[0])
        trust.learn(episode.evidence, episode.steps)
        dt_control(Robot(channels, reasoner, planner, domain), instance, worlds[1])
        returns.append([world.return_ for world in worlds])
    return *np.mean(returns, axis=0), trust


@pytest.mark.parametrize("hearing", [True, False])
def test_a_robot_with_trust_decides_better_than_one_that_trusts_what_is_stated(intention, hearing):
    # the paper's noise of answers is .3, more than the model states
    with_trust, without, trust = run(intention, 1000, hearing=hearing)
    assert with_trust > without
    assert trust.learnt.rows[2, 0] == pytest.approx(0.7, abs=0.1)
    assert (trust.planner.policy is intention[1].policy) != hearing


class Tiring:
    """A world in which the k-th answer is wrong with the k-th probability."""

    def __init__(self, world, wrong, rng):
        self._world, self._wrong, self._rng, self._n = world, wrong, rng, 0

    def act(self, action):
        answer = self._world.act(action)
        if answer == "none":
            return answer
        wrong = self._wrong[min(self._n, len(self._wrong) - 1)]
        self._n += 1
        return answer if self._rng.random() >= wrong else {"pos": "neg", "neg": "pos"}[answer]

    def report(self, action):
        self._world.report(action)


@pytest.mark.parametrize(("wrong", "form"), [((0.05, 0.25, 0.4, 0.45), "number"), ((0.2,), "independent")])
def test_the_form_of_the_answers_is_found(wrong, form):
    """Of people who tire with each question, and of people who do not."""
    domain = load_domain("intention", preset="paper", changes={"simulation": {"noise": 0.0}})
    planner, reasoner = (
        Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.1)),
        Reasoner(domain.program),
    )
    trust, rng = set_up_trust(domain, reasoner, planner), np.random.default_rng(2)
    assert trust.forms == ("independent", "number", "repeated", "class")
    model, people = SimulationModel(domain), Population(domain).sample(600, rng)
    for person in people:
        instance = Instance({}, {name: person[name] for name in domain.observed})
        world = Tiring(model.make_world(person, rng), wrong, rng)
        episode = dt_control(Robot({}, trust, trust.make_planner(), domain), instance, world)
        trust.learn(episode.evidence, episode.steps)
    assert trust.form == form
    assert trust.form_weights[trust.forms.index(form)] > 0.5
    if form == "number":
        noise = trust.learnt.noise.degrees
        assert noise[0] < noise[1] < noise[3]
