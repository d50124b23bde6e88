"""The formats of rows: what their columns mean, and how each is recognised by its numbers.

Sources: Brscic, Kanda, Ikeda and Miyashita, IEEE Transactions on Human-Machine Systems 43, 2013 (ATC);
Pellegrini, Ess, Schindler and van Gool, ICCV 2009 (ETH's obsmat); Robicquet, Sadeghian, Alahi and Savarese,
ECCV 2016 (Stanford Drone Dataset); the data archive of experiments about pedestrian dynamics of
Forschungszentrum Juelich (HERMES); Leal-Taixe and others, arXiv 1504.01942 (MOTChallenge); Bock and others,
IV 2020 (inD); Yang, Li, Redmill and Oezguener, IV 2019 (CITR).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lcorpp.learning.data.csv_reader import WHITESPACE, RowBatch
from lcorpp.learning.data.formats.sample import Sample
from lcorpp.learning.data.measures import Measures
from lcorpp.values import Array

PEDESTRIAN = "Pedestrian"
"""The kind of the Stanford Drone Dataset whose rows are read; others ride or drive."""


def use_centres(batch: RowBatch, left_out: Counter[str]) -> RowBatch:
    """Use the centre of a box seen from above, of pedestrians in view."""
    lost = batch.numbers["lost"] != 0
    kinds = np.array([kind != PEDESTRIAN for kind in batch.texts["kind"]], dtype=bool)
    for kind in sorted(set(batch.texts["kind"]) - {PEDESTRIAN}):
        left_out[f"{kind or 'no kind'}"] += batch.texts["kind"].count(kind)
    left_out["lost pedestrians"] += int((lost & ~kinds).sum())
    batch = batch.take(np.flatnonzero(~(lost | kinds)))
    x = (batch.numbers["xmin"] + batch.numbers["xmax"]) / 2
    y = (batch.numbers["ymin"] + batch.numbers["ymax"]) / 2
    return _with_points(batch, x, y)


def use_world(batch: RowBatch, left_out: Counter[str]) -> RowBatch:
    """Use the position in the world, of rows that are to be considered (confidence above 0)."""
    ignored = batch.numbers["conf"] == 0
    left_out["confidence 0"] += int(ignored.sum())
    batch = batch.take(np.flatnonzero(~ignored))
    return _with_points(batch, batch.numbers["world x"], batch.numbers["world y"])


def use_feet(batch: RowBatch, left_out: Counter[str]) -> RowBatch:
    """Use the middle of the lower edge of a box in a camera's image, where the feet are."""
    ignored = batch.numbers["conf"] == 0
    left_out["confidence 0"] += int(ignored.sum())
    if "class" in batch.numbers:
        others = ~ignored & (batch.numbers["class"] != 1)
        left_out["classes other than 1, pedestrians"] += int(others.sum())
        ignored |= others
    batch = batch.take(np.flatnonzero(~ignored))
    x = batch.numbers["left"] + batch.numbers["width"] / 2
    return _with_points(batch, x, batch.numbers["top"] + batch.numbers["height"])


def _with_points(batch: RowBatch, x: Array, y: Array) -> RowBatch:
    return RowBatch(batch.lines, {**batch.numbers, "x": x, "y": y}, batch.texts)


Convert = Callable[[RowBatch, Counter[str]], RowBatch]

ANNOTATION_STEP = 0.4
"""Seconds between two annotations of a person in the sets of ETH and UCY."""

HEAD_HEIGHTS = (0.5, 2.6)
"""Heights of a head in metres, of children and adults."""


METRES = Measures(1.0, 1.0)
"""Metres and seconds."""


