"""The planner's states by patterns, by variables and from functions: one model in three forms, and errors."""

import re
from pathlib import Path

import numpy as np
import pytest

from lcorpp.decision import strategies
from lcorpp.domains import load_domain
from lcorpp.domains.sections.names import check_defined, find_attribute_values
from lcorpp.errors import DomainError, LcorppError, ModelError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.reasoning import Reasoner, parse_plog
from tests.domains.test_loading import edit

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "domains" / "models.md"
PRESETS = ("pattern", "variables", "function")


@pytest.fixture
def errands(tmp_path):
    """The domain of docs/guides/domains/models.md, which has one model in three forms."""
    blocks = re.findall(r"^```(?!python)\w+ (\S+)\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    for name, text in blocks:
        (tmp_path / name).write_text(text)
    return tmp_path


def test_three_forms_of_a_model_are_one(errands):
    options = ComparisonOptions(strategies=strategies(["R", "P", "R+P"], []), trials=None)
    tables = [compare_strategies(load_domain(errands, preset=name), options).scores for name in PRESETS]
    for row in zip(*tables, strict=True):
        for scores in row[1:]:
            assert scores.return_.estimate == pytest.approx(row[0].return_.estimate, abs=1e-9)
            assert scores.cost.estimate == pytest.approx(row[0].cost.estimate, abs=1e-9)


def test_variables_in_another_order_with_one_of_the_planner_s_own(errands):
    """Variables and values may have any order; `near` starts as in the model, given the item."""
    (errands / "interaction.py").write_text(
        "from lcorpp.planning import Factored, cpt\n"
        "def make_model():\n"
        "    return Factored.of(\n"
        "        states={'near': 'no yes', 'room': 'hall lab over', 'item': 'book tea'},\n"
        "        actions='deliver_tea_lab deliver_tea_hall deliver_book_lab deliver_book_hall',\n"
        "        observations='none',\n"
        "        start={'item': {'tea': 1}, 'room': {'hall': 0.5, 'lab': 0.5},\n"
        "               'near': cpt('item', {'tea': {'no': 0.75, 'yes': 0.25}, 'book': 'yes'})},\n"
        "        transition={'near': 'same', 'room': 'over', 'item': 'same'},\n"
        "        observation='none', reward=0, discount=0.5)\n"
    )
    edit(errands / "domain.toml", 'make_model"\nterminal = "over=yes"', 'make_model"\nterminal = "room=over"')
    domain = load_domain(errands, preset="function")
    states, planning = domain.pomdp.states, domain.planning
    assert domain.values[0] == ("tea", "lab")
    starts = {state: p for state, p in zip(states, planning.initial_states[0], strict=True) if p}
    assert starts == {"near=no,room=lab,item=tea": 0.75, "near=yes,room=lab,item=tea": 0.25}
    # books have probability 0 at the start of the model: `near` starts there as it does over all
    starts = {state: p for state, p in zip(states, planning.initial_states[3], strict=True) if p}
    assert starts == {"near=no,room=hall,item=book": 0.75, "near=yes,room=hall,item=book": 0.25}
    over = ["room=over" in state for state in states]
    assert planning.terminal == tuple(np.flatnonzero(over))
    np.testing.assert_array_equal(planning.state_values.sum(axis=1), np.logical_not(over))
    assert domain.is_terminal(np.array(over) / sum(over))
    assert not domain.is_terminal(domain.pomdp.start)
    assert domain.marginal(domain.pomdp.start)["tea", "lab"] == 0.5


def test_start_beliefs_for_many_values_are_the_reasoners_marginals(errands):
    edit(errands / "knowledge.plog", "{tea, book}", "{tea, book, pen}")
    edit(errands / "knowledge.plog", "{lab, hall}", "{lab, hall, attic}")
    domain = load_domain(errands, preset="function")
    starts = domain.start_beliefs()
    assert len(starts) == 1 + 9 + 3  # of the model, the corners, and the marginals, also without a time
    reasoner = Reasoner(domain.program)
    times = [{}, {"time": "morning"}, {"time": "evening"}]
    marginals = [reasoner.posterior(["item", "room"], time) for time in times]
    expected = sorted([domain.prior(marginal) for marginal in marginals], key=list)
    np.testing.assert_allclose(starts[10:], expected, atol=1e-12)
    edit(errands / "domain.toml", 'observed = ["time"]\n', "")
    starts = load_domain(errands, preset="function").start_beliefs()
    np.testing.assert_allclose(starts[10:], [domain.prior(reasoner.posterior(["item", "room"]))], atol=1e-12)
    edit(errands / "domain.toml", "shared = [", 'observed = ["badge"]\nshared = [')
    with (errands / "knowledge.plog").open("a") as file:
        file.write("badges = {staff, guest}.\nbadge : badges.\n[b] random(badge) :- time=morning.\n")
    again = load_domain(errands, preset="function").start_beliefs()  # not everybody has a badge
    expected = sorted([domain.prior(marginal) for marginal in marginals[:2]], key=list)
    np.testing.assert_allclose(again[10:], expected, atol=1e-12)


def test_one_record_and_two_variables_have_the_same_start_beliefs(errands):
    """Equivalent programs get the same policy to the last digit, although the reasoner sums differently."""
    edit(errands / "knowledge.plog", "{tea, book}", "{tea, book, pen}")
    edit(errands / "knowledge.plog", "{lab, hall}", "{lab, hall, attic}")
    two = load_domain(errands, preset="function")
    items, rooms = ("tea", "book", "pen"), ("lab", "hall", "attic")
    wishes = [f"{item}_{room}" for item in items for room in rooms]
    rules = [f"wish={item}_{room} :- item={item}, room={room}." for item in items for room in rooms]
    with (errands / "knowledge.plog").open("a") as file:
        file.write(f"wishes = {{{', '.join(wishes)}}}.\nwish : wishes.\n" + "\n".join(rules) + "\n")
    edit(errands / "domain.toml", 'shared = ["item", "room"]', 'shared = ["wish"]')
    edit(errands / "domain.toml", "deliver_{item}_{room}", "deliver_{wish}")
    edit(
        errands / "domain.toml",
        'make_model"\nterminal = "over=yes"',
        'record"\nstates = "{wish}/{over}"\nlocal.over.values = ["no", "yes"]',
    )
    with (errands / "interaction.py").open("a") as file:
        file.write(
            "def record():\n"
            "    from dataclasses import replace\n"
            "    from lcorpp.planning import flatten\n"
            f"    flat = flatten(make_model({{'item': {items}, 'room': {rooms}}}))\n"
            "    names = [state.replace('item=', '').replace(',room=', '_') for state in flat.states]\n"
            "    return replace(flat, states=[name.replace(',over=', '/') for name in names])\n"
        )
    one = load_domain(errands, preset="function")
    np.testing.assert_array_equal(one.start_beliefs(), two.start_beliefs())


def test_a_function_without_parameters_may_return_a_pomdp(errands):
    (errands / "own.py").write_text(
        "from pathlib import Path\nfrom lcorpp.planning import read_pomdp\n"
        "def model():\n    return read_pomdp(Path(__file__).parent / 'delivery.pomdp')\n"
    )
    edit(errands / "domain.toml", '"delivery.pomdp"', '"own.py:model"')
    made = load_domain(errands).pomdp
    assert made.file == f"{errands / 'own.py'}:3"
    edit(errands / "domain.toml", '"own.py:model"', '"delivery.pomdp"')
    assert made.fingerprint == load_domain(errands).pomdp.fingerprint


XML, FUNCTION = "variables", "function"
WRONG = [
    (XML, "delivery.pomdpx", "tea book</Value", "tea pen</Value", r"pomdpx:4: unknown|delivery\.pomdpx:\d+"),
    (
        XML,
        "knowledge.plog",
        "{tea, book}",
        "{tea, book, pen}",
        r"delivery\.pomdpx:4: variable 'item' has the values tea, book; expected tea, book, pen, as at .*"
        r"knowledge\.plog:2",
    ),
    (
        XML,
        "domain.toml",
        'observed = ["time"]\nshared = ["item", "room"]',
        'shared = ["time", "room"]',
        r"delivery\.pomdpx has no state variable 'time', which is shared \(.*knowledge\.plog:2\); expected"
        r" one of item, room, over, or a pattern in .*domain\.toml:\d+: \[planning\] states",
    ),
    (
        XML,
        "domain.toml",
        'model = "delivery.pomdpx"\nterminal = "over=yes"',
        'model = "delivery.pomdpx"\nterminal = "done"',
        r"domain\.toml:19: \[planning\] terminal: .*delivery\.pomdpx has no 'done'; expected one of item=tea",
    ),
    (
        XML,
        "delivery.pomdpx",
        "<ProbTable>1 0</ProbTable></Entry></Parameter></CondProb>\n</Init",
        "<ProbTable>0 1</ProbTable></Entry></Parameter></CondProb>\n</Init",
        r"delivery\.pomdpx: the start belief is terminal",
    ),
    (
        XML,
        "domain.toml",
        'model = "delivery.pomdpx"',
        'model = "delivery.pomdpx"\nlocal.over.values = ["no", "yes"]',
        r"\[planning\] local: unknown key",
    ),
    (
        "pattern",
        "domain.toml",
        'terminal = "done"',
        'terminal = "tea_in_lab"',
        r"toml:14: .*makes 'tea_in_lab', the terminal state at .*toml:15: \[planning\] terminal",
    ),
    (
        FUNCTION,
        "domain.toml",
        "y:make_model",
        "y:model",
        r"interaction\.py has no function 'model'; expected one",
    ),
    (
        FUNCTION,
        "domain.toml",
        "n.py:make_model",
        "n.py",
        r"domain\.toml:22: \[planning\] model: 'interaction\.py' names no function; expected interaction",
    ),
    (FUNCTION, "domain.toml", "n.py:make_model", ".py:model", r"interactio\.py: there is no such file"),
    (
        FUNCTION,
        "interaction.py",
        'values["item"]',
        'values["wish"]',
        r"interaction\.py:10: make_model\(\) failed:",
    ),
    (
        FUNCTION,
        "interaction.py",
        "else 0.2 /",
        "else 0.3 /",
        r"interaction\.py:\d+: make_model\(\) failed: ModelError: .*sums to 1\.1",
    ),
    (
        FUNCTION,
        "interaction.py",
        "    return Factored.of(",
        "    return dict(",
        r"returned dict; expected a Pomdp",
    ),
    (
        FUNCTION,
        "interaction.py",
        "def make_model(values)",
        "def make_model(a, b)",
        r"make_model\(\) failed: TypeE",
    ),
    (FUNCTION, "interaction.py", "import Factored", "import Factord", r"interaction\.py:1: cannot be loaded"),
    (
        FUNCTION,
        "domain.toml",
        'reports = "deliver_',
        'reports = "bring_',
        r"domain\.toml:10: \[planning\] reports: .*interaction\.py:9 has no action 'bring_tea_lab'",
    ),
]


@pytest.mark.parametrize(("preset", "file", "old", "new", "message"), WRONG)
def test_errors_name_both_places(errands, preset, file, old, new, message):
    edit(errands / file, old, new)
    with pytest.raises(LcorppError, match=message):
        load_domain(errands, preset=preset)


def test_a_shared_variable_without_a_value_in_some_world(errands):
    edit(errands / "knowledge.plog", "random(item).", "random(item) :- time=morning.")
    message = (
        r"domain\.toml:7: \[reasoning\] shared: 'item' needs a value in every possible world"
        r" \(.*knowledge\.plog:2\): .*knowledge\.plog: item has no value with probability 1/2$"
    )
    with pytest.raises(DomainError, match=message):
        load_domain(errands)


PROBLOG = "0.5::item(tea); 0.5::item(book). 0.3::time(morning); 0.7::time(evening). 0.4::busy; 0.6::idle."


def test_a_program_of_problog_needs_attributes_of_the_variables(errands):
    (errands / "knowledge.pl").write_text(PROBLOG)
    edit(errands / "domain.toml", "knowledge.plog", "knowledge.pl")
    with pytest.raises(
        DomainError, match=r"'\w+' takes arguments .* in the P-log that `lcorpp translate .*\.pl -o"
    ):
        load_domain(errands)
    program = parse_plog(PROBLOG)
    with pytest.raises(
        DomainError, match=r"expected one without, e\.g\. item_is by `(.*)`, in the P-log"
    ) as found:
        find_attribute_values("a.toml:3: shared", "item", program)
    suggested = re.search("`(item_is : .*?)`", str(found.value))[1]
    with pytest.raises(
        DomainError, match=r"`-busy :- not busy\.` makes it false, in the P-log that `lcorpp tr"
    ):
        check_defined("a.toml:3: shared", ("busy",), program)
    mended = parse_plog(f"{program}\n{suggested}\n-busy :- not busy.")
    assert find_attribute_values("a.toml:3: shared", "item_is", mended) == ("tea", "book")
    check_defined("a.toml:3: shared", ("item_is", "busy"), mended)


def test_a_model_that_is_too_large(errands):
    (errands / "own.py").write_text(
        "from lcorpp.planning import Factored\n"
        "def model(values):\n"
        "    states = values | {f'bit{i}': 'no yes' for i in range(40)}\n"
        "    return Factored.of(states=states, actions='a', start=dict.fromkeys(states, 'uniform'),\n"
        "        transition=dict.fromkeys(states, 'same'), reward=0, discount=0.5)\n"
    )
    edit(errands / "domain.toml", "interaction.py:make_model", "own.py:model")
    with pytest.raises(ModelError, match=r"own\.py:2: \d+ states are too many to be written out"):
        load_domain(errands, preset="function")


def test_a_shared_variable_without_a_value_among_the_simulated_people(errands):
    text = (errands / "knowledge.plog").read_text()
    (errands / "people.plog").write_text(text.replace("random(item).", "random(item) :- time=morning."))
    with (errands / "domain.toml").open("a") as file:
        file.write('\n[simulation]\ntruth = "people.plog"\n')
    message = r"domain\.toml:26: \[simulation\] truth: 'item' needs a value in every .* \(.*people\.plog:2\)"
    with pytest.raises(DomainError, match=message):
        load_domain(errands)
