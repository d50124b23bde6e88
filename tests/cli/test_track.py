"""`lcorpp track`: images to tracks, and what is wrong with its input."""

import sys

import numpy as np
import pytest
import typer

from lcorpp.cli.main import main
from lcorpp.cli.robot.track import track
from lcorpp.learning import read_recording
from tests.camera.corridor import Mount, Person, add_noise, render

cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is not installed")

MOUNT = Mount(160, 120, 142.0)
INTRINSICS = ("--intrinsics", 142, 142, 79.5, 59.5)


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command by itself, with the messages of `lcorpp`."""
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command()(track)

    def run(*arguments):
        monkeypatch.setattr(
            "lcorpp.cli.main._run_command", lambda given: app(given, prog_name="lcorpp track")
        )
        monkeypatch.setattr(sys, "argv", ["lcorpp", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        return ended.value.code or 0, captured.out, captured.err

    return run


@pytest.fixture
def depths(tmp_path):
    folder, rng = tmp_path / "depths", np.random.default_rng(0)
    folder.mkdir()
    for index in range(20):
        image = add_noise(render(MOUNT, [Person(4 - 0.1 * index, 0.2)]), rng)
        assert cv2.imwrite(str(folder / f"{5 + index / 10:.2f}.png"), image)
    return folder


@pytest.fixture
def homography(tmp_path):
    file = tmp_path / "h.txt"
    file.write_text("0.01 0 0\n0 0.01 0\n0 0.001 1\n")
    return file


def test_depth_images_become_tracks(run, depths, tmp_path):
    out = tmp_path / "tracks.csv"
    code, printed, _ = run(depths, "-o", out, *INTRINSICS)
    assert (code, printed) == (0, f"wrote {out}: 1 tracks, 20 samples, in 20 images\n")
    (person,) = read_recording(out).tracks
    assert person.times == pytest.approx(5 + np.arange(20) / 10)
    assert person.columns["x"] == pytest.approx(4 - np.arange(20) / 10, abs=0.15)
    assert person.columns["y"] == pytest.approx(0.2, abs=0.1)


def change(folder, function):
    """Apply a function to all images of a folder."""
    for file in folder.iterdir():
        image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(file), function(image))


def test_images_of_a_camera_that_is_mounted_sideways_are_turned(run, depths, tmp_path):
    change(depths, lambda image: np.ascontiguousarray(np.rot90(image, 1)))
    intrinsics, out = ("--intrinsics", 142, 142, 59.5, 79.5), tmp_path / "tracks.csv"
    assert run(depths, "-o", out, *intrinsics, "--rotate", 90)[0] == 0
    (person,) = read_recording(out).tracks
    assert person.columns["x"] == pytest.approx(4 - np.arange(20) / 10, abs=0.15)


def test_a_warning_names_the_unit_of_the_depths(run, depths, tmp_path):
    change(depths, lambda image: np.minimum(5.0 * image, 65535).astype(np.uint16))
    code, printed, err = run(depths, "-o", tmp_path / "t.csv", *INTRINSICS)
    assert (code, printed.startswith("no people were tracked")) == (0, True)
    words = " ".join(err.split())
    assert words.startswith("warning: ")
    assert "the floor was found in 0 of 20 images; with 1000 values a metre the floor is 6" in words
    assert "--depth-scale 5000 (TUM RGB-D): 1.2 m" in words
    code, printed, err = run(depths, "-o", tmp_path / "t.csv", *INTRINSICS, "--depth-scale", 5000)
    assert (code, err) == (0, "")
    assert "1 tracks, 20 samples" in printed


def test_a_part_is_tracked(run, depths, tmp_path):
    out = tmp_path / "tracks.csv"
    assert run(depths, "-o", out, *INTRINSICS, "--from", 0.5, "--to", 1.2)[0] == 0
    assert read_recording(out).tracks[0].times == pytest.approx(5.5 + np.arange(8) / 10)


def test_an_own_detector_in_a_video(run, homography, tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (64, 48))
    for index in range(20):
        writer.write(np.full((48, 64, 3), 10 * index, np.uint8))
    writer.release()
    (tmp_path / "own.py").write_text("def feet(image):\n    return [(image.mean() / 5, 20)]\n")
    out = tmp_path / "tracks.csv"
    code, _, err = run(
        tmp_path / "v.avi", "-o", out, "--homography", homography, "--detector", f"{tmp_path}/own.py:feet"
    )
    assert (code, err) == (0, "")
    assert read_recording(out).tracks[0].duration == pytest.approx(1.9)


def test_an_interrupt_keeps_what_is_tracked(run, depths, tmp_path, monkeypatch):
    from lcorpp.camera import DepthLocator

    locate, calls = DepthLocator.locate, []

    def interrupted(self, image):
        calls.append(1)
        if len(calls) == 12:
            raise KeyboardInterrupt
        return locate(self, image)

    monkeypatch.setattr(DepthLocator, "locate", interrupted)
    out = tmp_path / "tracks.csv"
    code, _, err = run(depths, "-o", out, *INTRINSICS)
    assert code == 130
    assert f"interrupted after 11 images; wrote {out}: 1 tracks, 11 samples" in err
    assert len(read_recording(out).tracks[0]) == 11


def test_an_empty_scene_writes_nothing(run, tmp_path):
    folder = tmp_path / "a"
    folder.mkdir()
    cv2.imwrite(str(folder / "0.png"), np.zeros((120, 160), np.uint16))
    code, printed, _ = run(folder, "-o", tmp_path / "t.csv", *INTRINSICS)
    assert (code, printed) == (
        0,
        f"no people were tracked, and {tmp_path}/t.csv is not written, in 1 images\n",
    )
    assert not (tmp_path / "t.csv").exists()


def test_a_damaged_image_writes_nothing(run, depths, tmp_path):
    (depths / "6.00.png").write_bytes(b"no image")
    code, _, err = run(depths, "-o", tmp_path / "t.csv", *INTRINSICS)
    assert (code, "6.00.png: cannot be read as an image" in err) == (2, True)
    assert not (tmp_path / "t.csv").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "5.00.png: has depths, whose camera is unknown; expected --intrinsics"),
        (("--homography", "h.txt", *INTRINSICS), "has depths; --homography is for colour images"),
        (("--intrinsics", 0, 1, 2, 3), "focal lengths above 0"),
        ((*INTRINSICS, "--from", 3, "--to", 2), "expected the first to be less"),
        ((*INTRINSICS, "--from", 30), "has no images between --from and --to"),
        ((*INTRINSICS, "--topic", "/x"), "--topic is for bags"),
        ((*INTRINSICS, "--rate", 0), "the rate is 0 images a second"),
        ((*INTRINSICS, "--rotate", 45), "a rotation by 45 degrees; expected one of 0, 90, 180, 270"),
        ((*INTRINSICS, "--depth-scale", 0), "the depth scale is 0 values a metre; expected a number above 0"),
        ((*INTRINSICS, "-o", "tracks.txt"), "not the name of a recording; expected one of .csv"),
        ((*INTRINSICS, "-o", "none/tracks.csv"), "cannot be written: there is no folder none"),
    ],
)
def test_wrong_options_are_refused(run, depths, homography, tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    output = () if "-o" in options else ("-o", "tracks.csv")
    code, _, err = run("depths", *output, *options)
    assert (code, err.startswith("lcorpp: ")) == (2, True)
    assert message in err


def test_colour_needs_a_sound_homography(run, tmp_path):
    folder = tmp_path / "a"
    folder.mkdir()
    cv2.imwrite(str(folder / "0.png"), np.zeros((48, 64, 3), np.uint8))
    assert "is a colour image; expected --homography" in run(folder, "-o", tmp_path / "t.csv")[2]
    (tmp_path / "h.txt").write_text("1 1 1\n1 1 1\n1 1 1\n")
    err = run(folder, "-o", tmp_path / "t.csv", "--homography", tmp_path / "h.txt")[2]
    assert "h.txt: the homography is singular" in err
