"""`lcorpp learn` and `lcorpp explain` with several senses: tracks and features, several shared variables."""

import csv

import numpy as np
import pytest

from lcorpp.assembly import TrainingOptions
from lcorpp.assembly.training_data import make_training_data
from lcorpp.domains import load_domain
from lcorpp.learning import learner, read_data, train_and_validate
from lcorpp.learning.store import Store, read_store
from lcorpp.runs.run_store import RunStore
from tests.cli.test_bad_input import refused
from tests.cli.test_learn import stored
from tests.domains.deliveries import write_learning_domain

pytestmark = pytest.mark.usefixtures("unrendered")

LEARN = ("--learner", "gaze=summaries", "--learner", "voice=logistic", "--tracks", 40, "--jobs", 1)
BATCHES = ("--batch-size", 4, "--epsilon", 0)


@pytest.fixture
def domain(tmp_path):
    return write_learning_domain(tmp_path / "deliveries")


def read_rows(folder):
    with (folder / "batches.csv").open() as file:
        return list(csv.DictReader(file))


def test_each_sense_is_retrained_on_its_own_labels(lcorpp, domain, tmp_path):
    """Three shared variables; the reports label the item by gaze and the person by voice.

    The last matrix is that of the initial data and the store, trained and cross-validated here.
    """
    paths = tmp_path / "s.tracks", tmp_path / "s-voice.tracks"
    out = tmp_path / "out"
    ended = lcorpp("learn", domain, *LEARN, *BATCHES, "--max-batches", 2, "--store", paths[0], "--out", out)
    assert ended.code == 0, ended.err
    assert "the reports label gaze, voice\n" in ended.out
    rows = read_rows(out)
    assert [(row["tracks_gaze"], row["tracks_voice"]) for row in rows] == [(n, n) for n in ("40", "44", "48")]
    assert [row["change"] for row in rows] == [
        str(max(float(row["change_gaze"]), float(row["change_voice"]))) for row in rows
    ]
    assert {"accuracy_item", "accuracy_person", "accuracy_room"} <= rows[0].keys()
    snapshots = [read_store(path) for path in paths]
    reports = [track.extra["simulated"]["report"] for track in snapshots[0]]
    assert [track.label for track in snapshots[0]] == [report[0] for report in reports]
    assert [track.label for track in snapshots[1]] == [report[1] for report in reports]
    assert [track.id for track in snapshots[0]] == [track.id for track in snapshots[1]]
    assert snapshots[0].trajectories().shape == (8, 2, 12)
    assert snapshots[1].trajectories().shape == (8, 2)
    for path, words in zip(
        paths, ("by report); 12 time points of x, y every", "features pitch, pace: OK"), strict=True
    ):
        assert words in lcorpp("check", path).out
    added = read_data(paths[1])
    assert (added.kind, added.channels, len(added)) == ("table", ("pitch", "pace"), 8)
    assert f"voice: 48 cases; recall: {compute_recall(domain, snapshots[1].dataset())}; change" in ended.out


def compute_recall(domain, added):
    """Train and cross-validate voice's classifier on the initial data and those of the store."""
    loaded = load_domain(domain)
    initial = make_training_data(loaded, loaded.find_sense("voice"), TrainingOptions(tracks=40), 0).dataset
    whole = initial.append(list(zip(added.trajectories, added.labels, strict=True)), added.groups)
    estimator = learner("logistic", inputs=whole.channels, kind="table", seed=0)
    _, validation = train_and_validate(estimator, whole, folds=5, seed=0)
    rates = np.diag(validation.confusion.probabilities)
    return ", ".join(
        f"{name} {rate:.3f}" for name, rate in zip(validation.confusion.classes, rates, strict=True)
    )


@pytest.mark.slow
def test_an_interrupted_run_of_two_senses_resumes(lcorpp, domain, tmp_path, monkeypatch):
    """Ctrl-C between the stores of the two senses, after a decision and after a training."""
    learn = ("learn", domain, *LEARN, *BATCHES, "--max-batches", 3)
    plain = lcorpp(*learn, "--store", tmp_path / "plain.tracks", "--out", tmp_path / "plain")
    assert plain.code == 0, plain.err
    append, decide, save, calls = Store.append, RunStore.append_decision, RunStore.save_checkpoint, []

    def interrupted(original, *numbers):
        def call(*arguments):
            result = original(*arguments)
            calls.append(original)
            if calls.count(original) in numbers:
                raise KeyboardInterrupt
            return result

        return call

    # a decision is an append to voice, then to gaze: odd ones end between the two
    monkeypatch.setattr(Store, "append", interrupted(append, 1, 9, 14))
    monkeypatch.setattr(RunStore, "append_decision", interrupted(decide, 3))
    monkeypatch.setattr(RunStore, "save_checkpoint", interrupted(save, 3))
    ends = []
    while not ends or "stopped after 3 batches" not in ends[-1].out:
        ends.append(lcorpp(*learn, "--store", tmp_path / "s.tracks", "--out", tmp_path / "out"))
        assert ends[-1].code == 0, ends[-1].err
        assert ends[-1].out.count("note:") == ends[-1].out.count("note: the gap at a prior")
        assert len(ends) < 9
    assert len(ends) > 3
    assert read_rows(tmp_path / "out") == read_rows(tmp_path / "plain")
    for suffix in ("", "-voice"):
        assert stored(tmp_path / f"s{suffix}.tracks") == stored(tmp_path / f"plain{suffix}.tracks")
    last = [
        [line for line in end.out.splitlines() if line.startswith("batch 3")] for end in (ends[-1], plain)
    ]
    assert last[0] == last[1] != []


