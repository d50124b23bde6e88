"""Prediction of real pedestrians in scenes without training data: will they turn, will they stop?

    python benchmarks/pedestrians.py FOLDER [--every 3] [--learner NAME] [--features x,y] [--out TABLE.md]

FOLDER has the scenes of ETH (eth, hotel) and UCY (students03, zara01, zara02) in the `obsmat` layout at 2.5
Hz: frame, person, x, z, y and velocities. A case is 9 points of a person, 3.2 s; the label comes from the
next 4.8 s alone. "turn": the direction of some .8 s differs by more than 35 degrees from that of the last .8
s seen; "stop": the speed falls below .2 m/s. Whoever does not move when the label begins is left out, and so
are tracks that end before the label does. Each scene is predicted by a classifier trained on the four others;
the AUC is that of all scenes together.

The learners have their default features. The baselines are a logistic regression and a random forest on
statistics of speed, acceleration and turning, computed here with numpy alone.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from datetime import date
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import typer
from rich.console import Console
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from lcorpp.files import make_folder, write_atomically
from lcorpp.learning import learner
from lcorpp.learning.classifiers.learner_table import default_features
from lcorpp.values import Array, Flags, wrap_angle

INTERVAL = 0.4
"""Seconds between two points."""
N_SEEN, N_AHEAD = 9, 12
"""Points that the classifier sees, and later ones that determine the class."""
DIRECTION_STEPS = 2
"""Steps over which a direction is measured: .8 s."""
MIN_TURN = np.radians(35)
"""A person turns if the direction changes by more."""
MAX_STOP_SPEED, MIN_MOVING_SPEED = 0.2, 0.5
"""m/s; a person stops below the first; above the second, people count as moving."""
MIN_DIRECTION_SPEED = 0.1
"""m/s; below this speed a direction is noise."""
LEARNERS = ("summaries", "forest", "lstm-fast")
"""By default. `minirocket` takes an hour on all windows, and a minute on one window in twelve."""
SCENES = ("eth", "hotel", "students03", "zara01", "zara02")


def read_windows(folder: Path, every: int) -> tuple[Array, npt.NDArray[np.str_]]:
    """Return positions (cases, 2, N_SEEN + N_AHEAD) in metres, one window in `every`, and scenes (cases,)."""
    windows, scenes = [], []
    for file in sorted(folder.glob("*.txt")):
        scene = file.stem.rpartition("_")[2]
        rows = np.loadtxt(file)
        tracks = [rows[rows[:, 1] == person] for person in np.unique(rows[:, 1])]
        step = np.median(np.concatenate([np.diff(track[:, 0]) for track in tracks]))
        for track in tracks:
            for piece in np.split(track, np.flatnonzero(np.diff(track[:, 0]) != step) + 1):
                for first in range(0, len(piece) - N_SEEN - N_AHEAD + 1, every):
                    windows.append(piece[first : first + N_SEEN + N_AHEAD, [2, 4]].T)
                    scenes.append(scene)
    missing = sorted(set(SCENES) - set(scenes))
    if missing:
        raise typer.BadParameter(f"{folder}: no scene {', '.join(missing)}; expected files *_SCENE.txt")
    return np.array(windows), np.array(scenes)


def label_turns(windows: Array) -> tuple[Flags, Flags]:
    """(cases,) who turns in the future, and who moves when it begins."""
    moves = windows[:, :, DIRECTION_STEPS:] - windows[:, :, :-DIRECTION_STEPS]
    now, later = moves[:, :, N_SEEN - DIRECTION_STEPS - 1, None], moves[:, :, N_SEEN - 1 :]
    directions, reference = np.arctan2(later[:, 1], later[:, 0]), np.arctan2(now[:, 1], now[:, 0])
    change = np.abs(wrap_angle(directions - reference))
    is_moving = np.hypot(later[:, 0], later[:, 1]) > MAX_STOP_SPEED * DIRECTION_STEPS * INTERVAL
    speed = np.hypot(now[:, 0, 0], now[:, 1, 0]) / (DIRECTION_STEPS * INTERVAL)
    return ((change > MIN_TURN) & is_moving).any(axis=1), speed > MIN_MOVING_SPEED


def label_stops(windows: Array) -> tuple[Flags, Flags]:
    """(cases,) who stops in the future, and who moves when it begins."""
    speed = np.hypot(*np.diff(windows, axis=2).transpose(1, 0, 2)) / INTERVAL
    return (speed[:, N_SEEN - 1 :] < MAX_STOP_SPEED).any(axis=1), speed[:, N_SEEN - 2] > MIN_MOVING_SPEED


def summarize(tracks: Array) -> Array:
    """(cases, features) statistics of speed, acceleration and turning; the same for a rotated track."""
    velocity = np.diff(tracks, axis=2) / INTERVAL
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    acceleration = np.diff(speed, axis=1) / INTERVAL
    heading = np.arctan2(velocity[:, 1], velocity[:, 0])
    turning = wrap_angle(np.diff(heading, axis=1))
    turning = np.where(np.minimum(speed[:, 1:], speed[:, :-1]) > MIN_DIRECTION_SPEED, turning, 0.0) / INTERVAL
    series = (speed, acceleration, np.abs(acceleration), np.abs(turning))
    features = [f(axis=1) for row in series for f in (row.mean, row.std, row.min, row.max)]
    features += [row[:, -1] for row in series]
    length = np.maximum(speed.sum(axis=1) * INTERVAL, MIN_DIRECTION_SPEED)
    straightness = np.hypot(*(tracks[:, :, -1] - tracks[:, :, 0]).T) / length
    return np.stack([*features, straightness, np.abs(turning.mean(axis=1))], axis=1)


def predict_scenes(make: Callable[[], Any], X: Array, y: Flags, scenes: npt.NDArray[np.str_]) -> Array:
    """(cases,) the probability of "yes", from classifiers trained on the other scenes."""
    found = np.empty(len(y))
    for scene in SCENES:
        train = scenes != scene
        found[~train] = make().fit(X[train], np.where(y, "yes", "no")[train]).predict_proba(X[~train])[:, 1]
    return found


def baselines() -> dict[str, Callable[[], Any]]:
    """Classifiers of `summarize`."""
    forest = {"min_samples_leaf": 5, "class_weight": "balanced_subsample", "random_state": 0}
    return {
        f"baseline: logistic regression, C = {C:g}": lambda C=C: make_pipeline(
            StandardScaler(), LogisticRegression(C=C, class_weight="balanced", max_iter=2000)
        )
        for C in (1.0, 0.01)
    } | {"baseline: random forest": lambda: RandomForestClassifier(100, **forest)}


def main(
    folder: Annotated[Path, typer.Argument(help="Folder of the five scenes.")],
    every: Annotated[int, typer.Option(min=1, help="Use every N-th window of a track.")] = 3,
    learners: Annotated[list[str] | None, typer.Option("--learner", help="Repeatable.")] = None,
    features: Annotated[
        list[str] | None, typer.Option(help="Motion features; repeatable. By default the learner's, and x,y.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the table there, in Markdown.")] = None,
) -> None:
    """Measure, print the table and write it to `--out`."""
    windows, scenes = read_windows(folder, every)
    lines = [
        "| label | classifier | features | all scenes | " + " | ".join(SCENES) + " |",
        "|---" * (4 + len(SCENES)) + "|",
    ]
    counts = []
    for label, rule in (("turn", label_turns), ("stop", label_stops)):
        happens, usable = rule(windows)
        tracks, y, place = windows[usable, :, :N_SEEN], happens[usable], scenes[usable]
        counts.append(f"{label}: {len(y)} cases, {100 * y.mean():.0f} % positive")
        work = [(name, "statistics", make, summarize(tracks)) for name, make in baselines().items()]
        for name in learners or LEARNERS:
            for some in dict.fromkeys(features or [",".join(default_features(name)), "x,y"]):
                own = partial(learner, name, interval=INTERVAL, features=some.split(","))
                work.append((name, some, own, tracks))
        for name, some, make, X in work:
            found = predict_scenes(make, X, y, place)
            aucs = [roc_auc_score(y, found)]
            aucs += [roc_auc_score(y[place == scene], found[place == scene]) for scene in SCENES]
            lines.append(f"| {label} | {name} | {some} | " + " | ".join(f"{a:.3f}" for a in aucs) + " |")
            Console().print(lines[-1], markup=False, soft_wrap=True)
    text = (
        "# Pedestrians\n\n"
        f"`python benchmarks/pedestrians.py FOLDER --every {every}`, {date.today()}, Python"
        f" {platform.python_version()}. AUC in scenes that the classifier was not trained on;"
        f" {'; '.join(counts)}.\n\n" + "\n".join(lines) + "\n"
    )
    if out is not None:
        make_folder(out.parent)
        write_atomically(out, text)


if __name__ == "__main__":
    typer.run(main)
