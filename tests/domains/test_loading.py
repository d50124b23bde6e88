"""Loading of domain folders: the files are checked against each other, and errors name both places."""

import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from lcorpp.assembly import TrainingOptions, train_classifier
from lcorpp.assembly.training_data import simulate_training_data
from lcorpp.domains import list_domains, load_domain
from lcorpp.domains.toml import read_toml
from lcorpp.errors import DomainError, FileError, LcorppError, ParseError
from lcorpp.planning import solve
from lcorpp.reasoning import Reasoner
from lcorpp.values import ConfusionMatrix, Distribution, Likelihood, strip_padding

ROOMS = Path(__file__).parent / "rooms"


@pytest.fixture
def folder(tmp_path):
    copy = tmp_path / "rooms"
    shutil.copytree(ROOMS, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def load_all(folder: Path) -> None:
    for preset in ("calm", "hectic"):
        load_domain(folder, preset=preset)


def test_the_paper_s_prior():
    """PAPER.md, golden test: [.22, .78, 0, 0, 0]."""
    domain = load_domain("intention")
    assert domain.pomdp.states[:2] == ("interested_not_turned", "not_interested_not_turned")
    prior = domain.prior(Distribution(("interested", "not_interested"), np.array([0.22, 0.78])))
    np.testing.assert_allclose(prior, [0.22, 0.78, 0, 0, 0])
    assert domain.marginal(np.array([0.1, 0.2, 0.3, 0.4, 0]))["interested"] == pytest.approx(0.4)


def test_presets_of_the_paper_s_domain():
    paper, authors = load_domain("intention"), load_domain("intention", preset="authors")
    assert (paper.preset, authors.preset) == ("paper", "authors")
    np.testing.assert_allclose(paper.pomdp.start, [0.5, 0.5, 0, 0, 0])
    np.testing.assert_allclose(authors.pomdp.start, [0.2] * 5)
    channel = authors.simulation.noisy_channels["motion"]
    assert channel["interested"]["one"] == 0.594
    assert channel["not_interested"]["one"] == 0.119
    assert paper.simulation.noisy_channels["motion"] == {
        "interested": {"one": 0.76, "zero": 0.24},
        "not_interested": {"one": 0.29, "zero": 0.71},
    }
    forward = paper.pomdp.actions.index("move_forward")
    turned = paper.pomdp.states.index("not_interested_turned")
    assert paper.pomdp.observation[forward, turned, 0] == pytest.approx(0.1)
    assert authors.pomdp.observation[forward, turned, 0] == pytest.approx(0.9)
    np.testing.assert_allclose(paper.pomdp.reward[:3, -1], 0)
    np.testing.assert_allclose(authors.pomdp.reward[:3, -1], [-4, -2, -4.5])
    np.testing.assert_allclose(paper.simulation.feedback_model[:3, :4, 0], [[0.7, 0.3, 0.7, 0.3]] * 3)
    np.testing.assert_allclose(authors.simulation.feedback_model[:3, :4, 0], [[0.75, 0.25, 0.75, 0.25]] * 3)


def test_a_domain_with_three_values():
    rooms = load_domain(ROOMS)
    assert (rooms.values, rooms.planning.terminal) == (("lab", "office", "store"), (3,))
    assert rooms.preset == "calm"
    assert rooms.evidence({"badge": "staff"}, {"heading": "store"}) == {"badge": "staff", "heading": "right"}
    assert dict(rooms.label_marginal({"heading": "right"})) == {"lab": 0, "office": 0, "store": 1}
    assert rooms.label_marginal({"badge": "staff"}) is None
    likelihood = Likelihood(("store", "lab", "office"), [4, 2, 1])
    evidence = rooms.evidence({"badge": "staff"}, {"heading": likelihood})
    assert dict(evidence["heading"]) == {"right": 1, "left": 0.5, "ahead": 0.25}
    assert dict(rooms.label_marginal(evidence)) == pytest.approx(
        {"lab": 2 / 7, "office": 1 / 7, "store": 4 / 7}
    )
    with pytest.raises(DomainError, match="a likelihood over a, b; expected the classes lab, office, store"):
        rooms.evidence({}, {"heading": Likelihood(("a", "b"), [1, 1])})
    sure = Reasoner(rooms.soft_program()).posterior("goal", {"badge": "staff", "heading": "right"})
    assert sure["store"] == 1  # there the label equals the target
    assert (rooms.reported_value("to_office"), rooms.reported_value("point")) == ("office", None)
    assert rooms.report_action("store") == "to_store"
    np.testing.assert_array_equal(rooms.planning.initial_states, np.eye(3, 4))
    np.testing.assert_allclose(rooms.simulation.feedback_model[0, 0], [0.8, 0.1, 0.1, 0])
    np.testing.assert_allclose(
        load_domain(ROOMS, preset="hectic").simulation.feedback_model[0, 0], [0.6, 0.2, 0.2, 0]
    )
    # goal=lab has .7 for staff; the other headings share what 'left' leaves
    channel = rooms.simulation.noisy_channels["heading"]
    assert channel["lab"] == pytest.approx({"left": 0.8, "ahead": 0.1, "right": 0.1})


def test_a_new_confusion_matrix_gives_a_new_program():
    rooms = load_domain(ROOMS)
    before = str(rooms.program)
    confusion = ConfusionMatrix(("lab", "office", "store"), np.array([[9, 0, 0], [4, 4, 1], [0, 0, 9]]))
    assert str(rooms.program_for({"heading": confusion})) != before
    assert str(rooms.program) == before


def test_start_beliefs_cover_the_simplex_and_the_priors_of_all_evidence():
    rooms = load_domain(ROOMS)
    starts = rooms.start_beliefs()
    np.testing.assert_allclose(starts.sum(axis=1), 1)
    for corner in np.eye(3, 4):
        assert (starts[1:37] == corner).all(axis=1).any()  # a grid in sevenths
    reasoner, observed = Reasoner(rooms.program), rooms.reasoning.observed_values
    for badge, weekday, heading in product(observed["badge"], observed["weekday"], (None, "left", "right")):
        evidence = {"badge": badge, "weekday": weekday} | ({"heading": heading} if heading else {})
        prior = rooms.prior(reasoner.posterior("goal", evidence))
        assert np.abs(starts[37:] - prior).max(axis=1).min() < 1e-11


def test_starts_have_the_priors_of_the_labels_alone():
    """Those of L+P, proportional to the rates of the label."""
    domain = load_domain("intention", preset="paper")
    starts = domain.list_starts()
    assert starts.are_complete
    for rates in ((0.76, 0.29), (0.24, 0.71)):
        prior = np.array(rates) / sum(rates)
        assert np.abs(starts.labels_alone @ domain.planning.state_values - prior).max(axis=1).min() < 1e-11
    assert not load_domain("museum").list_starts().are_complete  # two senses: too many priors


def test_the_policy_is_as_good_at_the_priors_of_evidence_as_requested():
    domain = load_domain("intention", preset="paper")
    times = ("morning", "afternoon", "evening")
    solution, reasoner = solve(domain.pomdp, domain.start_beliefs(), precision=0.01), Reasoner(domain.program)
    for time, location, label in product(times, ("library", "classroom"), ("one", "zero")):
        evidence = {"time": time, "location": location, "classifier": label}
        assert solution.gap(domain.prior(reasoner.posterior("intention", evidence))) <= 0.01 + 1e-9


def test_shipped_domains_load_by_name():
    assert list_domains() == ("engagement", "intention", "museum", "shopping")
    with pytest.raises(
        DomainError,
        match=r"nowhere: no folder with a domain\.toml, and no shipped domain; expected one of engagement",
    ):
        load_domain("nowhere")


TOML, PLOG, POMDP = "domain.toml", "badges.plog", "guide.pomdp"

WRONG_TOML = [
    ('target = "goal"', 'target = "gaol"', r"domain\.toml:7: \[reasoning\] target: .*badges\.plog has no"),
    ('"weekday"]', '"week"]', r"domain\.toml:6: \[reasoning\] observed: .*no attribute 'week'"),
    ('"badge", "weekday"', '"badge", "badge"', r"a name is repeated"),
    ('"badge", "weekday"', '"badge", "goal"', r"'goal' is in \[reasoning\] target, so it cannot be observed"),
    (
        "left = ",
        "wrong = ",
        r"domain\.toml:11: .*'wrong' is not among the values of heading at .*badges\.plog:5",
    ),
    (
        '"store" }\ntracks',
        '"attic" }\ntracks',
        r"'attic' is not among the values of goal at .*badges\.plog:5",
    ),
    ('"store" }\ntracks', '"lab" }\ntracks', r"'store' is missing|two labels claim"),
    ("tracks = 60", "tracks = 2", r"domain\.toml:12: \[learning\] tracks: expected a whole number of at"),
    ("tracks = 60", "tracks = true", r"\[learning\] tracks: expected a whole number"),
    ("wants_{goal}", "{goal}", r"domain\.toml:16: .* makes 'lab', which is not a state of .*guide\.pomdp:3"),
    ("wants_{goal}", "wants", r"has to name each of goal in\s+braces"),
    ("wants_{goal}", "wants_{goal", r"\[planning\] states: 'wants_\{goal'"),
    ('terminal = "gone"', 'terminal = "away"', r"guide\.pomdp:3 has no state 'away'"),
    ('terminal = "gone"\n', "", r"guide\.pomdp:3: state 'gone' is neither made by"),
    (
        "to_lab =",
        "to_lob =",
        r"domain\.toml:20: .*guide\.pomdp:4 has no action 'to_lob'; expected one of point",
    ),
    ('to_lab = "lab"', 'to_lab = "den"', r"goal cannot be 'den' \(.*badges\.plog:5\)"),
    (
        "[planning.reports]",
        "[planning.phrases]\nfly = 'flies'\n[planning.reports]",
        r"domain\.toml:20: \[planning\.phrases\] fly: .*has no action or observation 'fly'; expected one of",
    ),
    (
        "[planning.reports]",
        "[planning.utterances]\nfly = ['go']\n[planning.reports]",
        r"\[planning\.utterances\] fly: .* has no observation 'fly'; expected one of",
    ),
    (
        "[planning.reports]",
        "[planning.utterances]\nyes = ['go  on']\n[planning.reports]",
        r"'go  on' is not a sentence; expected words of letters and apostrophes with one space",
    ),
    (
        "[planning.reports]",
        "[planning.utterances]\nyes = ['go', 'Go']\n[planning.reports]",
        r"'go' is already a sentence of 'yes'; expected each sentence once",
    ),
    (
        "[planning.reports]",
        "[planning.utterances]\nyes = 'go'\n[planning.reports]",
        r"yes: expected a list of names",
    ),
    ("[planning.reports]", "[planning.phrases]\npoint = 1\n[planning.reports]", r"point: expected a text"),
    ('to_lab = "lab"\n', "", r"\[planning\] reports: no action reports 'lab'"),
    ('store = "shrug"', 'store = "nod"', r"guide\.pomdp:5 has no observation 'nod'"),
    (
        'store = "shrug"',
        'store = "silence"',
        r"people may answer 'silence' to 'point', but .*guide\.pomdp gives it probability 0",
    ),
    ('lab = "yes", ', "", r"\[simulation\] feedback: 'lab' is missing"),
    ("noise = 0.2", "noise = 1.2", r"domain\.toml:27: .*expected a number from 0 to 1, not 1\.2"),
    ("noise = 0.2", "nose = 0.2", r"domain\.toml:27: \[simulation\] nose: unknown key; expected one of"),
    ("noise = 0.2", 'noise = 0.2\ntruth = "none.plog"', r"none\.plog: cannot be read"),
    ("noise = 0.4", "noise = -1", r"\[simulation\] noise: expected a number from 0 to 1"),
    ("[reasoning]", "[reasning]", r"reasoning is missing"),
    ("[learning]\n", "[learning\n", r"domain\.toml:9:\d+: "),
    ('name = "rooms"', "name = ", r"domain\.toml:1:8: "),
    ('people = "people.py"', 'people = "crowd.py"', r"crowd\.py: there is no such file"),
    (
        "noise = 0.2\n",
        "noise = 0.2\n[simulation.channel]\nlab = { left = 1 }\n",
        r"channel: 'office' is missing",
    ),
    ("wants_{goal}", "{goal:>99999999999}", r"has to name each of goal"),
    ("wants_{goal}", "{goal!r}", r"has to name each of goal"),
    ("noise = 0.2", "noise = " + "9" * 5000, r"domain\.toml: cannot be read"),
    ("noise = 0.2", "noise = " + "[" * 5000, r"domain\.toml"),
    ('"guide.pomdp"', '"a\\u0000b"', r"cannot be read: embedded null byte"),
]
WRONG_PLOG = [
    ("random(goal)", "random(gaol)", r"badges\.plog:6:\d+: .*gaol"),
    ("3/5", "8/5", r"badges\.plog:7:\d+: "),
]
WRONG_POMDP = [
    ("0.8 0.1 0.1 0\n", "0.8 0.1 0.2 0\n", r"guide\.pomdp:13:1: .*sums to 1\.1"),
    (
        "R: point : * : * : * -1",
        "R: point : * : * : * -1e308",
        r"guide\.pomdp: a reward of 1e\+308 at discount",
    ),
    ("to_store\n", "to_store extra\n", r"guide\.pomdp"),
]
TABLES = {TOML: WRONG_TOML, PLOG: WRONG_PLOG, POMDP: WRONG_POMDP}
WRONG = [(file, *row) for file, rows in TABLES.items() for row in rows]


@pytest.mark.parametrize(
    ("file", "old", "new", "words"), WRONG, ids=[f"{w[0]}-{i}" for i, w in enumerate(WRONG)]
)
def test_inconsistent_files_are_located(folder, file, old, new, words):
    edit(folder / file, old, new)
    with pytest.raises(LcorppError, match=words):
        load_all(folder)


def test_unknown_presets_and_missing_files(folder):
    for preset in ("wild", "calm,wild"):
        with pytest.raises(DomainError, match="unknown preset 'wild'; expected one of calm, hectic"):
            load_domain(folder, preset=preset)
    with pytest.raises(DomainError, match="unknown preset ''"):
        load_domain(folder, preset="calm,")
    with pytest.raises(DomainError, match="preset 'calm' is there twice"):
        load_domain(folder, preset="calm,calm")
    (folder / POMDP).unlink()
    with pytest.raises(FileError, match=r"guide\.pomdp: cannot be read"):
        load_domain(folder)


def test_presets_are_merged_in_their_order(folder):
    text = (folder / TOML).read_text()
    (folder / TOML).write_text(
        f"{text}\n[presets.quiet.simulation]\nnoise = 0.03\n[presets.wrong.simulation]\nnoise = 7\n"
    )
    both, other = load_domain(folder, preset="hectic, quiet"), load_domain(folder, preset="quiet,hectic")
    assert (both.preset, other.preset) == ("hectic,quiet", "quiet,hectic")
    hectic = load_domain(folder, preset="hectic")
    changed = load_domain(folder, preset="hectic", changes={"simulation": {"noise": 0.03}})
    for one, same in ((both, changed), (other, hectic)):
        np.testing.assert_array_equal(one.simulation.feedback_model, same.simulation.feedback_model)
    assert (changed.simulation.feedback_model != hectic.simulation.feedback_model).any()
    line = len(text.splitlines()) + 5
    with pytest.raises(LcorppError, match=rf"domain\.toml:{line}: .*noise"):
        load_domain(folder, preset="hectic,wrong")


def test_rows_of_a_channel_sum_to_1(folder):
    edit(
        folder / TOML,
        "noise = 0.2\n",
        "noise = 0.2\n[simulation.channel]\n"
        + "".join(
            f"{goal} = {{ left = 0.5, ahead = 0.2, right = 0.2 }}\n" for goal in ("lab", "office", "store")
        ),
    )
    with pytest.raises(DomainError, match=r"domain\.toml:29: .*lab: the probabilities sum to 0\.9, not 1"):
        load_domain(folder)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def trajectory(person, rng)\n    pass\n", r"people\.py:1: cannot be loaded: SyntaxError"),
        ("import numpy\nraise RuntimeError('no')\n", r"people\.py:2: cannot be loaded: RuntimeError: no"),
        ("import sys\nsys.exit(3)\n", r"people\.py:2: cannot be loaded: SystemExit: 3"),
        ("x = 1\n", r"people\.py: defines none of trajectory, trajectories, reaction"),
    ],
)
def test_a_people_file_that_cannot_be_loaded(folder, text, words):
    (folder / "people.py").write_text(text)
    with pytest.raises(DomainError, match=words):
        load_domain(folder)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "def trajectory(p, rng):\n    return p['no']\n",
            r"people\.py:2: trajectory\(\) failed: KeyError: 'no'",
        ),
        (
            "def trajectory(p, rng):\n    return [1, 2]\n",
            r"expected signals of shape \(2, channels, time points\), not \(2, 2\)",
        ),
        ("def trajectories(p, rng):\n    return [[[1.0, float('nan')]]] * 2\n", r"is not a number"),
        (
            "import numpy as np\ndef trajectory(p, rng):\n    return np.zeros((1 + len(p['goal']), 3))\n",
            "not of unequal shapes",
        ),
        ("def trajectories(p, rng):\n    return 3\n", "not of unequal shapes"),
        ("def trajectories(p, rng):\n    return [[[1.0], [2.0]]]\n", r"not \(1, 2, 1\)"),
    ],
)
def test_a_people_file_that_fails_when_called(folder, text, words):
    (folder / "people.py").write_text(text)
    simulate = load_domain(folder).simulation.signals["heading"]
    with pytest.raises(DomainError, match=words):
        simulate([{"goal": "lab"}, {"goal": "store"}], np.random.default_rng(0))


