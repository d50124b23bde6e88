"""`lcorpp data`: recorded motion made, fetched, described and drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console as show, model_files as models
from lcorpp.errors import DataError, FileError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.learning.data.tracks import Recording

app = typer.Typer(
    name="data",
    help="Make, fetch, describe and draw recorded motion.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

SUFFIXES = (".csv", ".parquet", ".npz")

PathArgument = Annotated[
    Path,
    typer.Argument(
        metavar="PATH",
        help="Recorded tracks: a long CSV (track, time, x, y, ...), ATC tracking data, .parquet, .npz, or the"
        " folder of the authors' files.",
    ),
]
LabelOption = Annotated[
    list[str] | None,
    typer.Option("--label", metavar="WORD=CLASS", help="What a written label means; may be given again."),
]
LabelFileOption = Annotated[
    Path | None,
    typer.Option("--label-file", help="CSV of ids and labels, for tracks without; only those are read."),
]
RepairOption = Annotated[
    list[str] | None,
    typer.Option(
        "--repair",
        metavar="NAME",
        help="A fault to repair rather than refuse: rows, cut, nonfinite, order, duplicates, gaps, short,"
        " constant, units, labels or all; may be given again.",
    ),
]
RobotOption = Annotated[
    tuple[float, float, float] | None,
    typer.Option("--robot", metavar="X Y ANGLE", help="Where the robot stood and faced, metres and radians."),
]
GapOption = Annotated[
    float, typer.Option("--gap", help="Seconds of silence after which an id is somebody else's.")
]


@app.command()
def make(
    domain: show.DomainArgument = "intention",
    out: Annotated[
        Path, typer.Option("--out", "-o", help="The file to write: .csv, .parquet or .npz.")
    ] = Path("people.csv"),
    tracks: Annotated[int, typer.Option("--tracks", min=1, help="How many in all.")] = 2286,
    positives: Annotated[
        int | None,
        typer.Option("--positives", min=0, help="How many of the positive class; 63 of 2286 by default."),
    ] = None,
    seconds: Annotated[
        tuple[float, float] | None,
        typer.Option(
            "--seconds", metavar="A B", help="Shortest and longest duration; the domain's by default."
        ),
    ] = None,
    seed: show.SeedOption = 0,
) -> None:
    """Simulate people of a domain and write their tracks: by default 2286, 63 of them positive."""
    if out.suffix.lower() not in SUFFIXES:
        raise FileError(f"{out}: not the name of a recording; {expected_one_of(SUFFIXES)} at its end")
    models.check_writable(out)
    if positives is not None and positives > tracks:
        raise DataError(f"--positives {positives} is more than --tracks {tracks}")

    import numpy as np

    from lcorpp.domains import load_domain
    from lcorpp.learning import save_dataset, to_dataset, write_recording
    from lcorpp.simulation.recordings import simulate_recording

    rng = np.random.default_rng(seed)
    recording = simulate_recording(
        load_domain(domain), rng, tracks=tracks, positives=positives, seconds=seconds
    )
    if out.suffix.lower() == ".npz":
        dataset = to_dataset(recording)
        save_dataset(dataset, out)
        labels, notes = list(dataset.labels), dataset.notes
    else:
        write_recording(recording, out)
        labels, notes = [str(label) for label in recording.labels], recording.notes
    told = ", ".join(f"{labels.count(name)} {name}" for name in sorted(set(labels)))
    show.console.print(f"wrote {out}: {len(labels)} tracks ({told}), seed {seed}")
    for note in notes:
        show.console.print(f"note: {note}", style="yellow")


@app.command()
def fetch(
    what: Annotated[
        str, typer.Argument(metavar="authors|URL", help="The authors' released tracks, or any address.")
    ] = "authors",
    out: Annotated[Path, typer.Option("--out", "-o", help="The folder to put them in.")] = Path("data"),
    sha256: Annotated[
        str | None, typer.Option("--sha256", help="The checksum that the file must have.")
    ] = None,
) -> None:
    """Download recorded tracks, checked; a download that was cut goes on where it stopped."""
    from lcorpp.learning.data.fetching import AUTHORS, fetch as bring

    if what == "authors" and sha256 is not None:
        raise DataError("--sha256 is for an address; the checksums of the authors' files are known")
    wanted = dict(AUTHORS) if what == "authors" else {what: sha256}
    for url, digest in wanted.items():
        with show.progress(url.rsplit("/", 1)[-1]) as advance:
            file = bring(url, out, sha256=digest, progress=advance)
        show.console.print(f"{file}: {file.stat().st_size} bytes, {_checksum(file)}")
    if what == "authors":
        show.console.print("note: their repository names no licence; the tracks are their authors'")


def _checksum(file: Path) -> str:
    import hashlib

    with open(file, "rb") as opened:
        return f"sha256 {hashlib.file_digest(opened, 'sha256').hexdigest()}"


@app.command()
def describe(
    path: PathArgument,
    label: LabelOption = None,
    label_file: LabelFileOption = None,
    repair: RepairOption = None,
    robot: RobotOption = None,
    gap: GapOption = 5.0,
    report: Annotated[
        Path | None, typer.Option("--report", help="CSV to write, a line for each thing repaired.")
    ] = None,
    seed: show.SeedOption = 0,
) -> None:
    """Say what recorded tracks hold, what was repaired, and whether anything but motion tells the label."""
    if report is not None:
        if report.exists() and path.exists() and report.samefile(path):
            raise DataError(f"--report {report}: is the file that is described")
        models.check_writable(report)
    recording = _read(path, label, label_file, repair, robot, gap)

    from lcorpp.cli import describe as data_report
    from lcorpp.files import write_atomically
    from lcorpp.learning.data.writing import repairs_to_csv

    data_report.tell(recording, path, seed)
    if report is not None:
        write_atomically(report, repairs_to_csv(recording.repairs))
        show.console.print(f"wrote {report}: {len(recording.repairs)} repairs")


@app.command()
def plot(
    path: PathArgument,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The picture: .png, .svg or .pdf.")],
    label: LabelOption = None,
    label_file: LabelFileOption = None,
    repair: RepairOption = None,
    robot: RobotOption = None,
    gap: GapOption = 5.0,
) -> None:
    """Draw recorded tracks by class, and their speeds."""
    models.check_picture(out)
    recording = _read(path, label, label_file, repair, robot, gap)

    from lcorpp.learning.data.plots import plot_tracks
    from lcorpp.plot_style import save_figure

    save_figure(plot_tracks(recording, title=path.name), out)
    show.console.print(f"wrote {out}")


def _read(
    path: Path,
    label: list[str] | None,
    label_file: Path | None,
    repair: list[str] | None,
    robot: tuple[float, float, float] | None,
    gap: float,
) -> Recording:
    from lcorpp.learning import read_recording

    labels: dict[str, str] | None = None
    for word, name in map(_meaning, label or ()):
        labels = labels or {}
        if labels.setdefault(word, name) != name:
            raise DataError(f"--label {word}: means {labels[word]!r} and {name!r}; expected one meaning")
    with show.progress(f"reading {path.name}") as advance:
        return read_recording(
            path,
            labels=labels,
            label_file=label_file,
            repair=repair or (),
            robot=robot,
            gap=gap,
            progress=advance,
        )


def _meaning(words: str) -> tuple[str, str]:
    word, sign, name = words.partition("=")
    if not (sign and word and name):
        raise DataError(f"--label {words!r}: expected WORD=CLASS, for example 1=interested")
    return word, name
