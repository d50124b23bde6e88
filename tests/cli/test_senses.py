"""Senses with data of their own: tables of features, own pipelines, and options by sense, by flags only."""

import csv
import json
import shutil
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lcorpp.assembly import TrainingOptions, train_classifier
from lcorpp.cli.options.senses import choose_evidence
from lcorpp.domains import load_domain
from lcorpp.errors import DomainError, LcorppError
from lcorpp.reasoning import Reasoner
from lcorpp.values import ConfusionMatrix, EvidenceKind
from tests.cli.test_bad_input import refused
from tests.domains.deliveries import GAZE, VOICE, write_domain

pytestmark = pytest.mark.usefixtures("unrendered")

DRINKS = Path(__file__).parents[2] / "examples" / "drinks"
PIPELINE = """
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler


def pipeline():
    return make_pipeline(StandardScaler(), LogisticRegression())
"""
FEW = ("--trials", 20, "--jobs", 1, "--strategy", "LCORPP")


def write_table(file, labels, *, cases=120, spread=0.4, seed=0):
    """Write features (cases, classes): that of the case's class is 1 larger; two rows for each person."""
    rng = np.random.default_rng(seed)
    with open(file, "w", newline="") as opened:
        rows = csv.writer(opened)
        rows.writerow([*(f"is_{label}" for label in labels), "label", "person"])
        for case in range(cases):
            own = case // 2 % len(labels)
            numbers = np.eye(len(labels))[own] + rng.normal(0, spread, len(labels))
            rows.writerow([*np.round(numbers, 4), labels[own], f"person {case // 2}"])
    return file


@pytest.fixture
def gaze(tmp_path):
    return write_table(tmp_path / "gaze.csv", ["tea", "coffee", "water"])


def read_results(folder):
    return json.loads((folder / "results.json").read_text())["configuration"]["senses"]


def test_a_table_of_features_with_an_own_pipeline(lcorpp, tmp_path, gaze):
    """A three-class table and a pipeline of scikit-learn, all by flags."""
    (tmp_path / "my.py").write_text(PIPELINE)
    own = f"{tmp_path / 'my.py'}:pipeline"
    ended = lcorpp(
        "run",
        DRINKS,
        "--data",
        gaze,
        "--learner",
        own,
        "--trials",
        60,
        "--jobs",
        1,
        "--out",
        tmp_path / "out",
    )
    assert ended.code == 0, ended.err
    assert "my.py:pipeline, five-fold cross-validation on gaze.csv: 84 cases of 42 people" in ended.out
    assert "84 of 120 cases are training data; the trials sample cases of the 18 other people" in ended.out
    content = json.loads((tmp_path / "out" / "results.json").read_text())
    sense = content["configuration"]["senses"]["gaze"]
    assert (sense["classifier"], sense["data"], sense["tracks"]) == (own, str(gaze), 84)
    accuracy = {row["strategy"]: row["accuracy"] for row in content["strategies"]}
    assert accuracy["L"] > 0.8 > accuracy["R"]
    assert (tmp_path / "out" / "report.json").exists()


def test_the_default_learner_of_a_table_is_stored_and_used_again(lcorpp, tmp_path, gaze):
    first = lcorpp("run", DRINKS, *FEW, "--data", gaze, "--out", tmp_path / "out")
    assert first.code == 0, first.err
    assert read_results(tmp_path / "out")["gaze"]["classifier"] == "logistic"
    stored = tmp_path / "out" / "classifier.npz"
    again = lcorpp("run", DRINKS, *FEW, "--data", f"gaze={gaze}", "--classifier", stored)
    assert again.code == 0, again.err
    rows = [[line for line in ended.out.splitlines() if "LCORPP" in line] for ended in (first, again)]
    assert rows[0] == rows[1]
    other = write_table(tmp_path / "other.csv", ["water", "coffee", "tea"])
    refused(
        lcorpp("run", DRINKS, *FEW, "--data", other, "--classifier", stored),
        "trained on is_tea, is_coffee, is_water; the data have is_water, is_coffee, is_tea",
    )


def test_soft_evidence_of_features(lcorpp, gaze):
    ended = lcorpp("run", DRINKS, *FEW, "--data", gaze, "--evidence", "soft")
    assert ended.code == 0, ended.err