def test_simulated_tracks_of_unequal_length(folder):
    (folder / "people.py").write_text(
        "import numpy as np\n"
        "def trajectory(p, rng):\n"
        "    return rng.normal(size=(2, int(rng.integers(60, 300)))).cumsum(axis=1)\n"
    )
    domain = load_domain(folder)
    data = simulate_training_data(domain, domain.senses[0], 0)
    assert len(set(data.dataset.lengths.tolist())) > 20
    signals = data.signals.simulate([{"goal": "lab"}] * 3, np.random.default_rng(0))
    rng = np.random.default_rng(0)
    for signal in signals:
        assert np.array_equal(strip_padding(signal), domain.simulation.signals["heading"]([{}], rng)[0])
    setup = train_classifier(domain, domain.senses[0], TrainingOptions("summaries"))
    assert set(setup.classifier.classify_many(signals)) <= {"lab", "office", "store"}


def test_unknown_evidence():
    rooms = load_domain(ROOMS)
    with pytest.raises(DomainError, match="'mood' is not observed in rooms; expected one of badge, weekday"):
        rooms.evidence({"mood": "good"}, {})
    with pytest.raises(DomainError, match="badge cannot be 'king'; expected one of staff, guest"):
        rooms.evidence({"badge": "king"}, {})
    with pytest.raises(DomainError, match="unknown class 'left'; expected one of lab, office, store"):
        rooms.evidence({}, {"heading": "left"})