def test_a_checkpoint_of_other_senses_is_not_used(lcorpp, domain, tmp_path):
    learn = ("learn", domain, "--tracks", 40, "--jobs", 1, *BATCHES, "--store", tmp_path / "s.tracks")
    assert lcorpp(*learn, *LEARN[:4], "--max-batches", 1).code == 0
    ended = lcorpp(*learn, *LEARN[:2], "--classifier", "voice=channel", "--max-batches", 0 + 1)
    assert "not used, the senses that learn were gaze, voice, and are gaze now" in ended.out
    assert "the reports label gaze\nvoice stays as it is:\nclassifier of voice: a noisy channel" in ended.out


def test_a_sense_that_no_report_labels_stays_as_it_is(lcorpp):
    few = ("--tracks", 60, "--batch-size", 4, "--max-batches", 1, "--jobs", 1)
    ended = lcorpp("learn", "museum", "--learner", "motion=summaries", "--learner", "gaze=logistic", *few)
    assert (
        "the reports label motion\ngaze stays as it is:\nclassifier of gaze: logistic, five-fold" in ended.out
    )
    assert "batch 1: 64 tracks; recall: directions" in ended.out


def test_a_sense_that_stays_as_it_is_is_trained_though_the_others_begin_without_data(lcorpp):
    few = ("--tracks", 0, "--batch-size", 4, "--max-batches", 1, "--jobs", 1, "--labels", "soft")
    ended = lcorpp("learn", "museum", "--learner", "motion=summaries", "--learner", "gaze=logistic", *few)
    assert "gaze stays as it is:\nclassifier of gaze: logistic, five-fold" in ended.out
    assert "batch 1: 4 tracks; random labels" in ended.out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--learner", "smell=forest"), "no sense 'smell'; expected one of gaze, voice"),
        (("--data", "x.csv"), "--data 'x.csv': expected the name of a sense first"),
        (("--evidence", "gaze=medium"), "--evidence 'medium': expected one of hard, soft"),
        (("--classifier", "channel"), "nothing learns: the classifiers of gaze, voice are given"),
        (("--classifier", "gaze=channel", "--evidence", "gaze=soft"), "a channel has labels only"),
        (("--classifier", "gaze=channel", "--learner", "gaze=forest"), "both choose the classifier"),
        (("--classifier", "gaze=no.npz"), "no.npz: cannot be read"),
        (("--learner", "voice=lstm"), "features"),
    ],
)
def test_wrong_options_by_sense_are_refused(lcorpp, domain, options, words):
    refused(lcorpp("learn", domain, *options), words)


def test_explain_uses_the_classifiers_of_its_options(lcorpp, domain, tmp_path):
    common = ("explain", domain, "--seed", 5, "--jobs", 1, "--tracks", 40, "--log", tmp_path / "log.jsonl")
    hard = lcorpp(*common, "--learner", "voice=logistic")
    assert hard.code == 0, hard.err
    assert "classifier of gaze: a noisy channel" in hard.out
    assert "classifier of voice: logistic, five-fold cross-validation on 40 simulated cases" in hard.out
    assert "voice's classifier's label" in hard.out
    soft = lcorpp(*common, "--learner", "voice=logistic", "--evidence", "voice=soft")
    assert "voice's classifier's likelihood" in soft.out
    given = lcorpp(*common, "--learner", "voice=logistic", "--label", "voice=low", "--label", "gaze=left")
    assert "given time" in given.out
    ended = lcorpp("replay", tmp_path / "log.jsonl")
    assert "3 decisions, 0 differences" in ended.out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--learner", "smell=forest"), "no sense 'smell'"),
        (("--tracks", 40), "--tracks: nothing is trained, as the classifier is a channel"),
        (("--learner", "voice=logistic", "--likelihood", "voice:low=.5"), "--likelihood is the evidence of"),
        (
            ("--learner", "voice=logistic", "--evidence", "soft", "--label", "voice=low"),
            "a label of voice is given; expected the likelihood of a simulated person",
        ),
        (("--learner", "voice=logistic", "--evidence", "soft", "--interactive"), "--interactive asks for"),
        (("--strategy", "P", "--learner", "voice=logistic"), "no strategy uses the sense voice"),
        (("--data", "voice=no.csv"), "no.csv"),
    ],
)
def test_wrong_options_of_explain_are_refused(lcorpp, domain, options, words):
    refused(lcorpp("explain", domain, *options), words)
