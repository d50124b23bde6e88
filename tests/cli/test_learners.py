"""`lcorpp run` with any learner, with soft evidence and with thresholds."""

import json
from pathlib import Path

import pytest

from tests.cli.test_bad_input import refused

pytestmark = pytest.mark.usefixtures("unrendered")

ROOMS = Path(__file__).parents[1] / "domains/rooms"
FEW = ("--trials", 20, "--tracks", 60, "--jobs", 1, "--strategy", "L+R")
NAMES = ["summaries", pytest.param("forest", marks=pytest.mark.slow), "lstm", "lstm-fast"]


@pytest.mark.parametrize("name", NAMES)
def test_every_learner_gives_the_same_report(lcorpp, tmp_path, name):
    """Shows 6."""
    passes = ("--epochs", 2) if name in ("lstm", "lstm-fast") else ()
    ended = lcorpp("run", *FEW, "--learner", name, *passes, "--out", tmp_path)
    assert ended.code == 0, ended.err
    for words in (
        f"{name}, five-fold cross-validation on",
        "true class interested (30 cases); predicted",
        "AUC",
        "best youden",
    ):
        assert words in ended.out
    content = json.loads((tmp_path / "report.json").read_text())
    assert list(content["classes"]["interested"]) == [
        *("cases", "auc", "roc", "raw", "calibrated", "thresholds")
    ]
    assert content["classes"]["interested"]["thresholds"][0]["prevalence"] == pytest.approx(0.4)  # as known
    assert (tmp_path / "report.png").exists()
    assert (
        json.loads((tmp_path / "results.json").read_text())["configuration"]["senses"]["motion"]["classifier"]
        == name
    )
    kept = (tmp_path / "classifier.npz").exists()
    assert kept != ("the classifier will not be saved" in ended.out)


def test_seconds_and_rate(lcorpp, tmp_path):
    """Two seconds at two points per second are five points."""
    file = tmp_path / "mine.py"
    file.write_text(
        "from sklearn.dummy import DummyClassifier\n"
        "from sklearn.pipeline import make_pipeline\n"
        "from lcorpp.learning import Motion\n"
        "class Points(DummyClassifier):\n"
        "    def fit(self, X, y, sample_weight=None):\n"
        "        assert X.shape[2] == 5, X.shape\n"
        "        return super().fit(X, y, sample_weight)\n"
        "    def predict_proba(self, X):\n"
        "        assert X.shape[2] == 5, X.shape\n"
        "        return super().predict_proba(X)\n"
        "def points(rate):\n    return make_pipeline(Motion(rate=rate), Points())\n"
    )
    short = ("--learner", f"{file}:points", "--seconds", 2.05, "--rate", 2, "--jobs", 1)
    for command in (
        ("run", *FEW),
        ("explain", "--tracks", 60),
        ("learn", "--tracks", 60, "--max-batches", 1),
    ):
        ended = (
            lcorpp(*command, *short, "--out", tmp_path) if command[0] == "run" else lcorpp(*command, *short)
        )
        assert ended.code == 0, ended.err
    sense = json.loads((tmp_path / "results.json").read_text())["configuration"]["senses"]["motion"]
    assert (sense["rate"], sense["seconds"]) == (2, 2.05)
    for wrong, words in (
        (("--rate", 0), "'--rate': 0.0 is not in the range"),
        (("--seconds", -1), "'--seconds': -1.0 is not in the range"),
        (("--rate", 2, "--learner", "logistic"), "points at a rate are computed from motion; the data are"),
        (("--seconds", 2, "--classifier", "channel"), "--seconds: nothing is trained"),
        (("--seconds", 0.3, "--learner", "summaries", "--tracks", 40), "needs more than 0.333 s"),
    ):
        refused(lcorpp("run", *wrong, "--jobs", 1), words)


