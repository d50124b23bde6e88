"""Filtering against unrolled programs: the compiled circuit and the enumeration of their worlds."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError
from lcorpp.reasoning import Enumeration, Program, Reasoner, parse_plog
from lcorpp.values import Likelihood

PERSON = """
moments = {{0..{last}}}.
later = {{1..{last}}}.
#domain moments(T).
#domain later(N).
identities = {{student, professor, visitor}}.
places = {{classroom, library, corridor}}.
intentions = {{interested, not_interested}}.
labels = {{zero, one}}.
identity : moments -> identities.
location : moments -> places.
intention : moments -> intentions.
classifier : moments -> labels.
random(identity(0)).
identity(N) = I :- identity(N-1) = I.
random(location(T)).
random(intention(T)).
random(classifier(T)).
pr(location(0)=library | identity(0)=student) = 0.3.
pr(location(0)=library | identity(0)=visitor) = 0.8.
pr(location(N)=P | location(N-1)=P) = 0.7.
pr(intention(0)=interested | identity(0)=student) = 0.3.
pr(intention(0)=interested | identity(0)=professor) = 0.1.
pr(intention(0)=interested | identity(0)=visitor) = 0.8.
pr(intention(N)=interested | intention(N-1)=interested) = 0.9.
pr(intention(N)=interested | intention(N-1)=not_interested, location(N)=library) = 0.2.
pr(intention(N)=interested | intention(N-1)=not_interested, location(N)=classroom) = 0.05.
pr(classifier(T)=one | intention(T)=interested) = 0.76.
pr(classifier(T)=one | intention(T)=not_interested) = 0.29.
:- location(N)=library, location(N-1)=classroom.
"""
ROOM = "moments = {0, 1}. rooms = {1, 2}. at : moments -> rooms. random(at(0)). random(at(1))."
CARRIED = {f"{name}(0)": f"{name}(1)" for name in ("identity", "location", "intention")}

COIN = """
moments = {{0..{last}}}.
later = {{1..{last}}}.
#domain moments(T).
#domain later(N).
a, b, c, s : moments -> boolean.
random(a(0)).
random(b(0)) :- a(0).
b(0)=false :- -a(0).
random(a(N)).
random(b(N)).
random(c(N)) :- a(N).
random(s(N)).
pr(a(0)) = {p[0]}.
pr(b(0) | a(0)) = {p[1]}.
pr(a(N) | a(N-1), not b(N-1)) = {p[2]}.
pr(a(N) | -a(N-1)) = {p[3]}.
pr(b(N) | b(N-1), a(N)) = {p[4]}.
pr(c(N) | a(N)) = {p[5]}.
pr(s(N) | b(N), not c(N)) = {p[6]}.
:- c(N), -b(N), -b(N-1).
"""


def unroll(last: int) -> Program:
    return parse_plog(PERSON.format(last=last))


def test_fifty_steps_are_those_of_the_unrolled_program() -> None:
    n = 50
    rng = np.random.default_rng(0)
    steps = []
    for _ in range(n):
        evidence = {}
        if rng.random() < 0.8:
            evidence["classifier(1)"] = str(rng.choice(["zero", "one"]))
        if rng.random() < 0.2:
            evidence["location(1)"] = str(rng.choice(["library", "corridor"]))
        steps.append(evidence)
    facts = {
        name.replace("(1)", f"({k})"): value
        for k, evidence in enumerate(steps, start=1)
        for name, value in evidence.items()
    }
    smoothed = [f"intention({k})" for k in range(1, n + 1, 7)]
    expected = Reasoner(unroll(n)).compile(list(facts), [f"identity({n})", f"location({n})", *smoothed])(
        facts
    )
    filter = Reasoner(unroll(1)).filter(
        CARRIED, ["location", "classifier(1)"], ["identity(1)", "location( 1 )"], window=n
    )
    for evidence in steps:
        answer = filter.step(evidence)
    for name in ("identity", "location"):
        found = answer[f"{name}(1)"]
        assert found.values == expected[f"{name}({n})"].values
        np.testing.assert_allclose(found.probabilities, expected[f"{name}({n})"].probabilities, rtol=1e-12)
    past = filter.smooth()
    assert len(past) == n
    for k in range(1, n + 1, 7):
        found, unrolled = past[k - 1]["intention(1)"], expected[f"intention({k})"]
        np.testing.assert_allclose(found.probabilities, unrolled.probabilities, rtol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_filter_and_enumeration_agree_on_random_programs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p = [round(float(x), 3) for x in rng.uniform(0.05, 0.95, 7)]
    noise = Likelihood(("true", "false"), rng.uniform(0.1, 1, 2))
    steps = [{"s(1)": "true"}, {"s(1)": noise, "a(1)": "true"}, {}]
    filter = Reasoner(parse_plog(COIN.format(p=p, last=1))).filter(
        {"a(0)": "a(1)", "b(0)": "b(1)"}, ["s(1)", "a(1)"], ["a(1)", "b(1)", "s(1)"], initial={"a(0)": "true"}
    )
    for evidence in steps:
        answer = filter.step(evidence)
    worlds = Enumeration(parse_plog(COIN.format(p=p, last=3))).worlds
    joint = dict.fromkeys(filter.states, 0.0)
    sensed = 0.0
    for world in worlds:
        v = world.values
        if v["a(0)"] == v["s(1)"] == v["a(2)"] == "true":
            mass = float(world.measure) * dict(noise)[v["s(2)"]]
            joint[v["a(3)"], v["b(3)"]] += mass
            sensed += mass * (v["s(3)"] == "true")
    total = sum(joint.values())
    np.testing.assert_allclose(filter.belief, [mass / total for mass in joint.values()], rtol=1e-12)
    assert answer["s(1)"]["true"] == pytest.approx(sensed / total, rel=1e-12)


def test_evidence_of_a_probability_below_the_smallest_number() -> None:
    text = """
        moments = {0, 1}. at : moments -> rooms. rooms = {x, y}. sensors = {1..400}. #domain sensors(S).
        on : sensors -> boolean. random(at(0)). random(at(1)). random(on(S)).
        pr(on(S) | at(1)=x) = 0.1. pr(on(S) | at(1)=y) = 0.11."""
    filter = Reasoner(parse_plog(text)).filter({"at(0)": "at(1)"}, ["on"], "at(1)")
    answer = filter.step({f"on({i})": "true" for i in range(1, 401)})
    assert answer["x"] == pytest.approx(1 / (1 + 1.1**400), rel=1e-9)


def test_smoothing_leaves_out_states_that_the_past_excludes() -> None:
    """The evidence is more probable by 1e9000 had it been b; only a is possible."""
    text = """
        moments = {0, 1}. who : moments -> people. people = {a, b}. seen : moments -> boolean.
        random(who(0)). random(seen(1)). who(1)=X :- who(0)=X, people(X).
        pr(seen(1) | who(1)=a) = 0.001. pr(seen(1) | who(1)=b) = 0.999."""
    filter = Reasoner(parse_plog(text)).filter(
        {"who(0)": "who(1)"}, ["seen(1)"], "who(1)", initial={"who(0)": "a"}, window=3000
    )
    for _ in range(3000):
        assert filter.step({"seen(1)": True})["a"] == 1  # type: ignore[dict-item]
    assert all(step["who(1)"]["a"] == 1 for step in filter.smooth())


def test_a_query_may_lack_a_value_in_other_steps() -> None:
    text = "moments = {0, 1}. a, b : moments -> boolean. random(a(0)). random(a(1)). b(1) :- a(1)."
    filter = Reasoner(parse_plog(text)).filter({"a(0)": "a(1)"}, ["a(1)"], "b(1)")
    assert filter.step({"a(1)": "true"})["true"] == 1
    belief = filter.belief
    with pytest.raises(ProgramError, match=r"b\(1\) has no value with probability 0.5"):
        filter.step({})
    assert filter.belief is belief


def test_likelihoods_of_several_inputs() -> None:
    """Sensors that err independently: their likelihoods multiply."""
    text = """
        moments = {0, 1}. at : moments -> rooms. rooms = {x, y, z}. sensors = {1..5}. #domain sensors(S).
        seen : sensors -> rooms. random(at(0)). random(at(1)). random(seen(S)). #domain rooms(R).
        pr(at(1)=R | at(0)=R) = 0.8. pr(seen(S)=R | at(1)=R) = 0.7."""
    filter = Reasoner(parse_plog(text)).filter({"at(0)": "at(1)"}, ["seen"], "at(1)")
    rng = np.random.default_rng(2)
    scores = rng.uniform(0.01, 1, (5, 3))
    found = filter.step({f"seen({i})": Likelihood(("z", "x", "y"), own) for i, own in enumerate(scores, 1)})
    sensor = np.full((3, 3), 0.15) + 0.55 * np.eye(3)
    expected = np.prod(np.roll(scores, -1, axis=1) @ sensor, axis=0)
    np.testing.assert_allclose(found.probabilities, expected / expected.sum(), rtol=1e-12)
    many = Reasoner(parse_plog(text.replace("1..5", "1..15"))).filter({"at(0)": "at(1)"}, ["seen"], "at(1)")
    with pytest.raises(TooLargeError, match="14348907 combinations of values"):
        many.step({f"seen({i})": Likelihood(("x", "y", "z"), scores[0]) for i in range(1, 16)})


def test_the_memory_of_a_filter_is_constant() -> None:
    filter = Reasoner(unroll(1)).filter(CARRIED, ["classifier(1)"], "intention(1)", window=10)
    labels = [{"classifier(1)": "one"}, {"classifier(1)": "zero"}, {}]
    sizes = []
    tracemalloc.start()
    try:
        for i in range(8001):
            filter.step(labels[i % 3])
            if i in (5000, 8000):  # Python has filled its own free lists by then
                sizes.append(tracemalloc.get_traced_memory()[0])
        assert sizes[1] - sizes[0] < 1000
    finally:
        tracemalloc.stop()
    assert len(filter.smooth()) == 10


def test_reset_and_impossible_evidence() -> None:
    filter = Reasoner(unroll(1)).filter(
        CARRIED, ["location(1)"], "location(1)", initial={"location(0)": "classroom"}
    )
    first = filter.belief
    with pytest.raises(UndefinedError, match=r"continues the steps so far and has location\(1\)=library"):
        filter.step({"location(1)": "library"})
    assert filter.belief is first
    assert filter.step({})["corridor"] == pytest.approx(0.15 / 0.85)
    filter.reset()
    assert filter.belief is first
    assert repr(filter).endswith("18 states)")


@pytest.mark.parametrize(
    ("carried", "message"),
    [
        ({}, "nothing is carried"),
        ({"identity(0)": "identity(0)"}, "expected different terms"),
        ({"identity(0)": "location(1)"}, "different ranges"),
        ({"who(0)": "who(1)"}, "who"),
        (
            {"location(0)": "location(1)", "identity(0)": "identity(1)"},
            r"intention\(1\) depends on intention\(0\)",
        ),
    ],
)
def test_carried_terms_are_checked(carried: dict[str, str], message: str) -> None:
    given = {"intention(0)": "interested"} if len(carried) == 2 else {}
    with pytest.raises(ProgramError, match=message):
        Reasoner(unroll(1)).filter(carried, [], "location(1)", initial=given)


def test_a_random_term_of_slice_0_that_is_not_carried_is_refused() -> None:
    """Each step would draw it anew; noise without a time is drawn anew on purpose."""
    text = """
        moments = {0, 1}. a, b, c, d : moments -> boolean. noise : boolean. random(noise). random(d(1)).
        random(a(0)). random(a(1)). random(b(0)). random(b(1)). c(0) :- b(0). c(0)=false :- -b(0)."""

    def filter(rule: str, *carried: str) -> float:
        program = parse_plog(text + rule, file="two.plog")
        pairs = {f"{name}(0)": f"{name}(1)" for name in carried}
        return Reasoner(program).filter(pairs, [], "d(1)").step({})["true"]

    for rule in ("pr(d(1) | b(0)) = 0.9.", "pr(d(1) | c(0)) = 0.9.", "pr(d(1) | a(0), c(0)) = 0.9."):
        with pytest.raises(ProgramError, match=r"two\.plog: d\(1\) depends on b\(0\), which is not carried"):
            filter(rule, "a")
        assert 0.6 <= filter(rule, "a", "b") <= 0.7
    with pytest.raises(ProgramError, match=r"a constraint depends on b\(0\), which is not carried"):
        filter(":- b(0), -a(0).", "a")
    assert filter("pr(d(1) | noise, a(0)) = 0.9.", "a") == pytest.approx(0.6)
    assert filter("random(c(1)) :- b(0).", "b") == 0.5


def test_programs_that_no_filter_serves() -> None:
    def filter(text: str, inputs: tuple[str, ...] = (), initial: dict[str, str] | None = None) -> None:
        text = "moments = {0, 1}. a, b : moments -> boolean." + text
        Reasoner(parse_plog(text)).filter({"a(0)": "a(1)"}, inputs, "a(1)", initial=initial or {})

    with pytest.raises(
        ProgramError, match=r"a\(1\): .* no value with probability 1 if the last step has a\(0\)=false"
    ):
        filter("random(a(0)). a(1) :- a(0).")
    with pytest.raises(ProgramError, match=r"a\(0\): a carried term has no value with probability 0.5"):
        filter("random(b(0)). a(0) :- b(0). random(a(1)).")
    with pytest.raises(ProgramError, match="cr-rules"):
        filter("random(a(0)). random(a(1)). [r] b(0) +- .")
    with pytest.raises(UndefinedError, match=r"no possible world of positive measure has a\(0\)=false"):
        filter("random(a(0)). pr(a(0))=1. a(1)=X :- a(0)=X, boolean(X).", initial={"a(0)": "false"})
    with pytest.raises(ProgramError, match="is not a value"):
        Reasoner(unroll(1)).filter(CARRIED, ["classifier(1)"], "location(1)").step({"classifier(1)": "two"})
    with pytest.raises(ProgramError, match="is not an input"):
        Reasoner(unroll(1)).filter(CARRIED, ["classifier(1)"], "location(1)").step({"location(1)": "library"})
    with pytest.raises(TooLargeError, match="at most 1000 can be filtered"):
        Reasoner(
            parse_plog("n = {1..40}. t = {0, 1}. x, y : t -> n. random(x(T)) :- t(T). random(y(T)) :- t(T).")
        ).filter({"x(0)": "x(1)", "y(0)": "y(1)"}, [], "x(1)")


def test_arguments_of_a_wrong_type_are_refused() -> None:
    filter = Reasoner(parse_plog(ROOM)).filter({"at(0)": "at(1)"}, ["at(1)"], "at(1)")
    assert filter.step({"at(1)": 1})["1"] == 1  # type: ignore[dict-item]
    for evidence in (None, [], {"at(1)": True}, {"at(1)": [1]}, {"at(1)": None}, {"at(1)": np.array([1, 2])}):
        with pytest.raises(ProgramError):
            filter.step(evidence)  # type: ignore[arg-type]
    with pytest.raises(ProgramError, match="expected Mapping"):
        Reasoner(parse_plog(ROOM)).filter(["at(0)"], [], "at(1)")  # type: ignore[arg-type]
    for window in (-1, 1.5):
        with pytest.raises(ProgramError, match="window"):
            Reasoner(parse_plog(ROOM)).filter({"at(0)": "at(1)"}, [], "at(1)", window=window)  # type: ignore[arg-type]
    with pytest.raises(ProgramError, match="a likelihood of a, b"):
        filter.step({"at(1)": Likelihood(("a", "b"), np.ones(2))})