def test_a_table_is_described(lcorpp, tmp_path, gaze):
    ended = lcorpp("data", "describe", gaze)
    assert ended.code == 0, ended.err
    for words in (
        "gaze.csv: 120 cases of 60 people; 3 features",
        "coffee      40      20",
        "feature    median [minimum, maximum]",
        "is_tea",
        "repeated cases: none",
    ):
        assert words in ended.out
    gaze.write_text(gaze.read_text() + "nan,1,1,tea,x\n")
    refused(lcorpp("data", "describe", gaze), "gaze.csv:122:1: the is_tea is missing or NaN")
    repaired = lcorpp("data", "describe", gaze, "--repair", "nonfinite", "--report", tmp_path / "r.csv")
    assert repaired.code == 0, repaired.err
    assert "nonfinite: 1 rows in 1 places" in repaired.out
    assert len((tmp_path / "r.csv").read_text().splitlines()) == 2
    refused(
        lcorpp("data", "plot", gaze, tmp_path / "x.svg", "--repair", "all"),
        "has no tracks of motion, but is_",
    )
    refused(lcorpp("data", "describe", gaze, "--gap", 3, "--repair", "all"), "has no tracks; --label-file")


def test_run_reads_what_describe_reads(lcorpp, gaze):
    """The same labels and repairs."""
    gaze.write_text(gaze.read_text().replace(",tea,", ",T,") + "nan,1,1,tea,x\n")
    options = ("--label", "T=tea", "--repair", "nonfinite")
    labels = ("--label", "coffee=coffee", "--label", "water=water")
    assert lcorpp("data", "describe", gaze, *options, *labels).code == 0
    ended = lcorpp("run", DRINKS, *FEW, "--data", gaze, *options)
    assert ended.code == 0, ended.err
    refused(lcorpp("run", DRINKS, *FEW, "--data", gaze), "unknown label 'T'")


def test_the_data_of_a_domain(lcorpp, tmp_path, gaze):
    """`data` and `classifier = "FILE.py:NAME"` are relative to the folder."""
    folder = tmp_path / "drinks"
    shutil.copytree(DRINKS, folder)
    shutil.copy(gaze, folder)
    (folder / "my.py").write_text(PIPELINE)
    toml = folder / "domain.toml"
    toml.write_text(
        toml.read_text().replace(
            "[planning]\n", 'data = "gaze.csv"\nclassifier = "my.py:pipeline"\n\n[planning]\n'
        )
    )
    ended = lcorpp("run", folder, *FEW, "--out", tmp_path / "out")
    assert ended.code == 0, ended.err
    sense = read_results(tmp_path / "out")["gaze"]
    assert (sense["classifier"], sense["data"]) == (f"{folder / 'my.py'}:pipeline", str(folder / "gaze.csv"))
    channel = lcorpp("run", folder, *FEW, "--classifier", "channel", "--exact")
    assert channel.code == 2  # --exact excludes --trials
    assert lcorpp("run", folder, "--classifier", "channel", "--exact", "--strategy", "R+P").code == 0
    for former, later, words in (
        ('"gaze.csv"', '"glance.csv"', r"domain.toml:\d+: \[learning\] data: no file or folder .*glance.csv"),
        ('"my.py:', '"your.py:', r"\[learning\] classifier: no file or folder .*your.py"),
        (
            '"my.py:pipeline"',
            '"forrest"',
            "unknown classifier 'forrest'; .* or one of your own as FILE.py:FUNC",
        ),
    ):
        original = toml.read_text()
        toml.write_text(original.replace(former, later))
        with pytest.raises(DomainError, match=words):
            load_domain(folder)
        toml.write_text(original)


@pytest.fixture
def two(tmp_path):
    """A domain with two senses, and a table for each."""
    senses = (GAZE + VOICE).replace('classifier = "channel"\n', "")
    write_table(tmp_path / "gaze.csv", ["tea", "soup"])
    write_table(tmp_path / "voice.csv", ["ann", "bob"], seed=1)
    return write_domain(tmp_path / "two", senses=senses)


