"""Recordings from bags of people: labels and people of their names or a table, and what cannot be read."""

from pathlib import Path

import numpy as np
import pytest

from lcorpp.assembly import read_training_data
from lcorpp.domains import load_domain
from lcorpp.errors import DataError, ParseError
from lcorpp.learning import read_recording
from lcorpp.worlds.ros.people.bag_recording import collect_tracks, find_bags, read_bags
from lcorpp.worlds.ros.people.people_bag import read_people_bag
from lcorpp.worlds.ros.sensor_messages import Sample

from .humans_bag import LEVEL, OPTICAL, HumansBag, show, transform

LABELS = {"eng": "engaged", "dis": "not_engaged"}


@pytest.fixture
def bags(tmp_path):
    """Three people, one bag of each class; and a folder that is no bag."""
    folder = tmp_path / "bags"
    (folder / "notes").mkdir(parents=True)
    for k, person in enumerate(("AA", "BB", "CC")):
        for label, size in (("eng", 0.02), ("dis", 0.5)):
            HumansBag(
                folder / f"1p_{person}_{label}_1",
                seconds=5.0,
                turn=lambda t, size=size, k=k: 0.3 + size * np.sin((3 + k) * t),
                person=person.lower(),
            ).write()
    return folder


def test_names_give_labels_and_people(bags):
    assert [bag.name for bag in find_bags(bags)][:2] == ["1p_AA_dis_1", "1p_AA_eng_1"]
    recording = read_bags(bags, labels=LABELS, groups="[A-Z]{2}")
    assert [(track.id, track.label, track.group) for track in recording.tracks] == [
        (f"1p_{name}_{label}_1/{name.lower()}", LABELS[label], name)
        for name in ("AA", "BB", "CC")
        for label in ("dis", "eng")
    ]
    single = read_bags(bags / "1p_AA_eng_1", labels=LABELS)
    assert [(track.id, track.label, track.group) for track in single.tracks] == [("aa", "engaged", "aa")]
    two = read_bags(bags, labels=LABELS, groups="AA|p")  # both are found in a name
    assert {track.group for track in two.tracks} == {"p + AA", "p"}


def test_a_table_gives_labels_to_bags_and_tracks(bags, tmp_path):
    table = tmp_path / "labels.csv"
    table.write_text("id,label\n1p_AA_dis_1,eng\n1p_BB_eng_1/bb,dis\n")
    recording = read_bags(bags, labels=LABELS, label_file=table)
    assert [(track.id, track.label) for track in recording.tracks] == [
        ("1p_AA_dis_1/aa", "engaged"),
        ("1p_BB_eng_1/bb", "not_engaged"),
    ]
    table.write_text("id,label\nelsewhere,eng\n")
    with pytest.raises(DataError, match="has no tracks: no track has its label in"):
        read_bags(bags, labels=LABELS, label_file=table)
    table.write_text("id,label\n1p_AA_dis_1,maybe\n")
    with pytest.raises(ParseError, match="unknown label 'maybe'"):
        read_bags(bags, labels=LABELS, label_file=table)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"labels": {"yes": "engaged"}},
            r"1p_AA_dis_1: its name has no label; expected one of yes, engaged in it",
        ),
        ({"labels": {"AA": "a", "dis": "b"}}, r"1p_AA_dis_1: its name has labels of 2 classes: dis, AA"),
        ({"groups": "["}, r"groups '\[': .*; expected a regular expression"),
        ({"groups": "Z+"}, r"1p_AA_dis_1: its name has no people: 'Z\+' finds nothing in it"),
        ({"topic": "/people"}, r"has no people in '/people'"),
    ],
)
def test_wrong_names_and_options_are_errors(bags, options, words):
    with pytest.raises(DataError, match=words):
        read_bags(bags, **options)


