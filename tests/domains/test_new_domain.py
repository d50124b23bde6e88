"""New domains: whatever the six answers, the folder loads and runs; wrong answers are named."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from lcorpp import planning
from lcorpp.cli.new import build
from lcorpp.decision import Robot
from lcorpp.decision.strategies import list_strategies
from lcorpp.domains import load_domain
from lcorpp.domains.new_domain import RESERVED, NewDomain, NewQuestion, NewSense, NewVariable
from lcorpp.domains.new_folder import write_new_domain
from lcorpp.errors import DomainError, FileError
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.scoring.cases import compute_joint_distribution
from lcorpp.scoring.exact_evaluation import evaluate_exactly
from lcorpp.simulation import NoisyChannel

RATES = st.sampled_from(["0.25", ".5", "0.125"])
RELIABILITIES = st.sampled_from(["0.6", "0.9", "1", ".75"])
NAMES = [
    "time", "wish", "person", "room", "t", "x1", "a_b", "ask", "report", "value", "nothing", "hear",
    "max", "min", "sum", "count", "term", "state", "domain", "start", "query", "if", "int", "let", "is",
]  # fmt: skip
"""Names of attributes and values, many with a meaning in some language."""


@st.composite
def new_domains(draw) -> NewDomain:
    names = draw(st.permutations(NAMES))
    take = iter(names)

    def variable() -> NewVariable:
        name, values = next(take), tuple([next(take) for _ in range(draw(st.integers(2, 3)))])
        rates = [(values[0], draw(RATES))] if draw(st.booleans()) else []
        return NewVariable(name, values, tuple(rates))

    facts = tuple([variable() for _ in range(draw(st.integers(0, 1)))])
    shared = tuple([variable() for _ in range(draw(st.integers(1, 2)))])
    senses = tuple(
        [
            NewSense(next(take), draw(st.sampled_from(shared)).name, draw(RELIABILITIES))
            for _ in range(draw(st.integers(0, 2)))
        ]
    )
    questions = tuple(
        [NewQuestion(f"ask_{k}", v.name, draw(RATES), draw(RELIABILITIES)) for k, v in enumerate(shared)]
    )
    return NewDomain("d", facts, shared, senses, questions, draw(st.floats(0, 50)), draw(st.floats(-50, -1)))


def stop_early(progress: planning.Progress) -> None:
    """End a search after some paths: any policy will do."""
    if progress.trials >= 50:
        raise KeyboardInterrupt


@given(new=new_domains())
@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_new_domain_loads_and_runs_exactly(tmp_path, new):
    folder = tmp_path / "domain"
    domain = write_new_domain(folder, new)
    assert sorted(file.name for file in folder.iterdir() if file.is_file()) == [
        "domain.toml",
        "interaction.py",
        "knowledge.plog",
    ]
    assert domain.reasoning.shared == tuple([variable.name for variable in new.shared])
    assert [sense.name for sense in domain.senses] == [sense.name for sense in new.senses]
    channels = {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.senses}
    for sense in new.senses:
        np.testing.assert_allclose(np.diag(channels[sense.name].rates), float(sense.reliability))
    for variable in new.variables:
        marginal = compute_joint_distribution(domain, (variable.name,))
        for value, rate in variable.rates:
            assert marginal[value,] == pytest.approx(float(rate))
    solution = planning.solve(domain.pomdp, domain.start_beliefs(), precision=0.5, callback=stop_early)
    robot = Robot(channels, Reasoner(domain.program), planning.Planner(solution), domain)
    # the enumeration of the answers to many or unreliable questions may take minutes
    few = len(new.shared) == 1 and new.questions[0].reliability in ("0.9", "1")
    plans = ("R+P",) if few else ()
    rows = [row for row in list_strategies(list(channels)) if row.name in plans or not row.plans]
    for scores in evaluate_exactly(domain, robot, channels, tuple(rows)):
        assert np.sum(scores.counts) == pytest.approx(1, abs=1e-6)
        right = scores.counts[:, :-1].trace()
        earned = right * new.right + (1 - right) * new.wrong - scores.cost.estimate
        assert scores.return_.estimate == pytest.approx(earned, abs=1e-3)
    assert sum(world.measure for world in Enumeration(domain.program).worlds) == 1
    shutil.rmtree(folder)


def test_the_question_is_understood_with_its_reliability(tmp_path):
    """P's first question about one of three values: right with .7, each other one .15, at a cost of 2."""
    new = build("trees", [], ["tree=oak,elm,ash"], [], ["look:2:0.7"], 10, -30)
    pomdp = write_new_domain(tmp_path / "trees", new).pomdp
    ask = pomdp.action_index("look")
    expected = [[0.7, 0.15, 0.15, 0], [0.15, 0.7, 0.15, 0], [0.15, 0.15, 0.7, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(pomdp.observation.dense[ask], expected)
    np.testing.assert_array_equal(pomdp.reward[ask], [-2, -2, -2, 0])
    np.testing.assert_array_equal(pomdp.reward[pomdp.action_index("report_elm")], [-30, 10, -30, 0])


def test_without_a_variable_there_is_a_question_for_each():
    new = build("d", [], ["item=tea,soup", "room=lab,hall"], ["gaze:room"], ["ask:1.5", "knock:room"])
    assert [(q.name, q.of, q.cost) for q in new.questions] == [
        ("ask_item", "item", "1.5"),
        ("ask_room", "room", "1.5"),
        ("knock", "room", "1"),
    ]
    assert new.senses == (NewSense("gaze", "room", "0.8"),)


WISH = ["wish=tea,coffee"]
TWO = [*WISH, "room=lab,hall"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((["time"], WISH, [], []), "'time': expected NAME=VALUE,VALUE"),
        ((["time=noon"], WISH, [], []), "'time' has 1 value; expected two or more"),
        ((["time=noon,noon"], WISH, [], []), "value of time 'noon' appears twice"),
        ((["time=noon,Night"], WISH, [], []), "the value of time 'Night': expected a lower-case letter"),
        (
            (["pr=a,b"], WISH, [], []),
            "the variable 'pr': expected no word of P-log or of the model: abs",
        ),
        ((["wish=a,b"], WISH, [], []), "attribute 'wish' appears twice"),
        ((["wish_values=a,b"], WISH, [], []), "'wish_values' is the name of an attribute and of a value"),
        ((["time=wish,b"], WISH, [], []), "'wish' is the name of an attribute and of a value"),
        ((["time=a:0.7,b:0.4"], WISH, [], []), r"the probabilities of time sum to 1\.1, not 1"),
        ((["time=a:x,b"], WISH, [], []), "the probability of time=a is 'x'; expected a number above 0"),
        (([], WISH, ["gaze:nose"], []), "the sense 'gaze' is about 'nose'; expected one of wish"),
        (([], WISH, ["gaze:2"], []), "the reliability of the sense 'gaze' is '2'; expected a number above 0"),
        (([], TWO, ["gaze"], []), "sense 'gaze': expected NAME:VARIABLE; expected one of wish, room"),
        (([], WISH, ["gaze:wish:0.8:1"], []), r"expected NAME\[:VARIABLE\]\[:RELIABILITY\]"),
        (([], WISH, [], ["ask:1:0"]), "the reliability of the question 'ask' is '0'"),
        (([], WISH, [], ["ask:0"]), "the cost of the question 'ask' is '0'"),
        (([], WISH, [], ["report_tea"]), "action 'report_tea' appears twice"),
        (([], ["x=b,b_c", "y=c_d,d"], [], []), "state of the model 'b_c_d' appears twice"),
        (([], ["wish=done,tea"], [], []), "state of the model 'done' appears twice"),
        (([], [f"{v}=a,b,c,d,f" for v in ("x", "y", "z")], [], []), "more than 100 combinations"),
        (([], WISH, [], [], 1.0, 2.0), r"the rewards 1 and 2: expected right > wrong"),
    ],
)
def test_answers_that_are_wrong(arguments, words):
    with pytest.raises(DomainError, match=words):
        build("d", *arguments)


def test_names_and_folders_that_are_wrong(tmp_path):
    with pytest.raises(DomainError, match="expected printable text"):
        build("a\nb", [], WISH, [], [])
    for word in RESERVED:
        with pytest.raises(DomainError, match="no word of P-log"):
            build("d", [], [f"{word}=a,b"], [], [])
    new = build("d", [], WISH, [], [])
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").touch()
    with pytest.raises(DomainError, match="full: exists; expected a new or an empty folder"):
        write_new_domain(tmp_path / "full", new)
    with pytest.raises(DomainError, match=r"thesis\.txt: exists"):
        write_new_domain(tmp_path / "full" / "thesis.txt", new)
    with pytest.raises(FileError, match="cannot create the folder"):
        write_new_domain(tmp_path / "full" / "thesis.txt" / "x" / "y", new)
    with pytest.raises(DomainError, match="no shared variable is given"):
        write_new_domain(tmp_path / "none", build("d", [], [], [], []))
    (tmp_path / "empty").mkdir()
    assert write_new_domain(tmp_path / "empty", new).name == "d"
    assert write_new_domain(tmp_path / "deep" / "er", new).values == ("tea", "coffee")


def test_nothing_half_written(tmp_path, monkeypatch):
    """The files are complete before the folder appears, also if the disk is full."""

    def full(self, *_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(FileError, match="new: cannot be written: No space left on device"):
        write_new_domain(tmp_path / "new", build("d", [], WISH, [], []))
    assert list(tmp_path.iterdir()) == []


def test_the_name_may_be_any_printable_text(tmp_path):
    name = 'Who\'s "there"? \\ 100 % ü 🙂 # {x}'
    assert write_new_domain(tmp_path / "new", build(name, [], WISH, [], [])).name == name
    assert load_domain(tmp_path / "new").name == name
