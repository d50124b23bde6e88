"""Units other than metres, seconds and radians, and values that no human has."""

from __future__ import annotations

import re

import numpy as np
import pytest

from lcorpp.errors import DataError, ParseError
from lcorpp.learning import read_data, save_dataset
from lcorpp.learning.data.tracks import count_repairs
from lcorpp.values import Dataset

from .test_repairs import read
from .texts import GOOD, HEADING, atc_rows, rows


def test_a_file_in_millimetres_has_people_who_stand_in_it_too(tmp_path):
    text = HEADING + rows("a", "in", speed=900) + rows("b", "in", speed=1100) + rows("c", "in", speed=8)
    recording = read(tmp_path, text, repair=["units"])
    assert [round(float(np.median(track.speeds)), 4) for track in recording.tracks] == [0.9, 1.1, 0.008]


def test_metres_taken_for_millimetres_in_tracking_data(tmp_path):
    text = "".join(atc_rows(name, speed=0.001 * (1 + name / 10)) for name in range(3))
    text = text.replace(",1,0.000", ",1.0,0.000")
    with pytest.raises(ParseError, match="looks like metres taken for millimetres"):
        read(tmp_path, precise(text))
    recording = read(tmp_path, precise(text), repair=["units"])
    assert np.median(recording.tracks[0].speeds) == pytest.approx(1.0, rel=0.01)


def test_velocities_are_converted_with_positions_that_are_too_slow(tmp_path):
    text = precise("".join(atc_rows(name) for name in range(2))).replace(",1000,0.000", ",1.0,0.000")
    for track in read(tmp_path, text, repair=["units"]).tracks:
        np.testing.assert_allclose(track.columns["velocity"], 1.0)


def test_degrees_of_longitude_are_not_taken_for_kilometres(tmp_path):
    text = HEADING + "".join(f"a,{i / 10},{50 + 1e-6 * i:.6f},8.0,in\n" for i in range(20))
    with pytest.raises(ParseError, match=r"no unit of length explains it; .* have to be projected"):
        read(tmp_path, text, repair=["all"])


def precise(text):
    """ATC rows whose x is in metres, with decimals."""
    lines = []
    for line in text.splitlines():
        cells = line.split(",")
        cells[2] = f"{(float(cells[0]) - 1350867600) * 1.0:.3f}"
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def test_speeds_that_no_unit_explains_are_always_an_error(tmp_path):
    with pytest.raises(ParseError, match="no unit of length explains it"):
        read(tmp_path, HEADING + rows("a", "in", speed=1e6), repair=["all"])


@pytest.mark.parametrize(
    ("speeds", "expected"),
    [
        ((90, 130, 8), (0.9, 1.3, 0.08)),  # someone who stands
        ((25, 30), (0.25, 0.3)),
        ((240, 100), (2.4, 1.0)),
    ],
)
def test_a_file_in_centimetres_is_not_taken_for_one_in_millimetres(tmp_path, speeds, expected):
    text = HEADING + "".join(rows(str(i), "in", speed=speed) for i, speed in enumerate(speeds))
    with pytest.raises(ParseError, match=r"looks like centimetres taken for metres .*repair 'units' would"):
        read(tmp_path, text)
    found = [float(np.median(track.speeds)) for track in read(tmp_path, text, repair=["units"]).tracks]
    np.testing.assert_allclose(found, expected, rtol=0.02)


@pytest.mark.parametrize("speed", [15, 13_000])
def test_a_speed_between_the_units_is_not_guessed(tmp_path, speed):
    """.15 m/s in centimetres and .015 m/s in millimetres are people who stand: nothing decides."""
    with pytest.raises(ParseError, match="no unit of length explains it"):
        read(tmp_path, HEADING + rows("a", "in", speed=speed), repair=["all"])


def angles(unit, samples=12):
    """Four walks in a circle, one after the other, with their heading."""
    text = "track,time,x,y,heading\n"
    for track in range(4):
        for i in range(samples):
            angle = i / 4 + track
            text += f"{track},{i / 10:.1f},{0.4 * np.sin(angle):.3f},{-0.4 * np.cos(angle):.3f}"
            text += f",{unit(np.arctan2(np.sin(angle), np.cos(angle))):.4f}\n"
    return text


