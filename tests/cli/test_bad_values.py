"""Values of options and of data that fit no decision: one message that names them, and exit code 2."""

import re

import pytest

from tests.cli.planner import AUTHORS

FLAGS = ("--fact", "time=morning,evening", "--shared", "item=tea,book", "--shared", "room=lab,hall")
WORLD = "def make(person, rng):\n    return None\n"


@pytest.fixture
def errands(lcorpp, tmp_path):
    """A domain with two shared variables and one sense."""
    assert lcorpp("new", tmp_path / "errands", *FLAGS, "--sense", "gaze:item:0.9").code == 0
    return tmp_path / "errands"


def refused(ended, *words):
    assert ended.code == 2
    assert "Traceback" not in ended.err
    message = ended.err.partition("lcorpp: ")[2]
    assert message.count("\n") <= 3, message
    for word in words:
        assert re.search(word, message), message


@pytest.mark.parametrize("command", ["run", "learn", "explain", "solve"])
def test_a_precision_is_finite_and_positive(lcorpp, tmp_path, command):
    model = (AUTHORS, "-o", tmp_path / "a.policy") if command == "solve" else ()
    for value in ("inf", "nan", "0", "-1"):
        ended = lcorpp(command, *model, "--precision", value)
        refused(ended, rf"the precision is {value}(\.0)?; expected a finite positive number")


def test_a_precision_in_domain_toml_is_finite(lcorpp, errands):
    toml = errands / "domain.toml"
    toml.write_text(toml.read_text().replace("precision = 0.01", "precision = inf"))
    refused(lcorpp("check", errands), r"domain.toml:\d+: \[planning\] precision: expected a number from")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ("--solver", "qmdp", "--time-limit", 0.1),
            r"the solver qmdp ended \(.*\) with a gap of \d+; it assumes that one action reveals"
            r" the state, so it cannot value information; choose another one, e\.g\. --solver sarsop",
        ),
        (
            ("--time-limit", "1e-9", "--no-cache"),
            r"the solver sarsop ended \(time limit\) with a gap of \d+; a better policy may exist: give more"
            r" time \(--time-limit\)",
        ),
    ],
)
def test_a_policy_that_never_reports_is_explained(lcorpp, errands, options, words):
    prior = r"does not report from the prior \(tea, lab\): 0\.25, \(tea, hall\): 0\.25, "
    ended = lcorpp("explain", errands, *options)
    refused(ended, r"strategy 'LCORPP': no report after 500 actions; .* from the prior \(tea, lab\)", words)
    if "--no-cache" in options:  # the words do not depend on the command
        return
    ended = lcorpp("run", errands, "--trials", 9, "--jobs", 1, *options)
    refused(ended, r"strategy 'P': no report after 500 actions; the last one was 'ask_", prior, words)
    ended = lcorpp("run", errands, "--exact", *options)  # the strategies that do not plan have their scores
    assert (ended.code, " R  " in ended.out, " P  " in ended.out) == (0, True, False)
    assert re.search(
        f"P has no exact scores: strategy 'P': no report after 500 actions; .* {prior}", ended.err
    )
    assert re.search(words, ended.err)


def test_a_given_policy_that_never_reports_is_explained(lcorpp, errands, tmp_path):
    from lcorpp.domains import load_domain
    from lcorpp.planning import solve, write_policy

    write_policy(solve(load_domain(errands).pomdp, precision=1e6).policy, tmp_path / "a.policy")
    ended = lcorpp("run", errands, "--trials", 9, "--jobs", 1, "--policy", tmp_path / "a.policy")
    refused(ended, "strategy 'P': no report", "; expected a policy that reports, with --policy or by solving")


def test_exact_scores_and_a_world_exclude_each_other(lcorpp, errands, tmp_path):
    (tmp_path / "w.py").write_text(WORLD)
    ended = lcorpp("run", errands, "--exact", "--world", f"{tmp_path / 'w.py'}:make")
    refused(
        ended, "^--world: --exact needs the probabilities of the answers, which a world of your own does not"
    )


def write_table(file, heading, labels):
    rows = [f"{number},{number % 7},{label}\n" for number, label in enumerate(labels)]
    file.write_text("".join([heading, *rows]))
    return file


def test_a_table_without_a_class_is_refused(lcorpp, errands, tmp_path):
    data = write_table(tmp_path / "a.csv", "x,y,label\n", 40 * ["tea"])
    ended = lcorpp("run", errands, "--learner", "logistic", "--data", data)
    refused(
        ended, r"a\.csv: no cases of class book; expected cases of each class of item, found tea 40, book 0"
    )


def test_a_heading_without_a_column_is_refused(lcorpp, errands, tmp_path):
    data = write_table(tmp_path / "a.csv", "x,label\n", 20 * ["tea", "book"])
    ended = lcorpp("run", errands, "--learner", "logistic", "--data", data)
    refused(
        ended, r"a\.csv:1:1: 2 columns, x, label, but the first row has 3: 'tea' has no name; expected a name"
    )
    assert "repair" not in ended.err
    data = write_table(tmp_path / "b.csv", "x,y,kind\n", 20 * ["tea", "book"])
    ended = lcorpp("run", errands, "--learner", "logistic", "--data", data)
    refused(ended, r"b\.csv:1:1: no column 'track', and no column 'label'; expected")


def test_rows_without_a_person_are_noted_once(lcorpp, errands, tmp_path):
    note = (
        "note: no column group or person: each row counts as a person of its own, also when people are split"
    )
    data = write_table(tmp_path / "a.csv", "x,y,label\n", 20 * ["tea", "book"])
    command = ("run", errands, "--learner", "logistic", "--trials", 20, "--jobs", 1, "--data")
    for ended in (lcorpp("data", "describe", data), lcorpp(*command, data)):
        assert (ended.code, ended.out.count(note)) == (0, 1)
    data = write_table(tmp_path / "b.csv", "x,person,label\n", 20 * ["tea", "book"])
    for ended in (lcorpp("data", "describe", data), lcorpp(*command, data)):
        assert (ended.code, ended.out.count("no column")) == (0, 0)