def test_each_sense_has_its_own_data_learner_and_report(lcorpp, tmp_path, two):
    (tmp_path / "my.py").write_text(PIPELINE)
    own = f"{tmp_path / 'my.py'}:pipeline"
    options = (
        *("--data", f"gaze={tmp_path / 'gaze.csv'}", "--data", f"voice={tmp_path / 'voice.csv'}"),
        *("--learner", f"voice={own}", "--strategy", "LCORPP", "--strategy", "LCORPP-gaze"),
        *("--trials", 60, "--jobs", 1, "--format", "svg"),
    )
    ended = lcorpp("run", two, *options, "--out", tmp_path / "out")
    assert ended.code == 0, ended.err
    assert "classifier of gaze: logistic, five-fold cross-validation on gaze.csv" in ended.out
    assert "my.py:pipeline, five-fold cross-validation on voice.csv" in ended.out
    found = read_results(tmp_path / "out")
    assert [found[name]["classifier"] for name in ("gaze", "voice")] == ["logistic", own]
    assert [Path(found[name]["data"]).name for name in ("gaze", "voice")] == ["gaze.csv", "voice.csv"]
    for name in ("gaze", "voice"):
        assert (tmp_path / "out" / name / "report.json").exists()


def test_a_channel_beside_a_trained_sense(lcorpp, tmp_path, two):
    """A named choice takes precedence over one for all senses; only the trained sense gives likelihoods."""
    options = (*FEW, "--classifier", "channel", "--learner", "voice=logistic")
    voice = ("--data", f"voice={tmp_path / 'voice.csv'}")
    for evidence in ("hard", "soft"):
        ended = lcorpp("run", two, *options, *voice, "--evidence", evidence)
        assert ended.code == 0, ended.err
        assert "classifier of gaze: a noisy channel" in ended.out
        assert "classifier of voice: logistic" in ended.out
    refused(lcorpp("run", two, *options[2:], *voice, "--exact"), "--exact needs --classifier channel")
    without = lcorpp("run", two, "--exact", "--strategy", "LCORPP-voice", "--classifier", "channel")
    assert without.code == 0, without.err
    assert "classifier of voice" not in without.out


def test_each_sense_has_a_matrix_or_a_likelihood(lcorpp, tmp_path, two):
    data = [f"--data={name}={tmp_path / name}.csv" for name in ("gaze", "voice")]
    for evidence, kinds in (("voice=soft", ["hard", "soft"]), ("soft", ["soft", "soft"])):
        options = (f"--evidence={evidence}", "--out", tmp_path / "out", "--format", "svg")
        ended = lcorpp("run", two, *FEW, *data, *options)
        assert ended.code == 0, ended.err
        assert [sense["evidence"] for sense in read_results(tmp_path / "out").values()] == kinds
    refused(lcorpp("run", two, *FEW, *data, "--evidence", "firm"), "--evidence 'firm': expected one of hard")
    channel = ("--classifier", "gaze=channel", *data[1:])
    refused(
        lcorpp("run", two, *FEW, *channel, "--evidence", "gaze=soft"),
        "--evidence gaze=soft needs a trained classifier: a channel has labels only",
    )


def test_the_domain_has_an_evidence_that_the_command_overrules(tmp_path):
    domain = load_domain(write_domain(tmp_path / "domain", senses=GAZE + 'evidence = "set:0.9"\n' + VOICE))
    trained = {"gaze": TrainingOptions(), "voice": TrainingOptions()}
    sets, soft = EvidenceKind("set", 0.9), EvidenceKind("soft")
    assert choose_evidence(domain, trained, []) == {"gaze": sets}
    assert choose_evidence(domain, trained, ["voice=soft"]) == {"gaze": sets, "voice": soft}
    assert choose_evidence(domain, trained, ["soft", "gaze=hard"]) == {"voice": soft}
    assert choose_evidence(domain, trained, ["hard", "voice=set:0.9"]) == {"voice": sets}
    assert choose_evidence(domain, {"gaze": None, "voice": TrainingOptions()}, []) == {}  # a channel


def test_simulated_tracks_beside_recorded_data_are_refused(lcorpp, gaze):
    for command in (("run", DRINKS, *FEW), ("learn", DRINKS)):
        refused(lcorpp(*command, "--data", gaze, "--tracks", 50), "--tracks 50: nothing is simulated, as")


def test_a_log_of_labels_of_one_sense_and_likelihoods_of_another(lcorpp, tmp_path, two):
    data = [f"--data={name}={tmp_path / name}.csv" for name in ("gaze", "voice")]
    log = tmp_path / "log.jsonl"
    assert lcorpp("run", two, *FEW, *data, "--evidence", "voice=soft", "--log", log).code == 0
    parts = json.loads(log.read_text().splitlines()[0])["parts"]["classifiers"]
    assert {name: part["soft"] for name, part in parts.items()} == {"gaze": False, "voice": True}
    ended = lcorpp("replay", log, "--quiet")
    assert ended.code == 0, ended.out
    assert " 0 differences" in ended.out