def test_degrees_are_found_and_converted(tmp_path):
    with pytest.raises(ParseError, match=r"heading is up to .*; expected radians; it looks like degrees"):
        read(tmp_path, angles(np.degrees))
    radians = read(tmp_path, angles(lambda angle: angle))
    converted = read(tmp_path, angles(np.degrees), repair=["units"])
    assert count_repairs(converted.repairs) == {"units": (48, 4)}
    for track, other in zip(converted.tracks, radians.tracks, strict=True):
        np.testing.assert_allclose(track.columns["heading"], other.columns["heading"], atol=1e-4)


def test_a_negative_speed_is_a_fault(tmp_path):
    text = "track,time,x,y,velocity\na,0,0,0,1\na,1,1,0,-1\na,2,2,0,1\n"
    with pytest.raises(ParseError, match=r":3:9: .*velocity is -1; expected a finite number from 0, a speed"):
        read(tmp_path, text)
    (track,) = read(tmp_path, text, repair=["nonfinite"]).tracks
    assert track.times.tolist() == [0, 2]


def test_a_jump_inside_a_track_splits_it(tmp_path):
    jumping = "".join(
        line.replace(",2.00,", ",502.00,") if i >= 5 else line
        for i, line in enumerate(rows("c", "in").splitlines(keepends=True))
    )
    with pytest.raises(
        ParseError, match=r":31:3: track 'c': a jump of 500 m in 0.100 s; expected at most 12"
    ):
        read(tmp_path, GOOD + jumping)
    recording = read(tmp_path, GOOD + jumping, repair=["gaps"])
    assert [(track.id, len(track)) for track in recording.tracks][2:] == [("c", 5), ("c#2", 7)]
    # a jump in a file in millimetres is one, too
    metres = "".join(rows(name, "in", speed=1000) for name in "abc") + rows("a", "in", start=1.3, speed=-4e6)
    recording = read(tmp_path, HEADING + metres, repair=["gaps", "units", "short"])
    assert [len(track) for track in recording.tracks] == [13, 12, 12]


def test_frame_numbers_for_seconds_are_noted(tmp_path):
    """One unit of time is a thirtieth of a second: people seem to creep."""
    text = HEADING + "".join(
        f"{track},{i},{i * (0.04 + track / 1000):.3f},0,in\n" for track in range(9) for i in range(30)
    )
    (note,) = read(tmp_path, text).notes
    assert "0.047 m/s, and all times are whole: are they frame numbers (--fps), not seconds?" in note
    (note,) = read(tmp_path, re.sub(r",(\d+),", r",\1.5,", text, flags=re.M)).notes
    assert "do all people stand, or are positions not in metres (--unit) or times not in" in note
    every_tenth = re.sub(r",(\d+),", r",\g<1>0,", text)
    with pytest.raises(
        ParseError,
        match=r":2:3: the usual time between two samples is 10 s, .*or their unit: --fps 120 gives",
    ):
        read(tmp_path, every_tenth)


def test_stored_data_sets_have_the_same_checks(tmp_path):
    """A .npz is rectangular, so jumps are noted instead of split."""
    walk = np.stack([np.linspace(0, 1, 20), np.zeros(20), np.linspace(0, 179, 20)])
    save_dataset(
        Dataset(np.stack([walk, walk + 0.1]), ("a", "b"), interval=0.1, channels=("x", "y", "heading")),
        tmp_path / "degrees.npz",
    )
    with pytest.raises(
        DataError, match=r"degrees.npz: track '0': the heading is up to 179; expected radians"
    ):
        read_data(tmp_path / "degrees.npz")
    data = read_data(tmp_path / "degrees.npz", repair=["units"])
    np.testing.assert_allclose(data.trajectories[0, 2], np.radians(walk[2]))
    (note,) = data.notes
    assert note.startswith("repaired: units 40 rows in 2 places (units: the heading is up to 179; ")
    jump = np.stack([walk[:2], walk[:2] + np.where(np.arange(20) < 9, 0, 500)])
    save_dataset(Dataset(jump, ("a", "b"), interval=0.1), tmp_path / "jump.npz")
    assert read_data(tmp_path / "jump.npz").notes == ("1 tracks jump faster than 12 m/s, the first is 1",)
    back = Dataset(np.abs(walk)[None] * [[[1], [1], [-1]]], ("a",), channels=("x", "y", "velocity"))
    save_dataset(back, tmp_path / "back.npz")
    with pytest.raises(DataError, match="track '0': the velocity is -179; expected a speed, 0 or more"):
        read_data(tmp_path / "back.npz")


