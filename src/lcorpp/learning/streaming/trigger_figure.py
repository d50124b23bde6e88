"""Plot of accuracy over age, with what triggers reach."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.learning.streaming.trigger_fitting import TriggerSearch
from lcorpp.plot_style import BLUE, INK, MUTED, ORANGE, despine, save_figure, with_style


@with_style
@check_arguments
def draw_trigger(searches: Mapping[str, TriggerSearch]) -> Figure:
    """Draw the figure of `plot_trigger`; arguments and errors are the same."""
    if not searches:
        raise DataError("there is no search of a trigger to draw")
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    first = next(iter(searches.values()))
    axes.plot(
        first.seconds,
        first.accuracy,
        color=INK,
        linewidth=1.6,
        drawstyle="steps-post",
        label="all at one age",
    )
    for (name, search), colour in zip(searches.items(), cycle((BLUE, ORANGE, MUTED)), strict=False):
        points = np.array([(score.seconds, score.accuracy) for score in search.scores]).T
        axes.plot(*points, "o", color=colour, markersize=3, alpha=0.6)
        expected = search.trigger.expected
        if expected is not None:
            label = f"{name}: {expected}"
            axes.plot(expected.seconds, expected.accuracy, "o", color=colour, markersize=9, label=label)
    axes.set(xlabel="mean age at the decision, s", ylabel="accuracy", xlim=(0, None))
    axes.legend(frameon=False, loc="upper left")
    despine(axes)
    return figure


@check_arguments
def plot_trigger(searches: Mapping[str, TriggerSearch], path: str | Path) -> None:
    """Plot the accuracy over the age of the tracks, and the triggers to choose from, to a file.

    The line is the accuracy if all tracks are decided at one age. Each small point is a trigger that was not
    chosen, at its mean age; the large one is the expected score of the chosen trigger on unseen people.

    Args:
        searches: name for the legend -> search, all on the same timeline.
        path: a .png, .svg or .pdf file.

    Raises:
        FileError: the file cannot be written, or has no suffix of a picture.
        DataError: there are no searches.

    Examples:
        >>> from pathlib import Path
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, plot_trigger, search_trigger
        >>> yes = np.array([[0.5, 0.5], [0.1, 0.9], [0.1, 0.9], [0.1, 0.9]])  # P(no), P(yes) at each point
        >>> timeline = PredictionTimeline(
        ...     10 * [yes, 1 - yes], (1, 2, 3, 4), 10 * ["yes", "no"], ("no", "yes"), 0.5, 5 * [0, 0, 1, 1]
        ... )
        >>> plot_trigger({"one threshold": search_trigger(timeline)}, "trigger.svg")
        >>> Path("trigger.svg").read_text()[:5]
        '<?xml'
    """
    save_figure(draw_trigger(searches), path)