@dataclass(frozen=True)
class Layout:
    """A format of rows.

    name: for messages. columns: their names in the order of the file; those of the long format are read,
    and those of `numbers` and `words` for `convert`.
    measures: its units; length None: pixels, so that a scale must be given; per_second None: the frame rate
    must be given, if `is_frames`. suggestion: the options that give it.
    convert: changes a batch of rows, and counts the rows that it leaves out, by reason.
    """

    name: str
    columns: tuple[str, ...] = ()
    measures: Measures = METRES
    is_frames: bool = False
    suggestion: str = ""
    numbers: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    convert: Convert | None = None
    made: tuple[str, ...] = ()
    """Columns of the long format that `convert` adds."""


LONG = Layout("long CSV")


def use_velocities(batch: RowBatch, left_out: Counter[str]) -> RowBatch:
    """Replace the velocities vx and vy by the speed and the direction of motion."""
    vx, vy = batch.numbers["vx"], batch.numbers["vy"]
    made = {"velocity": np.hypot(vx, vy), "heading": np.arctan2(vy, vx)}
    return RowBatch(batch.lines, {**batch.numbers, **made}, batch.texts)


def _use_road_users(batch: RowBatch, left_out: Counter[str]) -> RowBatch:
    """Leave out vehicles, which have a width; the orientation in degrees is not read."""
    walks = ~(batch.numbers["width"] > 0)
    left_out["vehicles"] += int((~walks).sum())
    return use_velocities(batch.take(np.flatnonzero(walks)), left_out)


ATC = Layout(
    "ATC tracking data",
    ("time", "track", "x", "y", "z", "velocity", "heading", "facing"),
    Measures(1e-3, 1.0),
)
OBSMAT = Layout(
    "obsmat of ETH and UCY",
    ("time", "track", "x", "height", "y", "vx", "vz", "vy"),
    Measures(1.0, None),
    is_frames=True,
    numbers=("vx", "vy"),
    made=("velocity", "heading"),
    convert=use_velocities,
)
POINTS = Layout("text of frame, id, x, y", ("time", "track", "x", "y"), Measures(1.0, None), is_frames=True)
HEADS = Layout(
    "text of id, frame, x, y, z", ("track", "time", "x", "y", "z"), Measures(0.01, 16.0), is_frames=True
)
DRONE = Layout(
    "annotations of the Stanford Drone Dataset",
    ("track", "xmin", "ymin", "xmax", "ymax", "time", "lost", "occluded", "generated", "kind"),
    Measures(None, 30.0),
    is_frames=True,
    numbers=("xmin", "ymin", "xmax", "ymax", "lost"),
    words=("kind",),
    made=("x", "y"),
    convert=use_centres,
)
MOT = Layout(
    "MOTChallenge",
    ("time", "track", "left", "top", "width", "height", "conf", "world x", "world y", "world z"),
    Measures(1.0, None),
    is_frames=True,
    numbers=("conf", "world x", "world y"),
    made=("x", "y"),
    convert=use_world,
)
MOT_BOXES = Layout(
    "boxes of MOTChallenge",
    ("time", "track", "left", "top", "width", "height", "conf", "class", "visibility"),
    Measures(None, None),
    is_frames=True,
    numbers=("left", "top", "width", "height", "conf", "class"),
    made=("x", "y"),
    convert=use_feet,
)
IND = Layout(
    "inD",
    measures=Measures(1.0, 25.0),
    is_frames=True,
    numbers=("vx", "vy", "width"),
    made=("velocity", "heading"),
    convert=_use_road_users,
)
CITR = Layout(
    "CITR",
    measures=Measures(1.0, 29.97),
    is_frames=True,
    numbers=("vx", "vy"),
    made=("velocity", "heading"),
    convert=use_velocities,
)

_HEADINGS: tuple[tuple[Layout, Mapping[str, str]], ...] = (
    (
        IND,
        {
            "trackid": "track",
            "frame": "time",
            "xcenter": "x",
            "ycenter": "y",
            "xvelocity": "vx",
            "yvelocity": "vy",
            "width": "width",
        },
    ),
    (CITR, {"id": "track", "frame": "time", "x_est": "x", "y_est": "y", "vx_est": "vx", "vy_est": "vy"}),
)
"""Layouts with a heading: the name of a column in the file -> what it is."""


