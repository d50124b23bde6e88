"""Files of sessions: a round trip, and what is refused before a robot moves."""

import json

import numpy as np
import pytest

from lcorpp.assembly.strategies.session_file import SessionFile
from lcorpp.assembly.strategies.trust import TRUST
from lcorpp.decision import LCORPP, Robot
from lcorpp.domains import load_domain
from lcorpp.errors import DecisionError, FileError
from lcorpp.planning import Planner, solve
from lcorpp.reasoning import Reasoner
from lcorpp.values import Step


@pytest.fixture(scope="module")
def domain():
    return load_domain("intention", preset="paper")


@pytest.fixture(scope="module")
def start(domain):
    """Return a function that begins a session of LCORPP+trust."""
    full = Robot({}, Reasoner(domain.program), Planner(solve(domain.pomdp)), domain)
    return lambda: TRUST.start(full, {})


@pytest.fixture
def written(tmp_path, domain, start):
    """Return the file of a session that has learnt from five people, and the session."""
    session, file = start(), tmp_path / "new" / "trust.json"
    for _ in range(5):
        session.learn({"time": "morning"}, [Step("greet", "neg", np.ones(5) / 5)] * 2, "ann")
    SessionFile(file, domain, TRUST).write(session)
    return file, session


def test_a_session_continues_from_its_file(written, domain, start):
    file, session = written
    continued = start()
    SessionFile(file, domain, TRUST).restore(continued)
    assert continued.n_people == 5
    assert json.dumps(continued.state()) == json.dumps(session.state())
    assert [path.name for path in file.parent.iterdir()] == ["trust.json"]


def test_a_session_without_a_file_begins_anew(tmp_path, domain, start):
    session = start()
    SessionFile(tmp_path / "trust.json", domain, TRUST).restore(session)
    assert session.n_people == 0
    assert not list(tmp_path.iterdir())


def test_a_state_of_another_preset_or_strategy_is_refused(written, domain):
    file, _ = written
    other = load_domain("intention", preset="authors")
    with pytest.raises(DecisionError, match="the state is of the preset 'paper'; expected 'authors'"):
        SessionFile(file, other, TRUST)
    with pytest.raises(DecisionError, match="LCORPP does not learn from people, so it has no state"):
        SessionFile(file, domain, LCORPP)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[:-9], "damaged, not JSON"),
        (lambda text: text.replace('"spent": 0.0', '"spent": NaN'), "a number is not finite"),
        (lambda text: "[]", "expected an object"),
    ],
)
def test_a_damaged_file_is_refused(written, domain, change, message):
    file, _ = written
    changed = change(file.read_text())
    assert changed != file.read_text()
    file.write_text(changed)
    with pytest.raises(FileError, match=rf"trust\.json: .*{message}"):
        SessionFile(file, domain, TRUST)


def test_a_place_that_takes_no_file_is_refused_at_once(tmp_path, domain):
    with pytest.raises(FileError):
        SessionFile(tmp_path, domain, TRUST)
    with pytest.raises(FileError, match="name too long"):
        SessionFile(tmp_path / ("x" * 300), domain, TRUST)
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError):
        SessionFile(tmp_path / "file" / "trust.json", domain, TRUST)


def test_a_state_that_does_not_fit_names_the_file(written, domain, start):
    file, _ = written
    content = json.loads(file.read_text())
    content["state"]["values"] = ["other"]
    file.write_text(json.dumps(content))
    with pytest.raises(DecisionError, match=r"trust\.json: the state of trust has other values"):
        SessionFile(file, domain, TRUST).restore(start())
