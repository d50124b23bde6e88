"""The figure of a measurement: what is heard by what is said, for each noise, in the test."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from lcorpp.hearing.observing import Observed
from lcorpp.plot_style import Fill, with_style


@with_style
def plot_rates(observed: Observed) -> Figure:
    """Draw stacked bars of P(heard | said), one panel for each noise."""
    cases = observed.test
    counts = cases.count()
    rates = counts / np.maximum(counts.sum(axis=2, keepdims=True), 1)
    figure = Figure(figsize=(2.2 + 2.6 * len(cases.noises), 3.4), layout="constrained")
    panels = figure.subplots(1, len(cases.noises), sharey=True, squeeze=False)[0]
    for place, (axes, noise) in enumerate(zip(panels, cases.noises, strict=True)):
        bottom = np.zeros(len(cases.kinds))
        for number, name in enumerate(cases.observations):
            fill, height = Fill.of(number), rates[:, place, number]
            axes.bar(
                cases.kinds, height, bottom=bottom, color=fill.colour, hatch=fill.hatch, width=0.7, label=name
            )
            bottom += height
        axes.set_title(noise, fontsize=10, loc="left")
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlabel("said")
    panels[0].set_ylabel("P(heard | said)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False, title="heard")
    return figure