@pytest.mark.parametrize("repair", [(), "all"])
def test_times_in_milliseconds_are_no_unit_of_length(tmp_path, repair):
    """Milliseconds and metres look like seconds and kilometres; a longer gap does not change that."""
    text = HEADING + "".join(f"a,{100 * i},{i / 10:.2f},2,in\n" for i in range(30))
    for gap in (5, 500):
        with pytest.raises(
            ParseError, match=r":2:3: the usual time .* 100 s, .*: --time-unit ms gives .* 1 m/s"
        ):
            read(tmp_path, text, repair=repair, gap=gap)
    (track,) = read(tmp_path, text, time_unit="ms").tracks
    assert track.times[1] == 0.1
    assert np.median(track.speeds) == pytest.approx(1)


def test_slow_samples_and_frames_are_asked_for(tmp_path):
    """A person who stands, seen every ten seconds, has no speed that suggests a unit."""
    text = HEADING + "".join(f"a,{10 * i},{i % 2},2,in\n" for i in range(30))
    with pytest.raises(ParseError, match=r"is 10 s, .*; a longer --gap keeps seconds \(it is 5\)"):
        read(tmp_path, text, repair="all")
    assert len(read(tmp_path, text, gap=20).tracks[0]) == 30
    frames = HEADING + "".join(f"a,{10 * i},{i * 0.52:.2f},2,in\n" for i in range(30))
    with pytest.raises(
        ParseError, match=r"expected seconds, or their unit: --fps 25 gives a sample every 0\.4 s and"
    ):
        read(tmp_path, frames, repair="all")
    assert np.median(read(tmp_path, frames, fps=25).tracks[0].speeds) == pytest.approx(1.3)


@pytest.mark.parametrize(("speed", "notes"), [(1.9, 0), (3.9, 1)])
def test_people_who_run_are_noted(tmp_path, speed, notes):
    text = HEADING + rows("a", "in", speed=speed) + rows("b", "in", speed=0.01) + rows("c", "in", speed=speed)
    recording = read(tmp_path, text)
    assert len(recording.notes) == notes
    if notes:
        assert "the median speed of all who move is 3.9 m/s" in recording.notes[0]
        assert "e.g. in feet (--unit ft gives 1.2 m/s)" in recording.notes[0]
        assert read(tmp_path, text, unit="ft").notes == ()


def test_velocities_that_disagree_with_positions_are_noted(tmp_path):
    text = "track,time,x,y,velocity\n" + "".join(f"a,{i / 10},{i / 10},0,{{}}\n" for i in range(30))
    assert read(tmp_path, text.replace("{}", "1.5")).notes == ()
    (note,) = read(tmp_path, text.replace("{}", "8")).notes
    assert "the velocity column is 8 times the speed of the positions" in note


def test_a_given_unit_is_not_guessed_again(tmp_path):
    text = HEADING + rows("a", "in", speed=1000)
    with pytest.raises(
        ParseError, match=r"the median speed is 305 m/s, .*; expected another --unit than 0.3048 m"
    ):
        read(tmp_path, text, unit="ft", repair="all")
    assert np.median(read(tmp_path, text, unit="mm").tracks[0].speeds) == pytest.approx(1)


def test_repairs_are_notes_of_a_data_set(tmp_path):
    (tmp_path / "a.csv").write_text(HEADING + rows("a", "in", speed=900) + rows("b", "out", speed=1100))
    (note,) = read_data(tmp_path / "a.csv", repair="units").notes[-1:]
    assert note.startswith(
        "repaired: units 24 rows in 2 places (units: the median speed is 900 m/s, which no"
    )
    assert "times 0.001" in note


def test_an_index_without_a_name_is_named_by_its_number(tmp_path):
    text = "".join(f"{i},{line}\n" if i else f",{line}\n" for i, line in enumerate(GOOD.splitlines()))
    assert read(tmp_path, text).notes == ("columns that are not used: column 1 (no name)",)