def test_a_bag_that_cannot_be_read_is_left_out(bags, caplog):
    (file,) = (bags / "1p_BB_eng_1").glob("*.db3")
    file.write_bytes(b"no database")
    recording = read_bags(bags, labels=LABELS)
    assert len(recording) == 5
    assert recording.notes == ("1 of 6 bags cannot be read and are left out",)
    assert any("1p_BB_eng_1: cannot be read as a bag" in text for text in caplog.messages)
    with pytest.raises(DataError, match="1p_BB_eng_1: cannot be read as a bag"):
        read_bags(bags / "1p_BB_eng_1", labels=LABELS)
    for bag in find_bags(bags):
        next(bag.glob("*.db3")).write_bytes(b"no database")
    with pytest.raises(DataError, match="1p_AA_dis_1: cannot be read as a bag"):
        read_bags(bags, labels=LABELS)
    with pytest.raises(DataError, match="notes: is no bag, and has none"):
        read_bags(bags / "notes")


def test_a_table_without_labels_takes_its_classes_unchanged(bags, tmp_path):
    table = tmp_path / "labels.csv"
    table.write_text("id,label\n1p_AA_dis_1,bored\nelsewhere,keen\n")
    recording = read_bags(bags, labels={}, label_file=table)
    assert [track.label for track in recording.tracks] == ["bored"]
    assert recording.notes == (f"1 of 2 ids of {table} have no tracks: elsewhere",)


def test_labels_are_parts_of_names_between_other_signs(bags):
    for name, expected in (("x_not_engaged", "no"), ("x-engaged.2", "yes")):
        HumansBag(bags / name, seconds=1.0).write()
        labels = {"engaged": "yes", "not_engaged": "no"}
        assert {track.label for track in read_bags(bags / name, labels=labels).tracks} == {expected}


def test_files_beside_bags_are_bags_of_their_own(bags, monkeypatch):
    stray = next((bags / "1p_AA_eng_1").glob("*.db3"))
    (bags / "stray.db3").write_bytes(stray.read_bytes())
    (bags / "metadata.yaml").write_text("title: recordings\n")
    assert [bag.name for bag in find_bags(bags)][-1] == "stray.db3"
    assert len(read_bags(bags)) == 7
    assert len(read_bags(bags / "stray.db3")) == 1
    monkeypatch.chdir(bags / "1p_AA_eng_1")
    assert read_bags(Path(), labels=LABELS).tracks[0].label == "engaged"


def test_people_without_faces_are_left_out_where_gaze_is_learnt(bags):
    body = [
        show(transform("body_zz", OPTICAL, LEVEL, 1000 + k / 30, x=k / 30), time=k / 30) for k in range(90)
    ]
    HumansBag(bags / "1p_DD_eng_1", messages=body).write()
    domain = load_domain("engagement")
    sense = domain.find_sense("gaze")
    data = read_training_data(
        domain, sense, bags, seed=0, features=sense.features, leave_one_out=True
    ).dataset
    assert set(data.groups) == {"AA", "BB", "CC"}
    assert "1 of 7 tracks lack gaze_angle: left out" in data.notes


def test_people_of_a_learning_run_are_split(bags):
    """Its reports are tested on other people than those of the training; three people are too few."""
    domain = load_domain("engagement")
    sense = domain.find_sense("gaze")
    options = {"seed": 0, "features": sense.features}
    with pytest.raises(DataError, match="the 3 people are split into training and test data"):
        read_training_data(domain, sense, bags, **options)
    for name in ("DD", "EE"):
        for label in ("eng", "dis"):
            HumansBag(bags / f"1p_{name}_{label}_1", seconds=5.0, person=name.lower()).write()
    data = read_training_data(domain, sense, bags, **options)
    assert not data.tests_training_cases
    assert not set(data.dataset.groups) & set(data.signals.dataset.groups)
    assert len(set(data.dataset.groups)) >= 3


def test_ids_of_parts_are_unique():
    samples = [Sample(t, "a", t, 0.0) for t in (0.0, 1.0, 8.0, 9.0)]
    samples += [Sample(t, "a#2", t, 0.0) for t in (0.0, 1.0)]
    tracks, _ = collect_tracks(samples)
    assert sorted(track.id for track in tracks) == ["a", "a#2", "a#3"]


