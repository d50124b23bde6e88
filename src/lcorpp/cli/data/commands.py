"""`lcorpp data`: simulate, download, describe and plot recorded motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, output_files
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.groups import take_options
from lcorpp.cli.options.recordings import LabelOption, RecordingGroup, parse_written_labels
from lcorpp.cli.options.training import SecondsOption
from lcorpp.errors import DataError, FileError, expected_one_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lcorpp.learning.data.tracks import Recording, Repair

app = typer.Typer(
    name="data",
    add_completion=False,
    help="Simulate, download, describe and plot recorded motion.",
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)

SUFFIXES = (".csv", ".parquet", ".npz")

PathArgument = Annotated[
    Path,
    typer.Argument(
        metavar="PATH",
        help="Recorded tracks: CSV (track, time, x, y, ...), .parquet, .npz, or a format of"
        " docs/guides/data/formats.md (ATC, obsmat, ...); time series (.ts); or a table of features (columns"
        " of numbers, and label).",
    ),
]


@app.command()
@take_consent
def make(
    domain: options.DomainArgument = "intention",
    out: Annotated[
        Path, typer.Option("--out", "-o", help="The file to write: .csv, .parquet or .npz.")
    ] = Path("people.csv"),
    tracks: Annotated[int, typer.Option(min=1, max=options.MAX_TRACKS, help="Number of tracks.")] = 2286,
    positives: Annotated[
        int | None, typer.Option(min=0, help="Number of tracks of the positive class; by default 63 of 2286.")
    ] = None,
    seconds: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="A B", help="Shortest and longest duration; the domain's by default."),
    ] = None,
    seed: options.SeedOption = 0,
) -> None:
    """Simulate people of a domain and write their tracks."""
    if out.suffix.lower() not in SUFFIXES:
        raise FileError(f"{out}: not the name of a recording; {expected_one_of(SUFFIXES)} at its end")
    output_files.check_writable(out)
    if positives is not None and positives > tracks:
        raise DataError(f"--positives {positives} is more than --tracks {tracks}")
    if seconds is not None and not 0 < seconds[0] <= seconds[1]:
        raise DataError(f"--seconds {seconds[0]:g} {seconds[1]:g}: expected 0 < A <= B")

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
    counts = ", ".join(f"{labels.count(name)} {name}" for name in sorted(set(labels)))
    console.out.print(f"wrote {out}: {len(labels)} tracks ({counts}), seed {seed}")
    for note in notes:
        console.out.print(f"note: {note}", style="yellow")


@app.command()
def fetch(
    what: Annotated[
        str, typer.Argument(metavar="authors|URL", help="The authors' released tracks, or any URL.")
    ] = "authors",
    out: Annotated[Path, typer.Option("--out", "-o", help="The folder to write to.")] = Path("data"),
    sha256: Annotated[str | None, typer.Option(help="The expected checksum of the file.")] = None,
) -> None:
    """Download recorded tracks and check them."""
    import hashlib

    from lcorpp.learning.data.fetching import AUTHORS, fetch as download

    if what == "authors" and sha256 is not None:
        raise DataError("--sha256 is for a URL; the checksums of the authors' files are known")
    downloads = dict(AUTHORS) if what == "authors" else {what: sha256}
    for url, digest in downloads.items():
        with console.show_progress(f"downloading {url.rsplit('/', 1)[-1]}") as advance:
            file = download(url, out, sha256=digest, progress=advance)
        with open(file, "rb") as opened:
            checksum = hashlib.file_digest(opened, "sha256").hexdigest()
        console.out.print(f"{file}: {file.stat().st_size} bytes, sha256 {checksum}")
    if what == "authors":
        console.out.print("note: their repository names no licence; the tracks are their authors'")


@app.command()
@take_options
def describe(
    *,
    path: PathArgument,
    label: LabelOption = None,
    recording: RecordingGroup,
    seconds: SecondsOption = None,
    report: Annotated[Path | None, typer.Option(help="CSV file to write, one line per repair.")] = None,
    seed: options.SeedOption = 0,
) -> None:
    """Describe recorded tracks, their repairs and label leakage, or a table of features."""
    if report is not None:
        if report.exists() and path.exists() and report.samefile(path):
            raise DataError(f"--report {report}: is the file that is described; expected another file")
        output_files.check_writable(report)
    from lcorpp.cli.data.describe import print_description, print_features
    from lcorpp.csv_text import format_csv
    from lcorpp.files import write_atomically
    from lcorpp.learning.data.reading import read_features
    from lcorpp.learning.data.repairs import RepairLog
    from lcorpp.learning.data.tracks import Repair

    repair_log = RepairLog(recording.repair or ())
    repairs: Sequence[Repair] = repair_log.repairs
    labels = parse_written_labels(label) or None
    features = read_features(path, labels=labels, repair_log=repair_log, **recording.layout)
    if features is not None:
        if recording.label_file is not None or recording.robot is not None or recording.gap is not None:
            raise DataError(f"{path}: has no tracks; --label-file, --robot and --gap are for tracks")
        if seconds is not None:
            features = features.last(seconds)
        print_features(features, path, repairs, seed)
    else:
        tracks = _read(path, label, recording)
        if seconds is not None:
            tracks = tracks.last(seconds)
        print_description(tracks, path, seed)
        repairs = tracks.repairs
    if report is not None:
        write_atomically(report, format_csv([Repair._fields, *repairs]))
        console.out.print(f"wrote {report}: {len(repairs)} repairs")


@app.command()
@take_options
def plot(
    *,
    path: PathArgument,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The picture: .png, .svg or .pdf.")],
    label: LabelOption = None,
    recording: RecordingGroup,
) -> None:
    """Plot recorded tracks by class, and their speeds."""
    output_files.check_figure(out)
    tracks = _read(path, label, recording)

    from lcorpp.learning.data.plots import plot_tracks
    from lcorpp.plot_style import save_figure

    save_figure(plot_tracks(tracks, title=path.name), out)
    console.out.print(f"wrote {out}")


def _read(path: Path, label: list[str] | None, options: RecordingGroup) -> Recording:
    from lcorpp.learning import read_recording
    from lcorpp.learning.data.cleaning import MAX_GAP

    labels = parse_written_labels(label)
    if path.exists():
        from lcorpp.worlds.ros.people.bag_recording import find_bags

        if find_bags(path):
            from lcorpp.assembly.recorded_data import read_bag_recording

            with console.show_progress(f"reading {path.name}") as advance:
                return read_bag_recording(path, labels, options.choose_reading({}), progress=advance)
    with console.show_progress(f"reading {path.name}") as advance:
        return read_recording(
            path,
            labels=labels or None,
            label_file=options.label_file,
            repair=options.repair or (),
            robot=options.robot,
            gap=MAX_GAP if options.gap is None else options.gap,
            progress=advance,
            **options.layout,
        )
