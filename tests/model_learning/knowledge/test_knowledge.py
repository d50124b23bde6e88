"""Knowledge from records: structures, rules and numbers of known programs are found again."""

import random

import numpy as np
import pytest

from lcorpp import Reasoner, parse_plog
from lcorpp.errors import DataError
from lcorpp.fitting import SoftRecord
from lcorpp.model_learning import learn_knowledge, write_knowledge
from lcorpp.model_learning.knowledge.writing import describe_knowledge, format_program

TIMES = {
    "student": (0.15, 0.15, 0.7),
    "professor": (0.8, 0.1, 0.1),
    "visitor": (0.1, 0.7, 0.2),
}
LIBRARY = INTERESTED = {"student": 0.3, "professor": 0.1, "visitor": 0.8}
STRUCTURE = {
    "identity": (),
    "time": ("identity",),
    "location": ("identity",),
    "intention": ("identity",),
    "classifier": ("intention",),
}


def draw_people(seed, n=2000):
    """Draw records of the paper's knowledge."""
    rng, people = random.Random(seed), []
    for _ in range(n):
        identity = rng.choice(list(TIMES))
        (time,) = rng.choices(["morning", "afternoon", "evening"], TIMES[identity])
        intention = "interested" if rng.random() < INTERESTED[identity] else "not_interested"
        people.append(
            {
                "identity": identity,
                "time": time,
                "location": "library" if rng.random() < LIBRARY[identity] else "classroom",
                "intention": intention,
                "classifier": "one"
                if rng.random() < (0.76 if intention == "interested" else 0.29)
                else "zero",
            }
        )
    return people


def without(name, records):
    return [{key: value for key, value in record.items() if key != name} for record in records]


def test_the_structure_of_the_paper_is_found():
    knowledge = learn_knowledge(draw_people(0))
    assert knowledge.structure == STRUCTURE
    both = knowledge.edges + knowledge.edges.T
    linked = np.array(
        [[a in STRUCTURE[b] or b in STRUCTURE[a] for a in STRUCTURE] for b in STRUCTURE], dtype=float
    )
    assert both == pytest.approx(linked, abs=0.05)
    # five trees of the same edges imply the same independences, so that directions are open
    assert knowledge.edges[0, 1] == pytest.approx(4 / 5, abs=0.02)


def test_an_order_determines_directions():
    knowledge = learn_knowledge(draw_people(0), order=["identity < time, location, intention < classifier"])
    assert knowledge.edges[0, 1:4] == pytest.approx(np.ones(3), abs=1e-6)
    reverse = learn_knowledge(draw_people(0), order=["classifier < intention", "intention < identity"])
    assert reverse.structure["intention"] == ("classifier",)
    assert reverse.edges[0, 3] == 0


def test_a_hidden_attribute_is_found_and_posteriors_remain():
    """The numbers of a hidden attribute are not determined, the posteriors of the others are."""
    people = draw_people(1)
    seen = learn_knowledge(people)
    hidden = learn_knowledge(without("identity", people), hidden={"identity": ("a", "b", "c")})
    assert hidden.structure == STRUCTURE
    assert hidden.fitted.n_undetermined > 0
    assert all(own.interval is None for own in hidden.fitted.numbers[:2])
    reasoners = [Reasoner(own.program) for own in (seen, hidden)]
    differences = []
    for person in people[:300]:
        facts = {name: person[name] for name in ("time", "location", "classifier")}
        one, other = (own.posterior("intention", facts)["interested"] for own in reasoners)
        differences.append(abs(one - other))
    assert np.mean(differences) < 0.02


def test_intervals_cover_the_truth():
    """Rates of 150 people, of rules that three attributes need."""
    covered = []
    for seed in range(40):
        records = without("classifier", draw_people(seed, 150))
        knowledge = learn_knowledge(without("location", records), order=["identity < time, intention"])
        truth = {}
        for identity, rates in TIMES.items():
            truth[f"pr(time=afternoon | identity={identity})"] = rates[1]
            truth[f"pr(intention=interested | identity={identity})"] = INTERESTED[identity]
        for number in knowledge.fitted.numbers:
            left = str(number.statement).partition(" = ")[0]
            if left in truth:
                low, high = number.interval
                covered.append(low <= truth[left] <= high)
    assert len(covered) > 200
    assert 0.92 <= np.mean(covered) <= 0.98


def test_rules_are_merged_where_the_data_do_not_tell_them_apart():
    """The door depends on the mood by day only, and on the hour in three ways of which two are alike."""
    rng, records = random.Random(2), []
    for _ in range(3000):
        hour, mood = rng.choice(["day", "night", "dusk"]), rng.choice(["calm", "angry"])
        rate = 0.1 if hour != "day" else 0.9 if mood == "calm" else 0.5
        records.append({"hour": hour, "mood": mood, "door": "open" if rng.random() < rate else "shut"})
    knowledge = learn_knowledge(records, order=["hour, mood < door"], values={"door": ["open", "shut"]})
    text = format_program(knowledge)
    left = [line.partition(" = ")[0] for line in text.splitlines() if line.startswith("pr(door")]
    assert left == [
        "pr(door=open | hour=day, mood=angry)",
        "pr(door=open | hour=day, mood=calm)",
        "pr(door=open | hour!=day)",
    ]
    program = parse_plog(text, file="text.plog")
    for reasoner in (Reasoner(program), Reasoner(knowledge.program)):
        night = [
            reasoner.posterior("door", {"hour": "night", "mood": own})["open"] for own in ("calm", "angry")
        ]
        assert night[0] == pytest.approx(night[1], abs=1e-12) == pytest.approx(0.1, abs=0.02)