def test_a_preset_of_a_missing_table(folder):
    (folder / TOML).write_text("presets = 3\n")
    with pytest.raises(DomainError, match="expected a table of tables"):
        load_domain(folder)
    (folder / TOML).write_text('name = "a\n')
    with pytest.raises(ParseError, match=r"domain\.toml:1:"):
        load_domain(folder)


def test_the_domain_sets_the_interval_of_simulated_tracks(folder):
    edit(folder / TOML, "tracks = 60", "tracks = 60\ninterval = 0.45")
    changed = load_domain(folder)
    (before,), (after,) = load_domain(ROOMS).senses, changed.senses
    assert (before.interval, after.interval) == (0.033, 0.45)
    assert simulate_training_data(changed, after, 0).dataset.interval == 0.45
    edit(folder / TOML, "0.45", "0")
    with pytest.raises(DomainError, match="interval"):
        load_domain(folder)


def test_repr_is_one_line():
    domain = load_domain("intention")
    assert repr(domain) == (
        "Domain('intention', preset 'paper': observes time, location; senses motion; shares intention"
        " (interested, not_interested); POMDP with 5 states, 5 actions, 3 observations)"
    )
    html = domain._repr_html_()
    assert "<td>shared</td><td>intention: interested, not_interested</td>" in html
    assert "<td>sense motion</td>" in html
    for section in (domain.reasoning, *domain.senses, domain.planning, domain.simulation):
        assert "array" not in repr(section)
        assert "\n" not in repr(section)


def test_a_domain_is_a_folder_or_a_name():
    with pytest.raises(DomainError, match="the domain is 3; expected str or Path"):
        load_domain(3)


def test_keys_of_the_file_can_be_changed():
    domain = load_domain("intention", preset="authors", changes={"simulation": {"noise": 0.1}})
    answers = domain.simulation.feedback_model[domain.pomdp.action_index("greet")]
    state, answer = domain.pomdp.state_index("interested_turned"), domain.pomdp.observation_index("neg")
    assert answers[state, answer] == pytest.approx(0.1)
    with pytest.raises(
        DomainError, match=r"domain\.toml:\d+: \[simulation\] noise: expected a number from 0"
    ):
        load_domain("intention", changes={"simulation": {"noise": 2}})


def test_lines_of_quoted_keys(tmp_path):
    (file := tmp_path / "sweep.toml").write_text('[axes]\npr."a=b | c.d = e" = [1]\n"x.y".z = 2\n')
    table = read_toml(file).section("axes", required=True)
    assert table.location("pr", "a=b | c.d = e").startswith(f"{file}:2: ")
    assert table.location("x.y", "z").startswith(f"{file}:3: ")
