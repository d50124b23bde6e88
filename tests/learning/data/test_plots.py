"""Plots of tracks: every class has its panel, and omitted tracks are counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import Recording
from lcorpp.learning.data.plots import plot_tracks
from lcorpp.plot_style import save_figure

from .texts import crowd, walk


def test_a_panel_for_each_class_and_one_for_speeds(tmp_path):
    recording = crowd(30)
    unlabelled = [replace(track, label=None) for track in recording.tracks[:5]]
    figure = plot_tracks(Recording((*unlabelled, *recording.tracks[5:])), title="a crowd", max_tracks=10)
    *panels, speeds = figure.axes
    titles = [axes.get_title() for axes in panels]
    assert titles == ["in: 10 of 12 tracks", "out: 10 of 13 tracks", "without a label: 5 tracks"]
    assert [text.get_text() for text in speeds.get_legend().get_texts()] == ["in", "out", "without a label"]
    assert [len(panel.collections[0].get_segments()) for panel in panels] == [10, 10, 5]
    save_figure(figure, tmp_path / "a.svg")
    save_figure(figure, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000


def test_the_speeds_are_those_of_the_tracks():
    speeds = plot_tracks(Recording((walk("a", seconds=10), walk("b", seconds=4)))).axes[-1]
    times, median = (np.asarray(values) for values in speeds.lines[0].get_data())
    np.testing.assert_allclose(median, 1.0)
    assert times.min() == pytest.approx(-9.8)  # half of the tracks reach back ten seconds
    assert times.max() == pytest.approx(-0.2)


def test_tracks_too_short_for_a_speed_are_drawn():
    assert len(plot_tracks(Recording((walk("a", seconds=0.1),))).axes) == 2


def test_an_empty_recording_cannot_be_drawn():
    with pytest.raises(DataError, match="there are no tracks to draw"):
        plot_tracks(Recording(()))