def recognise_heading(names: Sequence[str]) -> Layout | None:
    """Return the layout of a file with these columns, in lower case; None for the long format."""
    for layout, meanings in _HEADINGS:
        if set(meanings) <= set(names):
            return replace(layout, columns=tuple(meanings.get(name, f"{name} of the file") for name in names))
    return None


def recognise_rows(sample: Sample) -> tuple[Layout | None, list[str]]:
    """Return the layout of a file without a heading, and for each that was tried why it is not that."""
    reasons = list[str]()
    for recognise in (_find_obsmat, _find_atc, _find_drone, _find_mot, _find_points, _find_heads):
        found = recognise(sample)
        if isinstance(found, Layout):
            return found, []
        if found:
            reasons.append(found)
    return None, reasons


def _with_rate(layout: Layout, sample: Sample, rates: Array, columns: tuple[int, int]) -> Layout:
    """Return a layout of frames with a frame rate, or the suggestion of one.

    rates: (steps,) frames per second by stated velocities. columns: of the id and of the time.
    """
    if sample.frame_rate is not None:
        return replace(layout, measures=replace(layout.measures, per_second=sample.frame_rate))
    rate = float(np.median(rates)) if len(rates) else None
    if rate is not None and 0.8 < rate < 1.25:
        return replace(layout, measures=replace(layout.measures, per_second=1.0), is_frames=False)
    if not sample.has_whole(columns[1]):  # no frame numbers
        return replace(layout, measures=replace(layout.measures, per_second=1.0), is_frames=False)
    steps = sample.steps(*columns, *columns)[0]
    step = float(np.median(steps)) if len(steps) else 1.0
    usual = step / ANNOTATION_STEP
    if rate is not None:
        rate = usual if abs(np.log(rate / usual)) < 0.2 else round(rate, 1)
        return replace(layout, suggestion=f"--fps {rate:g}, at which velocities and positions agree")
    if step == 1 or layout.measures.length is None:  # each frame of a video
        return layout
    suggestion = (
        f"--fps {usual:g} if {step:g} frames are {ANNOTATION_STEP:g} s, as in the sets of ETH and UCY"
    )
    return replace(layout, suggestion=suggestion)


def _agree(rates: Array) -> bool:
    """Whether most rates are the same within a factor of two."""
    low, high = np.quantile(rates, [0.25, 0.75]) if len(rates) else (1.0, 1.0)
    return bool(high <= 2 * low)


def _find_obsmat(sample: Sample) -> Layout | str:
    if sample.width != 8:
        return ""
    table, name = sample.table, "obsmat (frame, id, x, 0, y, vx, 0, vy)"
    if table[:, [3, 6]].any() or not sample.has_whole(1):
        return f"{name}: columns 4 and 7, the height and its velocity, are not 0"
    rates = sample.stated_rates(1, 0, 2, 4, np.hypot(table[:, 5], table[:, 7]))
    if not _agree(rates):
        return f"{name}: its velocities do not agree with its positions"
    return _with_rate(OBSMAT, sample, rates, (1, 0))


def _find_atc(sample: Sample) -> Layout | str:
    if sample.width != 8:
        return ""
    table, name = sample.table, f"ATC tracking data ({', '.join(ATC.columns)})"
    fine = np.isfinite(table).all(axis=1)
    if not fine.any():
        return f"{name}: no row has eight numbers"
    table = table[fine]
    if np.mean(table[:, 5] < 0) > 0.1:
        return f"{name}: column 6, a speed, is negative"
    if np.abs(table[:, 6:]).max() > 360:
        return f"{name}: columns 7 and 8, angles, are up to {np.abs(table[:, 6:]).max():.4g}"
    if not table[:, 4].any():
        return f"{name}: column 5, the height of a head, is 0"
    if not table[:, 5].any() and sample.steps(1, 0, 2, 3)[1].any():
        return f"{name}: column 6, a speed, is 0 for people who move"
    rates = replace(sample, table=table).stated_rates(1, 0, 2, 3, table[:, 5])
    rate = float(np.median(rates)) / (sample.per_second or 1.0) if len(rates) else 1.0
    if not 0.1 <= rate <= 10:
        return f"{name}: its velocities are {rate:.3g} times the speed of its positions"
    return ATC