def test_a_program_for_labels_of_one_sense_and_likelihoods_of_another(two):
    domain = load_domain(two)
    matrix = ConfusionMatrix(("tea", "soup"), np.array([[8.0, 2], [3, 7]]))
    mixed = domain.program_for(
        {"gaze": matrix, "voice": ConfusionMatrix(("ann", "bob"), np.eye(2))}, soft=["voice"]
    )
    assert mixed == domain.program_for({"gaze": matrix}, soft=["voice"])
    found = Reasoner(mixed).exact("voice", {"person": "ann"})
    assert found == {"low": 1, "high": 0}
    assert Reasoner(mixed).exact("gaze", {"item": "tea"})["left"] == Fraction(17, 22)


def test_options_that_belong_to_no_sense_are_refused(lcorpp, tmp_path, two, gaze):
    refused(
        lcorpp("run", two, "--data", gaze),
        "--data",
        "expected the name of a sense first, SENSE=FILE: gaze, voice",
    )
    refused(lcorpp("run", two, "--classifier", tmp_path / "c.npz"), "expected the name of a sense first")
    refused(lcorpp("run", two, "--learner", "nose=forest"), "no sense 'nose'; expected one of gaze, voice")
    refused(
        lcorpp("run", two, "--learner", "gaze=forest", "--learner", "gaze=lstm"), "'forest' is already given"
    )
    refused(
        lcorpp("run", two, "--learner", "forest", "--learner", "lstm"),
        "'forest' without a sense is already given",
    )
    refused(
        lcorpp("run", two, "--learner", "gaze=forest", "--classifier", "gaze=channel"),
        "--classifier channel and --learner forest both choose the classifier",
    )
    unused = ("--strategy", "LCORPP-gaze", "--learner", "gaze=forest")
    refused(lcorpp("run", two, *unused), "no strategy uses the sense gaze")
    refused(lcorpp("run", two, "--data", "gaze="), "--data 'gaze=': expected [SENSE=]VALUE, found no value")
    refused(lcorpp("run", two, "--classifier", ""), "--classifier '': expected [SENSE=]VALUE")
    refused(lcorpp("run", DRINKS, "--repair", "all"), "no recorded data are read; expected --data")
    refused(
        lcorpp("run", DRINKS, "--data", gaze, "--learner", "lstm"),
        "learner 'lstm' needs tracks over time; the data are features without time: is_tea, is_coffee, is_w",
    )


def test_simulated_features_have_names_or_numbers(tmp_path):
    """A people.py may simulate features; `channels` names them."""
    people = (
        "import numpy as np\ndef gaze(people, rng):\n"
        "    return rng.normal(size=(len(people), 2)) + [[p['item'] == 'tea', 0] for p in people]\n"
    )
    for channels, names in (("", ("1", "2")), ('channels = ["yaw", "pitch"]\n', ("yaw", "pitch"))):
        folder = tmp_path / f"named{len(channels)}"
        senses = GAZE.replace('classifier = "channel"\n', "tracks = 60\n" + channels)
        write_domain(folder, senses=senses, end='[simulation]\npeople = "people.py"\n')
        (folder / "people.py").write_text(people)
        domain = load_domain(folder)
        setup = train_classifier(domain, domain.senses[0], TrainingOptions())
        assert (setup.source, setup.unit, setup.trained.inputs) == ("logistic", "cases", names)
    toml = folder / "domain.toml"
    toml.write_text(toml.read_text().replace('"pitch"', '"pitch", "roll"'))
    domain = load_domain(folder)
    with pytest.raises(
        LcorppError, match=r"signals of 'gaze': 3 channels .*; `channels` in .learning. names"
    ):
        train_classifier(domain, domain.senses[0], TrainingOptions())


def test_a_sense_that_does_not_perceive_the_person_is_named(lcorpp):
    ended = lcorpp("explain", "intention", "--preset", "around", "--seed", 1)
    assert ended.code == 0, ended.err
    assert "side=aside" in ended.out
    assert "legs's classifier's label" in ended.out
    assert "no label: motion does not perceive the person" in ended.out
    assert "motion perceives 100% where side is ahead, 0% where side is aside" in ended.out
    assert "classifier = " not in ended.out.partition("reasoning")[2].partition("\n")[0]