def test_a_learner_of_the_users_file(lcorpp, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("from sklearn.dummy import DummyClassifier\ndef guess():\n    return DummyClassifier()\n")
    ended = lcorpp("run", *FEW, "--learner", f"{file}:guess")
    assert ended.code == 0, ended.err
    assert "mine.py:guess, five-fold cross-validation on" in ended.out


@pytest.mark.parametrize("kind", ["soft", "set:0.8"])
def test_evidence_now_and_from_the_file(lcorpp, tmp_path, kind):
    soft = (*FEW, "--evidence", kind)
    first = lcorpp("run", *soft, "--learner", "summaries", "--out", tmp_path)
    assert first.code == 0, first.err
    assert json.loads((tmp_path / "results.json").read_text())["configuration"]["evidence"] == kind
    assert ("\nprediction sets of coverage 0." in first.out) == (kind != "soft")
    again = lcorpp(
        "run",
        "--trials",
        20,
        "--jobs",
        1,
        "--strategy",
        "L+R",
        "--evidence",
        kind,
        "--classifier",
        tmp_path / "classifier.npz",
    )
    assert again.code == 0, again.err
    rows = [[line for line in ended.out.splitlines() if "L+R" in line] for ended in (first, again)]
    assert rows[0] == rows[1]
    assert len(rows[0]) == 1
    report = json.loads((tmp_path / "report.json").read_text())["prediction_sets"]
    assert report["coverage"] == (0.8 if kind == "set:0.8" else 0.95)
    assert list(report["covered"]) == ["interested", "not_interested"]
    shown = lcorpp("explain", "--evidence", kind, "--classifier", tmp_path / "classifier.npz").out
    assert (f"     prediction set of {report['coverage']}: " in shown) == (kind != "soft")
    other = lcorpp("run", "--evidence", "set:0.9", "--classifier", tmp_path / "classifier.npz")
    refused(other, f"prediction sets of coverage {report['coverage']}, not 0.9")


@pytest.mark.parametrize("kind", ["soft", "set"])
def test_soft_evidence_of_three_rooms(lcorpp, kind):
    ended = lcorpp("run", ROOMS, *FEW, "--learner", "summaries", "--evidence", kind)
    assert ended.code == 0, ended.err
    assert "true class lab (20 cases); predicted" in ended.out


def test_a_threshold_is_chosen_or_given(lcorpp):
    chosen = lcorpp("run", *FEW, "--learner", "summaries", "--threshold", "accuracy", "--prevalence", 0.02)
    assert chosen.code == 0, chosen.err
    assert "best thresholds for the prevalence: interested 0.02" in chosen.out
    costly = lcorpp("run", *FEW, "--learner", "summaries", "--threshold", "9:1")
    assert costly.code == 0, costly.err
    assert "least cost" in costly.out
    given = lcorpp("run", *FEW, "--learner", "summaries", "--threshold", 0)
    assert "decision threshold: interested from probability 0.000 on" in given.out
    assert "true class not_interested (30 cases); predicted: interested 1.000" in given.out


def test_smoothing_and_features(lcorpp):
    common = (*FEW, "--learner", "summaries", "--threshold", 0)
    hard = lcorpp("run", *common, "--smoothing", "laplace", "--features", "x,y,velocity")
    assert hard.code == 0, hard.err
    assert "predicted: interested 1.000 [0.888, 1.000]" in hard.out  # Beta(31, 1)
    assert "predicted: interested 1.000 [0.920, 1.000]" in lcorpp("run", *common).out  # Beta(30.5, .5)


def test_explain_with_a_likelihood(lcorpp):
    facts = ("explain", "--fact", "time=afternoon", "--fact", "location=classroom", "--seed", 1)
    ended = lcorpp(*facts, "--likelihood", "one=0.24", "--likelihood", "zero=0.71")
    assert ended.code == 0, ended.err
    for words in (
        "scaled to a maximum of 1",
        "0.359531",
        "0.220250",
    ):  # as the label of rates .24 and .71 would have it
        assert words in ended.out


def test_wrong_options_end_in_one_message(lcorpp, tmp_path):
    refused(lcorpp("run", "--learner", "lstn"), "unknown learner 'lstn'; expected one of lstm, lstm-fast")
    refused(
        lcorpp("run", "--learner", "forest", "--epochs", 3, "--tracks", 40, "--jobs", 1), "makes no passes"
    )
    refused(
        lcorpp("run", "--learner", "forest", "--device", "cuda", "--tracks", 40, "--jobs", 1),
        "on the cpu only",
    )
    refused(lcorpp("run", "--learner", "lstm", "--device", "tpu", "--tracks", 40, "--jobs", 1), "'tpu'")
    refused(lcorpp("run", "--learner", "lstm", "--classifier", "channel"), "both choose the classifier")
    refused(lcorpp("run", "--classifier", "channel", "--evidence", "soft"), "a channel has labels only")
    refused(lcorpp("run", "--classifier", "channel", "--epochs", 2), "--epochs: nothing is trained")
    refused(lcorpp("run", "--classifier", tmp_path / "x.npz", "--threshold", "f1"), "nothing is trained")
    refused(lcorpp("run", "--classifier", tmp_path / "x.npz", "--features", "x"), "--features: nothing")
    refused(lcorpp("run", "--evidence", "soft", "--smoothing", "laplace"), "labels of a trained classifier")
    refused(lcorpp("run", "--learner", "lstm", "--features", "x,z", "--tracks", 40, "--jobs", 1), "'z'")
    refused(lcorpp("run", "--learner", "lstm", "--features", "facing", "--tracks", 40, "--jobs", 1), "facing")
    refused(lcorpp("run", "--evidence", "firm"), "firm")
    refused(lcorpp("run", *FEW, "--learner", "summaries", "--threshold", "speed"), "unknown goal 'speed'")
    refused(lcorpp("run", *FEW, "--learner", "summaries", "--threshold", "1:2:3"), "unknown goal '1:2:3'")
    refused(lcorpp("run", *FEW, "--learner", "summaries", "--threshold", "0:0"), "not both 0")
    refused(
        lcorpp("run", *FEW, "--learner", "summaries", "--threshold", "nan"), "threshold of interested is nan"
    )
    refused(lcorpp("run", *FEW, "--learner", "summaries", "--threshold", 7), "threshold of interested is 7")
    refused(lcorpp("run", ROOMS, *FEW, "--learner", "summaries", "--threshold", "f1"), "3 classes: name one")
    refused(lcorpp("run", "--prevalence", 0), "--prevalence")
    refused(lcorpp("explain", "--likelihood", "one"), "expected VALUE=NUMBER")
    refused(lcorpp("explain", "--likelihood", "one=1", "--likelihood", "one=2"), "given twice")
    refused(lcorpp("explain", "--likelihood", "two=1"), "--likelihood 'two'", "one, zero")
    refused(lcorpp("explain", "--likelihood", "one=-1"), "expected finite weights")
    refused(lcorpp("explain", "--likelihood", "one=1", "--label", "one"), "expected one")
