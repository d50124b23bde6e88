"""The figure of an alarm: E of each part over the people of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from lcorpp.plot_style import COLOURS, despine, with_style
from lcorpp.trust.finding import HEARING, KNOWLEDGE


@with_style
def plot_alarm(log_e: Sequence[Mapping[str, float]], rate: float) -> Figure:
    """Draw the decimal logarithm of E of each part over the number of people, and the threshold.

    Args:
        log_e: as of `LogWatch`. rate: of false alarms.
    """
    figure = Figure(figsize=(4.5, 2.5), layout="constrained")
    axes = figure.subplots()
    people = np.arange(1, len(log_e) + 1)
    for colour, part in zip(COLOURS, (KNOWLEDGE, HEARING), strict=False):
        axes.plot(people, [values[part] / np.log(10) for values in log_e], color=colour, label=part)
    axes.axhline(-np.log10(rate), color="0.5", linewidth=0.8, linestyle="--", label="alarm")
    axes.set_xlabel("people")
    axes.set_ylabel("log10 E")
    axes.legend(frameon=False)
    despine(axes)
    return figure