def test_unknown_cells_are_completed():
    """Of records with holes, those that are complete determine the numbers within their error."""
    rng, people = random.Random(3), draw_people(3)
    holes = [{name: own for name, own in person.items() if rng.random() < 0.8} for person in people]
    knowledge = learn_knowledge(holes)
    assert knowledge.structure == STRUCTURE
    full = {
        str(own.statement).partition(" = ")[0]: own.value for own in learn_knowledge(people).fitted.numbers
    }
    for number in knowledge.fitted.numbers:
        assert float(number.value) == pytest.approx(
            float(full[str(number.statement).partition(" = ")[0]]), abs=0.05
        )


def test_likelihoods_of_values_are_evidence():
    """Answers that are right in three of four cases instead of the value: the structure remains."""
    rng, records = random.Random(4), []
    for person in draw_people(4):
        right = [rng.random() < 0.75 for _ in range(4)]
        facts = {name: person[name] for name in ("time", "location", "classifier")}
        likelihoods = []
        for value in ("interested", "not_interested"):
            agree = [own == (value == person["intention"]) for own in right]
            likelihoods.append(
                ({"intention": value}, float(np.prod([0.75 if own else 0.25 for own in agree])))
            )
        records.append(SoftRecord(facts, tuple(likelihoods)))
    knowledge = learn_knowledge(records, order=["intention < time, location, classifier"])
    assert knowledge.structure["classifier"] == ("intention",)
    one, zero = (
        float(own.value) for own in knowledge.fitted.numbers if "classifier=one" in str(own.statement)
    )
    assert one == pytest.approx(0.76, abs=0.06)
    assert zero == pytest.approx(0.29, abs=0.06)


def test_what_the_records_do_not_determine_is_named():
    records = [
        {"site": "berlin", "light": "on", "door": "open"},
        {"site": "berlin", "light": "off", "door": "shut"},
    ]
    knowledge = learn_knowledge(10 * records, values={"light": ["on", "off", "broken"]})
    text = "\n".join(describe_knowledge(knowledge))
    assert "- site: it is berlin in all records" in text
    assert "- light: no record has broken" in text
    assert "site : {berlin}." in format_program(knowledge)


def test_names_and_values_are_quoted_where_needed(tmp_path):
    records = 20 * [{"LVH report": "yes", "age": "0-3 days"}] + 20 * [{"LVH report": "no", "age": "12+"}]
    write_knowledge(tmp_path / "own", learn_knowledge(records))
    program = parse_plog((tmp_path / "own/knowledge.plog").read_text(), file="own.plog")
    assert Reasoner(program).posterior("'LVH report'", {"age": "12+"})["no"] > 0.9


def test_a_hidden_attribute_may_have_one_other():
    """Nothing determines it, and its numbers are not identifiable."""
    knowledge = learn_knowledge([{"a": "x"}, {"a": "y"}] * 5, hidden={"h": ("1", "2")})
    assert knowledge.fitted.numbers[0].interval is None


def test_an_order_names_attributes_as_the_records_do():
    records = 20 * [{"Hour of day": "noon", "Door": "open"}] + 20 * [{"Hour of day": "night", "Door": "shut"}]
    knowledge = learn_knowledge(records, order=["Door < Hour of day"])
    assert knowledge.structure == {"'Hour of day'": ("Door",), "Door": ()}


@pytest.mark.parametrize(
    ("records", "options", "message"),
    [
        ([], {}, "there are no records with values"),
        ([{"a": "x"}, {"a": "x"}], {}, "0 attributes have several values; expected 1 to 12"),
        ([{f"a{i}": str(v) for i in range(13)} for v in (1, 2)], {}, "13 attributes have several values"),
        ([{"a": "x"}, {"a": "y"}], {"hidden": {"a": ("u", "v")}}, "record 1: a is stated; expected no value"),
        ([{"a": "x"}, {"a": "y"}], {"hidden": {"b": ("u",)}}, "b has the values u; expected two or more"),
        ([{"a": "x"}, {"a": "y"}], {"values": {"a": ["x"]}}, "record 2: a is y; expected one of x"),
        ([{"a": "x"}, {"a": "y"}], {"order": ["a"]}, "the order is 'a'; expected attributes as in"),
        ([{"a": "x"}, {"a": "y"}], {"order": ["a < c"]}, "has 'c'; expected one of a"),
        ([{"a": "x", "b": "u"}, {"a": "y", "b": "v"}], {"order": ["a < b", "b < a"]}, "before itself"),
        (
            [{"a0": "x"}, {"a0": "y"}],
            {"values": {f"a{i}": ["x", "y", "z"] for i in range(12)}},
            "the unknown values of the records can be completed in 354294 ways; expected at most 200000",
        ),
    ],
)
def test_wrong_records_are_refused(records, options, message):
    with pytest.raises(DataError) as error:
        learn_knowledge(records, **options)
    assert message in str(error.value)