def _find_drone(sample: Sample) -> Layout | str:
    table = sample.table
    if sample.width != 10 or not np.isnan(table[:, 9]).all() or not np.isfinite(table[:, :9]).all():
        return ""
    if not sample.has_whole(0, 5, 6, 7, 8) or (table[:, 1:3] > table[:, 3:5]).any():
        return f"{DRONE.name} ({', '.join(DRONE.columns)}): columns 2 to 5 are not boxes"
    return DRONE


def _find_mot(sample: Sample) -> Layout | str:
    table = sample.table
    if not 7 <= sample.width <= 10 or sample.delimiter == WHITESPACE or not sample.has_whole(0, 1):
        return ""
    if sample.width == 8 or not (table[:, 4:6] > 0).all() or (table[:, 0] < 0).any():
        return ""
    if (table[:, 1] == -1).all():
        return "MOTChallenge: column 2, the id, is -1 in all rows: detections without tracks"
    layout = MOT
    if sample.width < 10 or (table[:, 7:9] == -1).all():  # no positions in the world
        known = MOT_BOXES.columns[: sample.width if sample.width != 10 else 7]
        layout = replace(MOT_BOXES, columns=(*known, *MOT.columns[len(known) : sample.width]))
    return _with_rate(layout, sample, np.zeros(0), (1, 0))


def _find_points(sample: Sample) -> Layout | str:
    if sample.width != 4 or not np.isfinite(sample.table).all():
        return ""
    order = _find_order(sample)
    if order is None:
        return "rows of frame, id, x, y: neither of the first columns is an id whose times rise"
    columns = ("track", "time") if order == (0, 1) else ("time", "track")
    layout = replace(POINTS, name=f"text of {', '.join(columns)}, x, y", columns=(*columns, "x", "y"))
    return _with_rate(layout, sample, np.zeros(0), order)


def _find_heads(sample: Sample) -> Layout | str:
    if sample.width != 5 or not np.isfinite(sample.table).all():
        return ""
    order = _find_order(sample)
    if order is None:
        return "rows of id, frame, x, y, z: neither of the first columns is an id whose times rise"
    columns = ("track", "time") if order == (0, 1) else ("time", "track")
    height = float(np.median(sample.table[:, 4]))
    fitting = [unit for unit in (1.0, 0.01, 0.001) if HEAD_HEIGHTS[0] <= height * unit <= HEAD_HEIGHTS[1]]
    if not fitting:
        return (
            f"rows of id, frame, x, y, z: column 5 is {height:.4g}, not the height of a head in m, cm or mm"
        )
    measures = HEADS.measures if fitting[0] == 0.01 else Measures(fitting[0], None)
    layout = replace(HEADS, name=f"text of {', '.join(columns)}, x, y, z", columns=(*columns, "x", "y", "z"))
    layout = replace(layout, measures=measures)
    if measures.per_second is not None and sample.frame_rate is None:
        return layout
    return _with_rate(layout, sample, np.zeros(0), order)


def _find_order(sample: Sample) -> tuple[int, int] | None:
    """Return which of the first two columns is the id and which the time: people move little in a step."""
    found = []
    for track, time in ((1, 0), (0, 1)):
        if not sample.has_whole(track):
            continue
        steps, distances = sample.steps(track, time, 2, 3)
        if len(steps):
            repeats = sum(int((np.diff(rows[:, time]) == 0).sum()) for rows in sample.persons(track, time))
            found.append((repeats, float(np.median(distances)), (track, time)))
    return min(found)[2] if found else None
