"""Formats of docs/guides/data/formats.md: walks with a known answer, errors for what is missing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import DataError, ParseError
from lcorpp.learning import read_data, read_recording
from lcorpp.learning.data.formats.columns import guess_columns
from lcorpp.learning.data.formats.detection import detect_format

from .texts import atc_rows

PEDESTRIANS = Path(__file__).parents[4] / "shared" / "data" / "pedestrians"
CASES = Path(__file__).parents[4] / "shared" / "cases" / "robot"

SPEED = {1: 1.0, 2: 1.5}
"""Two people who walk along x; the second is 3 m beside the first."""


def walks(rate: float, samples: int = 20) -> Iterator[tuple[int, int, float, float]]:
    """Yield frame, person, x and y in metres, in the order of frames."""
    for frame in range(samples):
        for person, speed in SPEED.items():
            yield frame, person, 2 + speed * frame / rate, 3.0 * person


def write(folder: Path, name: str, lines: list[str]) -> Path:
    (folder / name).write_text("".join(f"{line}\n" for line in lines))
    return folder / name


def check_walks(path: Path, *, y: bool = True, tolerance: float = 0.02, **options: object) -> tuple[str, ...]:
    """Check that both people are read with their speeds; return the notes."""
    recording = read_recording(path, **options)
    assert [track.id.removeprefix("pedestrian:") for track in recording.tracks] == ["1", "2"]
    for track, speed in zip(recording.tracks, SPEED.values(), strict=True):
        assert np.median(track.speeds) == pytest.approx(speed, rel=tolerance)
        if "velocity" in track.columns:
            np.testing.assert_allclose(track.columns["velocity"], speed, rtol=1e-6)
        if y:
            np.testing.assert_allclose(track.columns["y"], 3.0 * int(track.id[-1]), atol=1e-6)
    return recording.notes


def obsmat(rate: float, step: int, first: int = 780) -> list[str]:
    return [
        f"   {first + step * frame:.7e}   {person:.7e}   {x:.7e}   {0:.7e}   {y:.7e}"
        f"   {SPEED[person]:.7e}   {0:.7e}   {0:.7e}  "
        for frame, person, x, y in walks(rate / step)
    ]


@pytest.mark.parametrize(("rate", "step"), [(15, 6), (25, 10)])
def test_obsmat_asks_for_the_rate_at_which_its_velocities_agree(tmp_path, rate, step):
    path = write(tmp_path, "obsmat.txt", obsmat(rate, step))
    with pytest.raises(ParseError, match=f"obsmat.*times are frame numbers; .*--fps {rate}, at which"):
        read_recording(path)
    assert check_walks(path, fps=rate) == ()
    label_file = write(tmp_path, "labels.csv", ["1,in", "2.0,out"])
    labelled = read_recording(path, fps=rate, label_file=label_file)  # 1.0000000e+00 is 1
    assert [(track.id, track.label) for track in labelled.tracks] == [("1", "in"), ("2", "out")]


def test_columns_of_obsmat_in_seconds_are_no_tracking_data_of_atc(tmp_path):
    lines = [
        f"{52 + frame * 0.4:.4f},{person}.0,{x:.4f},0.0,{y:.4f},{SPEED[person]},0.0,0.0"
        for frame, person, x, y in walks(2.5)
    ]
    path = write(tmp_path, "a.csv", lines)
    assert detect_format(path).name.startswith("obsmat")
    assert check_walks(path) == ()


def test_eight_numbers_of_no_format_are_refused_with_the_reasons(tmp_path):
    text = "".join(atc_rows(name) for name in (7, 9)).replace(",1000,0.000", ",1,0.000")
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(ParseError) as caught:
        read_recording(tmp_path / "a.csv", repair="all")
    for words in (
        "a.csv:1:1: 8 columns of numbers",
        "--column track=1",
        "columns 4 and 7, the height and its velocity, are not 0",
        "its velocities are 0.001 times the speed of its positions",
    ):
        assert words in str(caught.value)


@pytest.mark.parametrize("form", ["{frame}\t{person}\t{x:.4f}\t{y}", "{frame}.0 {person}.0 {x:.4f} {y}"])
def test_text_of_frame_id_x_and_y(tmp_path, form):
    lines = [form.format(frame=10 * f, person=p, x=x, y=y) for f, p, x, y in walks(2.5)]
    path = write(tmp_path, "zara.txt", lines)
    with pytest.raises(ParseError, match=r"expected their rate: --fps 25 if 10 frames are 0.4 s"):
        read_recording(path)
    assert check_walks(path, fps=25) == ()
    assert check_walks(path, time_unit=0.04) == ()
    swapped = [form.format(frame=p, person=10 * f, x=x, y=y) for f, p, x, y in walks(2.5)]
    check_walks(write(tmp_path, "swapped.txt", swapped), fps=25)


def test_text_of_id_frame_and_heads(tmp_path):
    """HERMES is in centimetres with 16 frames per second; newer files have metres and state the rate."""
    lines = [f"{p} {f} {100 * x:.4f} {100 * y} 171.5" for f, p, x, y in walks(16)]
    (note,) = check_walks(write(tmp_path, "hermes.txt", lines))
    assert "read as 16 frames per second; --fps gives another rate" in note
    lines = [f"{p}\t{f}\t{x:.4f}\t{y}\t1.71" for f, p, x, y in walks(25)]
    check_walks(write(tmp_path, "a.txt", ["# framerate: 25.00", "# id frame x/m y/m z/m", *lines]))
    with pytest.raises(ParseError, match="times are frame numbers; expected their rate"):
        read_recording(write(tmp_path, "b.txt", lines))
    with pytest.raises(ParseError, match="column 5 is 17, not the height of a head in m, cm or mm"):
        read_recording(write(tmp_path, "c.txt", [line.replace("1.71", "17") for line in lines]))


def drone(frame: int, person: int, x: float, y: float, *, lost: int = 0, kind: str = "Pedestrian") -> str:
    left, top = round(1000 * x), round(1000 * y)
    return f'{person} {left - 20} {top - 30} {left + 20} {top + 30} {frame} {lost} 0 0 "{kind}"'


def test_annotations_of_the_stanford_drone_dataset(tmp_path):
    lines = [drone(*row) for row in walks(30)] + [drone(20, 1, 0, 0, lost=1), drone(0, 3, 0, 0, kind="Biker")]
    path = write(tmp_path, "annotations.txt", lines)
    with pytest.raises(
        ParseError, match=r"in pixels; expected their scale: --unit with metres per pixel, e.g."
    ):
        read_recording(path)
    notes = check_walks(path, unit=0.001)
    assert "read as 30 frames per second" in notes[0]
    assert notes[1:] == ("left out 1 rows: Biker", "left out 1 rows: lost pedestrians")


def test_motchallenge(tmp_path):
    world = [f"{f + 1},{p},10,20,30,60,1,{x:.4f},{y},0" for f, p, x, y in walks(7)]
    path = write(tmp_path, "gt.txt", world)
    with pytest.raises(
        ParseError, match="MOTChallenge: times are frame numbers; expected their rate: --fps with"
    ):
        read_recording(path)
    assert check_walks(path, fps=7) == ()
    boxes = [f"{f + 1},{p},{1000 * x - 15:.1f},{1000 * y - 60},30,60,1" for f, p, x, y in walks(25)]
    path = write(tmp_path, "det.txt", [f"{line},-1,-1,-1" for line in boxes])
    with pytest.raises(
        ParseError, match=r"boxes of MOTChallenge: positions are in pixels.*; times are frame num"
    ):
        read_recording(path)
    assert check_walks(path, fps=25, unit="0.001") == ()
    path = write(tmp_path, "gt16.txt", [*(f"{line},1,1.0" for line in boxes), "1,9,10,20,30,60,1,3,1.0"])
    notes = check_walks(path, fps=25, unit=0.001)
    assert notes == ("left out 1 rows: classes other than 1, pedestrians",)
    path = write(tmp_path, "raw.txt", ["1,-1,10,20,30,60,.9,-1,-1,-1", "2,-1,10,20,30,60,.9,-1,-1,-1"])
    with pytest.raises(ParseError, match="the id, is -1 in all rows: detections without tracks"):
        read_recording(path)


def test_ind_has_pedestrians_without_width(tmp_path):
    heading = (
        "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity"
    )
    lines = [f"0,{p},{f},{f},{x:.5f},{y},0,0.0,0.0,{SPEED[p]},0" for f, p, x, y in walks(25)]
    lines += [f"0,3,{f},{f},{f},0,0,1.8,4.2,25,0" for f in range(20)]
    notes = check_walks(write(tmp_path, "00_tracks.csv", [heading, *lines]))
    assert notes == (
        "inD: times are frame numbers, read as 25 frames per second; --fps gives another rate",
        "left out 20 rows: vehicles",
    )


def test_citr(tmp_path):
    lines = [f"{p},{f},ped,{x:.5f},{y},{SPEED[p]},0" for f, p, x, y in walks(29.97)]
    check_walks(write(tmp_path, "a.csv", ["id,frame,label,x_est,y_est,vx_est,vy_est", *lines]))
    lines = [f"{p},{f},ped,{50 * x:.3f},{50 * y}" for f, p, x, y in walks(29.97)]  # 50 pixels a metre
    path = write(tmp_path, "pixels.csv", ["id,frame,label,x,y", *lines])
    with pytest.raises(
        ParseError, match=r"expected --column track=id --column time=frame --fps FRAMES_PER_SECOND"
    ):
        read_recording(path)
    columns = {"track": "id", "time": "frame"}
    assert check_walks(path, columns=columns, fps=29.97, unit=0.02) == ()
    with pytest.raises(
        ParseError, match=r"looks like centimetres.*if it is another unit, expected --unit .*pixel"
    ):
        read_recording(path, columns=columns, fps=29.97)


def test_trajnet_plus_plus(tmp_path):
    scene = {"scene": {"id": 1, "p": 1, "s": 0, "e": 190, "fps": 2.5, "tag": 2}}
    rows = [{"track": {"f": 10 * f, "p": p, "x": x, "y": y}} for f, p, x, y in walks(2.5)]
    guess = {"track": {"f": 0, "p": 1, "x": 0, "y": 0, "prediction_number": 0, "scene_id": 1}}
    path = write(tmp_path, "a.ndjson", [json.dumps(row) for row in [scene, *rows, guess]])
    notes = check_walks(path)
    assert notes[0] == "left out 1 rows: predictions"
    assert "read as 25 frames per second: the scenes state 2.5 rows per second, which are 10" in notes[1]
    path = write(tmp_path, "b.ndjson", [json.dumps(row) for row in rows])
    with pytest.raises(ParseError, match=r"no scene states a rate; expected --fps 25 if 10 frames are 0.4 s"):
        read_recording(path)
    check_walks(path, fps=25)
    broken = write(tmp_path, "c.ndjson", [json.dumps(rows[0]), '{"track": {"f": 1, "p": 2}}'])
    with pytest.raises(ParseError, match=r"c\.ndjson:2:1: expected a track with numbers f, x and y"):
        read_recording(broken, fps=25)


def test_jrdb(tmp_path):
    frames: dict[str, list[object]] = {}
    for f, p, x, y in walks(15):
        box = {"cx": x, "cy": y, "cz": 0.1, "l": 0.5, "w": 0.5, "h": 1.7, "rot_z": 0}
        frames.setdefault(f"{f:06d}.pcd", []).append({"label_id": f"pedestrian:{p}", "box": box})
    path = write(tmp_path, "a.json", [json.dumps({"labels": frames})])
    notes = check_walks(path)
    assert notes[0] == "JRDB: positions are relative to the robot, which may move"
    flat = {"labels": {"000000.jpg": [{"label_id": "pedestrian:1", "box": [1, 2, 3, 4]}]}}
    with pytest.raises(ParseError, match=r"2D labels, boxes in pixels of a panorama; expected its 3D labels"):
        read_recording(write(tmp_path, "flat.json", [json.dumps(flat)]))


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        (
            '[{"id": 1, "t": 0, "x": 1, "y": 2}]',
            "1:1",
            "a JSON file, a list with id, t, x, y; expected TrajNet",
        ),
        ('{"people": []}', "1:1", "a JSON file, an object of people; expected TrajNet"),
        ('{\n  "labels": {,}\n}', "2:14", "not JSON: "),
        ("[]", "1:1", "a JSON file, a list; expected"),
    ],
)
def test_other_json_is_named(tmp_path, text, place, words):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(ParseError) as caught:
        read_recording(tmp_path / "a.csv")
    assert f"a.csv:{place}: " in str(caught.value)
    assert words in str(caught.value)


def markers(axes: list[str]) -> list[str]:
    head = ["NO_OF_FRAMES\t20", "FREQUENCY\t100", "DATA_INCLUDED\t3D", "MARKER_NAMES\t1 - 1\t1 - 2\t2 - 1"]
    return [*head, "\t".join(["Frame", "Time", *axes])]


def test_tables_of_markers(tmp_path):
    """A marker that flickers beside another one does not disturb the position."""
    lines = markers([f"{marker} {axis}" for marker in ("1 - 1", "1 - 2", "2 - 1") for axis in "XYZ"])
    for frame in range(20):
        first, second = (2000 + 10 * SPEED[p] * frame for p in (1, 2))
        flickering = (first + 100, 3000, 1700) if frame % 2 else (0, 0, 0)
        cells = (frame + 1, frame / 100, first, 3000, 1700, *flickering, second, 6000, 1600)
        lines.append("\t".join(map(str, cells)))
    path = write(tmp_path, "Exp_1_run_1.tsv", [*lines, "21\t0.2" + "\t" * 9])
    (note,) = check_walks(path)
    assert "1 bodies is that of the marker that is visible most often" in note
    csv = [
        "FILE_ID,a",
        "BODY_NAMES,1,2",
        "Frame,Time," + ",".join(f"{b} Centroid_{a}" for b in "12" for a in "XYZ"),
    ]
    csv += [f"{f},{f / 100},{2000 + 10 * f},3000,1700,{2000 + 15 * f},6000,1600" for f in range(20)]
    assert check_walks(write(tmp_path, "magni.csv", csv)) == ()
    with pytest.raises(ParseError, match="no heading of the columns; expected Frame, Time and the markers"):
        read_recording(write(tmp_path, "raw.tsv", [*markers([])[:4], "1\t2\t3"]))


def test_own_columns_and_units(tmp_path):
    lines = [f"{p}.0,{1000 * f / 10:.0f},{1000 * x:.1f},{1000 * y},w" for f, p, x, y in walks(10)]
    path = write(tmp_path, "a.csv", ["Person_ID,stamp_ms,Pos X [mm],pos_y_mm,mood", *lines])
    with pytest.raises(ParseError) as caught:
        read_recording(path)
    assert (
        "--column track=person_id --column time=stamp_ms --column 'x=pos x [mm]' --column y=pos_y_mm"
        " --time-unit ms --unit mm" in str(caught.value)
    )
    columns = {"track": "person_id", "time": "stamp_ms", "x": "pos x [mm]", "y": "pos_y_mm"}
    notes = check_walks(path, columns=columns, time_unit="ms", unit="mm")
    assert notes == ("columns that are not used: mood",)
    # without a heading, by number
    columns = {"track": "1", "time": "2", "x": "3", "y": "4"}
    check_walks(write(tmp_path, "b.csv", lines), columns=columns, time_unit="ms", unit="mm")
    words = ["\t".join(f"person {line}".split(",")) for line in lines]
    tracks = read_recording(
        write(tmp_path, "c.csv", words), columns=columns, time_unit="ms", unit="mm"
    ).tracks
    assert [track.id for track in tracks] == ["person 1.0", "person 2.0"]
    with pytest.raises(DataError, match=r"b\.csv: no heading; expected the number .*: --column time=NUMBER"):
        read_recording(tmp_path / "b.csv", columns={"track": "1"})


def test_parquet_has_the_same_options_and_ids(tmp_path):
    arrow = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    rows = list(walks(10))
    table = {
        "id": [float(p) for _, p, _, _ in rows],  # as pandas writes ids if one is missing
        "stamp": [100 * f for f, _, _, _ in rows],
        "x": [100 * x for _, _, x, _ in rows],
        "y": [100 * y for _, _, _, y in rows],
    }
    pyarrow.parquet.write_table(arrow.table(table), tmp_path / "a.parquet")
    with pytest.raises(
        DataError, match="these columns seem to be them: --column track=id --column time=stamp;"
    ):
        read_recording(tmp_path / "a.parquet")
    columns = {"track": "id", "time": "stamp"}
    assert check_walks(tmp_path / "a.parquet", columns=columns, time_unit="ms", unit="cm") == ()


def test_a_table_of_features_with_an_id_and_a_time_stays_one(tmp_path):
    text = "id,t,x,y,label\n7,3,1,2,in\n8,1,2,2,out\n7,1,4,2,in\n7,2,4,2,in\n9,0,0,0,in\n"
    (tmp_path / "a.csv").write_text(text)
    assert read_data(tmp_path / "a.csv").channels == ("id", "t", "x", "y")
    (tmp_path / "b.csv").write_text(text.replace("7,3", "7,0"))
    with pytest.raises(
        ParseError, match="rows of tracks with other names of columns; expected --column track=id"
    ):
        read_data(tmp_path / "b.csv")


def test_guessed_names():
    assert guess_columns(["Timestamp", "agent_id", "px", "PY"]) == {
        "track": "agent_id",
        "time": "Timestamp",
        "x": "px",
        "y": "PY",
    }
    assert guess_columns(["lean", "gaze"]) == {}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"unit": "parsec"}, "the unit of length is 'parsec'; expected one of m, dm, cm, mm"),
        (
            {"unit": "px"},
            "the unit is 'px', which has no length; expected metres per pixel, e.g. --unit 0.04",
        ),
        ({"unit": 0}, "expected a finite number above 0"),
        ({"unit": "nan"}, "expected a finite number above 0"),
        ({"time_unit": "h"}, "the unit of time is 'h'; expected one of s, ms, us, ns, or seconds per unit"),
        (
            {"time_unit": "ms", "fps": 25},
            "the unit of time is ms, and there are 25 frames per second; expected one",
        ),
        ({"fps": -1.0}, "the frame rate is -1.0; expected a finite number above 0"),
        ({"columns": {"tme": "a"}}, "column tme=a: unknown column 'tme'; expected one of track, time"),
        (
            {"columns": {"time": "a"}},
            "column time=a: the file has no column 'a'; expected one of track, time, x, y",
        ),
        ({"columns": {"time": "x", "y": "x"}}, "column 'x' is time and y; expected one of them"),
    ],
)
def test_options_out_of_range(tmp_path, options, words):
    path = write(tmp_path, "a.csv", ["track,time,x,y", *(f"a,{t},{t},0" for t in range(9))])
    with pytest.raises(DataError) as caught:
        read_recording(path, **options)
    assert words in str(caught.value)


def test_units_of_data_sets_are_known(tmp_path):
    path = write(tmp_path, "a.csv", ["lean,label", "1,a", "2,b"])
    with pytest.raises(DataError, match="its units are known; expected no --unit, --time-unit or --fps"):
        read_data(path, unit="mm")


@pytest.mark.skipif(not PEDESTRIANS.exists(), reason=f"{PEDESTRIANS.name}: the recordings are not here")
@pytest.mark.parametrize(
    ("name", "rate", "people", "speed"),
    [("ETH_seq_eth", 15, 360, 1.5), ("UCY_zara01", 25, 148, 1.1)],
)
def test_recordings_of_eth_and_ucy(name, rate, people, speed):
    path = PEDESTRIANS / f"{name}.txt"
    with pytest.raises(ParseError, match=f"--fps {rate}, at which velocities and positions agree"):
        read_recording(path)
    recording = read_recording(path, fps=rate, repair=["constant", "short", "gaps"])
    assert len(recording) == pytest.approx(people, abs=12)
    assert np.median([np.median(track.speeds) for track in recording.tracks]) == pytest.approx(
        speed, abs=0.15
    )


@pytest.mark.skipif(not CASES.exists(), reason=f"{CASES.name}: the cases are not here")
def test_cases_from_the_field():
    with pytest.raises(ParseError, match=r"--time-unit ms gives a sample every 0\.1 s and 1\.32 m/s"):
        read_recording(CASES / "07_times_in_ms.csv", repair="all", gap=500)
    recording = read_recording(CASES / "07_times_in_ms.csv", time_unit="ms")
    assert np.abs(recording.tracks[0].positions).max() < 20
    assert recording.notes == ()
    obsmat = read_recording(CASES / "08_obsmat_columns.csv")
    assert np.ptp(obsmat.tracks[0].columns["y"]) > 1
    assert "do these people run or cycle" in read_recording(CASES / "12_feet.csv").notes[0]
    assert read_recording(CASES / "12_feet.csv", unit="ft").notes == ()
    assert read_recording(CASES / "13_pandas_index.csv").notes == (
        "columns that are not used: column 1 (no name)",
    )


def long_rows(write_time, head="track,time,x,y"):
    lines = [f"{p},{write_time(f / 10)},{x:.3f},{y}" for f, p, x, y in walks(10)]
    return [head, *lines]


@pytest.mark.parametrize(
    ("form", "words"),
    [
        ("2026-03-01T23:59:5{:.3f}", "dates without a zone, taken for UTC"),
        ("2026-03-01 23:59:5{:.6f}+01:00", "dates"),
        ("2026-03-01 23:59:5{:.1f} UTC", "dates"),
        ("9:59:5{:.2f}", "times of day"),
    ],
)
def test_times_may_be_dates(tmp_path, form, words):
    path = write(tmp_path, "dates.csv", long_rows(form.format))
    assert check_walks(path) == (f"times are {words}, read as seconds",)
    recording = read_recording(path)
    np.testing.assert_allclose(recording.tracks[0].times % 60, 50 + np.arange(20) / 10, atol=1e-5)
    with pytest.raises(ParseError, match=r":2:3: .*as --time-unit and --fps are not for dates"):
        read_recording(path, time_unit="ms")


def test_dates_are_seconds_since_1970_and_of_one_kind(tmp_path):
    lines = long_rows("1970-01-02T00:00:0{:.1f}+01:00".format)
    recording = read_recording(write(tmp_path, "zone.csv", lines))
    assert recording.tracks[0].times[:2].tolist() == [23 * 3600, 23 * 3600 + 0.1]
    path = write(tmp_path, "mixed.csv", [*lines, "1,82802.5,4.5,3.0"])
    with pytest.raises(ParseError, match=r":42:3: the time '82802.5' is of another kind \(numbers\) than"):
        read_recording(path)
    assert len(read_recording(path, repair=["rows"]).tracks[0]) == 20


def test_parquet_has_times_as_dates(tmp_path):
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    frames, people, x, y = zip(*walks(10), strict=True)
    for unit, size in (("ms", 1000), ("ns", 10**9)):
        stamps = pyarrow.array(
            [size * 1_700_000_000 + size * f // 10 for f in frames], pyarrow.timestamp(unit)
        )
        table = pyarrow.table({"track": people, "time": stamps, "x": x, "y": y})
        parquet.write_table(table, tmp_path / "dates.parquet")
        check_walks(tmp_path / "dates.parquet")
        assert read_recording(tmp_path / "dates.parquet").tracks[0].times[0] == 1_700_000_000
        with pytest.raises(DataError, match="the times are dates; expected no --time-unit"):
            read_recording(tmp_path / "dates.parquet", fps=10)


def test_comments_before_the_heading(tmp_path):
    lines = long_rows("{:.1f}".format)
    check_walks(write(tmp_path, "comments.csv", ["# tracker 3", "#", "", *lines]))
    swapped = [",".join(line.split(",")[cell] for cell in (3, 2, 1, 0)) for line in lines]
    check_walks(write(tmp_path, "names.csv", ["# metres", f"# {swapped[0]}", *swapped[1:]]))
    path = write(tmp_path, "fault.csv", ["# tracker 3", *lines, "1,5.0,?,1"])
    with pytest.raises(ParseError, match=":43:7: '\\?' is not a number; expected the x"):
        read_recording(path)
    table = write(tmp_path, "table.csv", ["# people", "speed,label", "1.5,a", "0.5,b"])
    assert read_data(table).channels == ("speed",)


def test_eight_columns_with_zeros_are_no_tracking_data_of_atc(tmp_path):
    lines = [f"{f / 10},{p},{x},{y},0,0,0,0" for f, p, x, y in walks(10)]
    with pytest.raises(ParseError, match=r"nor ATC .* column 5, the height of a head, is 0"):
        read_recording(write(tmp_path, "zeros.csv", lines), repair=["all"])
    lines = [f"{f / 10},{p},{x},{y},1700,0,0,0" for f, p, x, y in walks(10)]
    with pytest.raises(ParseError, match=r"nor ATC .* column 6, a speed, is 0 for people who move"):
        read_recording(write(tmp_path, "speed.csv", lines), repair=["all"])


def test_bodies_beside_helmets_are_no_people(tmp_path):
    axes = [f"{body} Centroid_{axis}" for body in ("DARKO", "Helmet_1") for axis in "XYZ"]
    rows = [f"{f},{f / 10},{50 * f},9,9,{100 * f},9,1700" for f in range(1, 20)]
    head = ["FILE_ID,R1", "BODY_NAMES,DARKO,Helmet_1", ",".join(["Frame", "Time", *axes])]
    recording = read_recording(write(tmp_path, "bodies.csv", [*head, *rows]))
    assert [track.id for track in recording.tracks] == ["Helmet_1"]
    assert "left out, as others are named helmet: DARKO" in recording.notes