def test_a_pause_begins_another_track_of_the_person():
    samples = [Sample(t, "ann", t, 0.0) for t in (0.0, 1.0, 8.0, 9.0, 9.0, 20.0)]
    tracks, notes = collect_tracks(samples, gap=5.0)
    assert [(track.id, track.group, track.times.tolist()) for track in tracks] == [
        ("ann", "ann", [0.0, 1.0]),
        ("ann#2", "ann", [8.0, 9.0]),
    ]
    assert notes == []


def test_samples_without_a_face_are_left_out_of_a_track_with_gaze():
    """Missing faces are gaps, not zeros; a person without any face is a track of positions."""
    gaze = {"gaze_angle": 0.1, "z": 1.0}
    samples = [Sample(t, "ann", t, 0.0, gaze if t != 1.0 else {"z": 1.0}) for t in (0.0, 1.0, 2.0)]
    samples += [Sample(t, "bob", t, 0.0, {"z": 1.0} if t else {}) for t in (0.0, 1.0, 2.0)]
    (ann, bob), notes = collect_tracks(samples)
    assert (ann.times.tolist(), set(ann.columns)) == ([0.0, 2.0], {"x", "y", "z", "gaze_angle"})
    assert (bob.times.tolist(), set(bob.columns)) == ([0.0, 1.0, 2.0], {"x", "y"})
    assert notes == ["1 of 3 samples of ann have no gaze: left out"]


def test_the_command_writes_what_it_reads(lcorpp, bags, tmp_path):
    out = tmp_path / "tracks.csv"
    options = ("--label", "eng=engaged", "--label", "dis=not_engaged", "--groups", "[A-Z]{2}")
    ended = lcorpp("track", bags, "-o", out, *options)
    assert (ended.code, ended.out) == (0, f"wrote {out}: 6 tracks, 900 samples\n")
    written, direct = read_recording(out), read_bags(bags, labels=LABELS, groups="[A-Z]{2}")
    assert [(t.label, t.group) for t in written.tracks] == [(t.label, t.group) for t in direct.tracks]
    for one, other in zip(written.tracks, direct.tracks, strict=True):
        for name in ("x", "gaze_angle", "robot_angle", "face_distance"):
            np.testing.assert_allclose(one.columns[name], other.columns[name], atol=1e-4)
    ended = lcorpp("track", bags / "1p_AA_eng_1", "-o", out, "--from", 1, "--to", 2)
    assert (ended.code, ended.out) == (0, f"wrote {out}: 1 tracks, 31 samples\n")
    ended = lcorpp("track", bags / "1p_AA_eng_1", "-o", out, "--frame", "map")
    assert (ended.code, "no person's frame is connected to 'map'" in ended.err) == (2, True)
    ended = lcorpp("track", bags / "1p_AA_eng_1", "-o", out, "--topic", "/no")
    assert (ended.code, "has no topic '/no'; expected one of /humans/persons" in ended.err) == (2, True)
    ended = lcorpp("data", "describe", bags, "--label", "eng=engaged", "--label", "dis=other")
    assert (ended.code, "6 tracks" in ended.out) == (0, True)


def test_windows_of_bags_train_a_sense_of_gaze(bags):
    """Three people are few, so all of them are trained on, and each is tested without them."""
    domain = load_domain("engagement")
    sense = domain.find_sense("gaze")
    data = read_training_data(domain, sense, bags, seed=0, features=sense.features, leave_one_out=True)
    assert data.dataset.trajectories.shape == (36, 3, 61)  # x, y and the angle; a window every half second
    assert data.dataset.channels == ("x", "y", "gaze_angle")
    assert set(data.dataset.groups) == {"AA", "BB", "CC"}
    assert data.tests_training_cases
    assert "the 3 people of 36 tracks are few" in data.dataset.notes[-1]
    samples = [s for s in read_people_bag(bags / "1p_AA_dis_1") if s.time >= 1002.966]
    np.testing.assert_allclose(
        data.dataset.trajectories[5, 2], [s.columns["gaze_angle"] for s in samples[-61:]], atol=1e-6
    )


def test_reading_options_of_files_are_refused_for_bags(lcorpp, bags):
    ended = lcorpp("data", "describe", bags, "--unit", "mm")
    assert (ended.code, "whose units and columns are known; expected no --unit" in ended.err) == (2, True)
