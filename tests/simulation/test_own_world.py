"""Own worlds: their answers count, the POMDP scores, and errors name the user's line."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from lcorpp.domains import load_domain, with_world
from lcorpp.errors import DomainError
from lcorpp.simulation import PeopleStream, SimulationModel

OWN = """import numpy as np
class Shy:
    def __init__(self, person, rng):
        self.person, self.rng, self.done = person, rng, []

    def act(self, action):
        self.done.append(action)
        right = self.rng.random() < 0.75
        return "pos" if right == (self.person["intention"] == "interested") else "neg"

    def report(self, action):
        self.done.append(action)
        raise SystemExit(",".join(self.done))

class Quiet(Shy):
    def act(self, action):
        return None

    def report(self, action):
        pass

class Many(Quiet):
    def act(self, action):
        return np.zeros(2)

class Loud(Quiet):
    def act(self, action):
        return {"greet": "perhaps"}[action]

class Half:
    def __init__(self, person, rng):
        pass

    def act(self, action):
        return "pos"

def nothing(person, rng):
    return Shy

def fails(person, rng):
    return person["age"]
"""
GREETED = {"intention": "interested"}


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    return tmp_path / "own.py"


def make(own, name, seed=0):
    model = SimulationModel(with_world(load_domain("intention"), f"{own}:{name}"))
    return model.make_world(GREETED, np.random.default_rng(seed))


def test_an_own_world_answers_and_the_model_scores(own):
    model, rng = SimulationModel(with_world(load_domain("intention"), f"{own}:Shy")), np.random.default_rng(0)
    answers = [model.make_world(GREETED, rng).act("greet") for _ in range(2000)]
    assert answers.count("pos") == pytest.approx(1500, abs=78)  # 4 standard errors
    world = make(own, "Shy")
    world.act("greet")
    world.act("turn")
    with pytest.raises(
        DomainError, match=r"own\.py:13: report\('report_interested'\) failed: .*greet,turn,rep"
    ):
        world.report("report_interested")
    assert (world.cost, world.return_) == (6.5, 73.5)


def test_the_same_generator_gives_the_same_answers(own):
    def answers(seed):
        world = make(own, "Shy", seed)
        return [world.act("greet") for _ in range(20)]

    assert answers(1) == answers(1) != answers(2)
    domain = with_world(load_domain("intention"), f"{own}:Shy")
    again = pickle.loads(pickle.dumps(domain.simulation.world))
    assert repr(again) == f"{own}:Shy"
    assert again(GREETED, np.random.default_rng(0)).act("greet") in ("pos", "neg")


def test_a_world_of_the_folder(tmp_path, own):
    source = load_domain("intention").folder
    for file in source.glob("*.p*"):
        (tmp_path / file.name).write_text(file.read_text())
    text = (source / "domain.toml").read_text()
    (tmp_path / "domain.toml").write_text(
        text.replace("[simulation]\n", '[simulation]\nworld = "own.py:Shy"\n')
    )
    domain = load_domain(tmp_path)
    assert repr(domain.simulation.world) == f"{own}:Shy"
    instance, world = PeopleStream(domain, {}, seed=0).next()
    assert instance.signals == {}
    assert world.act("greet") in ("pos", "neg")
    (tmp_path / "domain.toml").write_text(text.replace("[simulation]\n", '[simulation]\nworld = "own.py"\n'))
    with pytest.raises(DomainError, match=r"\[simulation\] world: expected FILE\.py:NAME, not 'own\.py'"):
        load_domain(tmp_path)


def test_a_terminal_state_is_not_asked(own):
    """A question that ends the decision is answered by the model."""
    domain = with_world(load_domain("intention"), f"{own}:Quiet")
    ended = replace(domain.planning, terminal=tuple(range(5)))
    world = SimulationModel(replace(domain, planning=ended)).make_world(GREETED, np.random.default_rng(0))
    assert world.act("greet") in domain.pomdp.observations


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Quiet", r"own\.py:16: act\(\) answered None to 'turn'; expected one of pos, neg, none"),
        ("Many", r"own\.py:23: act\(\) answered array\(\[0\., 0\.\]\) to 'turn'; expected one of pos"),
        ("Loud", r"own\.py:28: act\('turn'\) failed: KeyError"),
        (
            "Half",
            r"own\.py:31: Half\(\) returned Half, which lacks report; expected an object with the methods",
        ),
        ("nothing", r"own\.py:37: nothing\(\) returned the class Shy; expected an object with"),
        ("fails", r"own\.py:41: fails\(\) failed: KeyError: 'age'"),
        (
            "none",
            r"own\.py has no function 'none'; expected one of Shy, Quiet, Many, Loud, Half, nothing, fails",
        ),
    ],
)
def test_worlds_that_are_wrong(own, name, words):
    with pytest.raises(DomainError, match=words):
        make(own, name).act("turn")


def test_an_observation_that_the_model_lacks(own):
    with pytest.raises(
        DomainError, match=r"own\.py:27: act\(\) answered 'perhaps' to 'greet'; expected one of pos"
    ):
        make(own, "Loud").act("greet")
    with pytest.raises(DomainError, match=r"the world 'own\.py': expected FILE\.py:NAME"):
        with_world(load_domain("intention"), "own.py")
