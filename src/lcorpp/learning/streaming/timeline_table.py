"""Write predictions over time as a tidy table: a row for each track and age."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.csv_text import format_csv
from lcorpp.errors import FileError, expected_one_of
from lcorpp.files import PARQUET_SUFFIXES, write_atomically
from lcorpp.learning.data.formats.parquet import import_pyarrow
from lcorpp.learning.streaming.timeline import PredictionTimeline
from lcorpp.learning.streaming.trigger import list_ages


@check_arguments
def write_timeline(timeline: PredictionTimeline, path: str | Path) -> None:
    """Write the predictions at each age at which they change, as .csv or .parquet.

    Columns: case (from 0), label, group and fold if they are known, age (s), points, and `probability CLASS`
    for each class. `cross_calibrate_prefixes` gives the timeline calibrated probabilities, out of fold.

    Raises:
        FileError: the file cannot be written, or its name has another ending.
        DataError: pyarrow is not installed.

    Examples:
        >>> from pathlib import Path
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, write_timeline
        >>> yes = np.array([[0.4, 0.6], [0.1, 0.9]])  # P(no), P(yes) after one point, after two
        >>> tracks = 8 * [yes] + 2 * [1 - yes] + 8 * [1 - yes] + 2 * [yes]  # correct in 80 % of the cases
        >>> labels, folds = 10 * ["yes"] + 10 * ["no"], 10 * [0, 1]
        >>> timeline = PredictionTimeline(tracks, (1, 2), labels, ("no", "yes"), 0.5, folds)
        >>> write_timeline(timeline, "timeline.csv")
        >>> Path("timeline.csv").read_text().splitlines()[:2]
        ['case,label,fold,age,points,probability no,probability yes', '0,yes,0,0.0,1,0.4,0.6']
    """
    columns = tabulate_timeline(timeline)
    suffix, content = Path(path).suffix.lower(), io.BytesIO()
    if suffix == ".csv":
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        content.write(format_csv([columns, *rows]).encode())
    elif suffix in PARQUET_SUFFIXES:
        arrow = import_pyarrow()
        arrow.parquet.write_table(arrow.table(columns), content)
    else:
        raise FileError(
            f"{path}: not the name of a table; {expected_one_of(('.csv', *PARQUET_SUFFIXES))} at its end"
        )
    write_atomically(path, content.getvalue())


def tabulate_timeline(timeline: PredictionTimeline) -> dict[str, np.ndarray]:
    """Return the columns of `write_timeline`, each (rows,): by case, then by age."""
    times = np.array(list_ages(timeline), dtype=np.intp)
    known = np.isfinite(timeline.probabilities[:, times]).all(axis=2)
    case, age = np.nonzero(known)
    time = times[age]
    own = {"label": timeline.labels, "group": timeline.groups, "fold": timeline.folds}
    return {
        "case": case,
        **{name: np.array(values)[case] for name, values in own.items() if values},
        "age": timeline.seconds[time].round(9),
        "points": np.array(timeline.points)[time],
        **{
            f"probability {name}": timeline.probabilities[case, time, column]
            for column, name in enumerate(timeline.classes)
        },
    }
