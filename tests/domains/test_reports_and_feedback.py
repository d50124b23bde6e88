"""What a report says of a sense's class, and what people of several shared variables answer."""

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import DomainError
from lcorpp.runs.recording import find_class_marginal
from lcorpp.runs.senses import find_learning_senses
from lcorpp.values import Distribution

from .deliveries import GAZE, PLOG, VOICE, write_domain

LOOK = GAZE.replace('of = "item"', 'of = "look"').replace('"tea"', '"up"').replace('"soup"', '"down"')
LOOK_PLOG = (
    PLOG.replace("time : times.", "looks = {up, down}. look : looks. random(look). time : times.")
    + "pr(look=up | item=tea) = 0.9.\n"
)
MAPPING = 'report_labels = { person = { ann = "up", bob = "down" } }\n'
FEEDBACK = """[simulation]
noise = 0.1
[simulation.feedback]
ask_item = "{item}"
ask_room = "{room}"
ask_person = { person = { ann = "bob", bob = "ann" } }
"""


def load_looking(folder, mapping=MAPPING):
    return load_domain(write_domain(folder, senses=LOOK + mapping + VOICE, plog=LOOK_PLOG))


def test_a_report_names_the_class_of_each_sense(tmp_path):
    domain = load_looking(tmp_path / "d")
    report = "tea", "bob", "lab"
    assert [domain.class_of(name, report) for name in ("gaze", "voice")] == ["down", "bob"]
    assert list(find_learning_senses(domain, {})) == ["gaze", "voice"]
    joint = Distribution(domain.values, np.arange(8) / 28)  # values: ann, ann, bob, bob; the same again
    assert dict(find_class_marginal(domain, "gaze", joint)) == pytest.approx({"up": 10 / 28, "down": 18 / 28})
    assert find_class_marginal(domain, "voice", joint).probabilities == pytest.approx(
        domain.marginalise(joint, "person").probabilities, abs=1e-15
    )


def test_without_a_mapping_a_report_is_no_label_of_a_hidden_attribute(tmp_path):
    domain = load_looking(tmp_path / "d", "")
    assert list(find_learning_senses(domain, {})) == ["voice"]
    with pytest.raises(DomainError, match="'gaze' classifies look, which is not shared; a report names item"):
        domain.class_of("gaze", ("tea", "bob", "lab"))


@pytest.mark.parametrize(
    ("mapping", "words"),
    [
        (
            MAPPING.replace(', bob = "down"', ""),
            r"\[learning\[1\].report_labels\] person: 'bob' is missing; expected the values of person at",
        ),
        (MAPPING.replace("bob =", "bill ="), r"person: 'bill' is not among the values of person at"),
        (
            MAPPING.replace('"down"', '"left"'),
            r"\[learning\[1\].report_labels.person\] bob: look cannot be 'left'",
        ),
        (
            "report_labels = { time = { noon = 'up' } }\n",
            "is a table of time; expected one shared variable: item",
        ),
        ("report_labels = {}\n", "is a table of nothing; expected one shared variable"),
        ("report_labels = 'person'\n", "report_labels: expected a table"),
    ],
)
def test_wrong_mappings_are_located(tmp_path, mapping, words):
    with pytest.raises(DomainError, match=words):
        load_looking(tmp_path / "d", mapping)


def test_a_sense_of_a_shared_variable_needs_no_mapping(tmp_path):
    with pytest.raises(DomainError, match="report_labels: a report names 'item' itself"):
        load_domain(write_domain(tmp_path / "d", senses=GAZE + MAPPING))


def test_people_answer_each_question_by_a_template_or_a_variable(tmp_path):
    domain = load_domain(write_domain(tmp_path / "d", end=FEEDBACK))
    pomdp, model = domain.pomdp, domain.simulation.feedback_model
    for action, right, wrong in (
        ("ask_item", "soup", "tea"),
        ("ask_room", "lab", "hall"),
        ("ask_person", "bob", "ann"),  # the person is ann, who answers bob
    ):
        row = model[pomdp.actions.index(action), pomdp.states.index("soup_ann_lab")]
        expected = {right: 0.9, wrong: 0.1}
        assert row == pytest.approx([expected.get(name, 0) for name in pomdp.observations])
    end = pomdp.states.index("end")
    assert np.array_equal(model[:, end], pomdp.observation.dense[:, end])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'ask_room = "{room}"\n',
            "",
            r"\[simulation\] feedback: 'ask_room' is missing; expected the questions",
        ),
        ("ask_room =", "ask_rooms =", r"feedback: 'ask_rooms' is not among the questions of .*give.pomdp"),
        (
            '"{room}"',
            '"{rooms}"',
            r"\[simulation.feedback\] ask_room: '{rooms}': .*shared variables in braces: i",
        ),
        ('"{room}"', '"{room"', r"ask_room: '{room': .*expected"),
        ('"{room}"', '"the {room}"', r"ask_room: .*give.pomdp:\d+ has no observation 'the lab'"),
        (
            '"{room}"',
            '"{item}"',
            r"people may answer 'tea' to 'ask_room', but .* probability 0 in every state",
        ),
        ('"{room}"', '"lab"', r"\[simulation\] noise: noise needs at least two different answers"),
        ('"{room}"', "3", r"ask_room: expected a table"),
        (', bob = "ann"', "", r"\[simulation.feedback.ask_person\] person: 'bob' is missing"),
        ("{ person = {", "{ time = {", r"ask_person: is a table of time; expected one shared variable"),
    ],
)
def test_wrong_feedback_is_located(tmp_path, old, new, words):
    assert old in FEEDBACK
    with pytest.raises(DomainError, match=words):
        load_domain(write_domain(tmp_path / "d", end=FEEDBACK.replace(old, new)))
