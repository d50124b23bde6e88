"""Verdicts and the paragraph follow from the numbers; the figure shows the region."""

import numpy as np
import pytest

from lcorpp.experiments.figures.result import Verdict
from lcorpp.experiments.sweeps.figure import plot_sweep
from lcorpp.experiments.sweeps.hypotheses import describe_results, judge_configuration, list_hypotheses


def row(strategy: str, return_: float, advantage: tuple[float, float, float] | None, **axes: object) -> dict:
    """A strategy; `advantage` is by how much the next one is better: more return, less cost."""
    ends = ("", "_low", "_high")
    cells = {f"return{end}": return_ for end in ends} | {f"cost{end}": 50 - return_ for end in ends}
    for end, number in zip(ends, advantage or (None,) * 3, strict=True):
        cells[f"return_difference{end}"] = number
    for end, number in zip(ends, (None,) * 3 if advantage is None else advantage, strict=True):
        other = {"": "", "_low": "_high", "_high": "_low"}[end]
        cells[f"cost_difference{other}"] = None if number is None else -number
    return {**axes, "strategy": strategy, **cells, "converged": True}


def configuration(best: float, lower=(1.0, 0.5, 1.5), upper=(2.0, 1.0, 3.0), **axes: object) -> list[dict]:
    rows = [
        row("P", best - 3, lower, **axes),
        row("R+P", best - 2, upper, **axes),
        row("LCORPP", best, None, **axes),
    ]
    return [{**cells, **judge_configuration(rows)} for cells in rows]


@pytest.mark.parametrize(
    ("lower", "verdict"),
    [
        ((1.0, 0.5, 1.5), Verdict.HOLDS),
        ((1.0, -0.5, 2.5), Verdict.OPEN),
        ((-1.0, -1.5, -0.5), Verdict.FAILS),
        ((0.0, 0.0, 0.0), Verdict.FAILS),
        ((1e-13, 1e-13, 1e-13), Verdict.FAILS),  # a rounding error of exact scores
    ],
)
def test_verdicts(lower, verdict):
    rows = configuration(10, lower)
    assert {cells["return_hypothesis"] for cells in rows} == {verdict}
    assert {cells["cost_hypothesis"] for cells in rows} == {verdict}


def test_hypotheses_on_some_of_the_strategies():
    assert [str(h) for h in list_hypotheses(["L", "P", "LCORPP"])] == [
        "LCORPP > P in return",
        "LCORPP < P in cost",
    ]
    assert list_hypotheses(["L", "P"]) == []


def test_the_paragraph_states_where_a_hypothesis_does_not_hold():
    rows = []
    for noise in (0.1, 0.2, 0.3):
        for program in ("high.plog", "low.plog"):
            worse = (-1.0, -1.5, -0.5) if noise > 0.1 and program == "low.plog" else (1.0, 0.5, 1.5)
            rows += configuration(30 - noise, worse, noise=noise, knowledge=program)
    text = describe_results(rows, ["noise", "knowledge"], "intention")
    assert text.startswith(
        "6 configurations of intention: noise from 0.1 to 0.3, knowledge high.plog or low.plog."
        " The highest return: LCORPP in 6. LCORPP > R+P > P in return: holds in 4, does not hold in 2."
        " Where it does not hold, noise is 0.2 or 0.3 and knowledge is low.plog. LCORPP returns +2.00 more"
        " than R+P; R+P returns -1.00 (noise 0.2, knowledge low.plog) to +1.00 (noise 0.1, knowledge"
        " high.plog) more than P. LCORPP < R+P < P in cost:"
    )
    rows[0]["converged"] = False
    text = describe_results(rows, ["noise", "knowledge"], "intention")
    assert text.endswith("In 1 the solver stopped at its limit: its policy may not be optimal.")


def test_heat_maps_outline_the_region():
    rows = []
    for noise in (0.1, 0.2, 0.3):
        for discount in (0.8, 0.9):
            worse = (-1.0, -1.5, -0.5) if noise == 0.3 else (1.0, 0.5, 1.5)
            rows += configuration(30 - noise, worse, noise=noise, discount=discount)
    figure = plot_sweep(rows, ["noise", "discount"], 2)
    panels = [axes for axes in figure.axes if axes.get_xlabel() == "noise"]
    assert len(panels) == 6
    assert [panel.get_title() for panel in panels[1:3]] == ["return: LCORPP − R+P", "return: R+P − P"]
    np.testing.assert_allclose(panels[2].images[0].get_array(), 1)
    for panel in panels:
        hatched, border = panel.collections
        xs = np.array(border.get_segments())[:, :, 0]
        assert (xs.min(), xs.max()) == (-0.5, 1.5)  # of the cells 0.1 and 0.2
        assert len(xs) == 2 * 2 + 2 * 2  # below, above, left and right
        cells = [path.get_extents().extents.tolist() for path in hatched.get_paths()]
        assert cells == [[1.5, -0.5, 2.5, 0.5], [1.5, 0.5, 2.5, 1.5]]  # those of 0.3


def test_curves_shade_the_region():
    rows = [r for noise in (0.1, 0.2) for r in configuration(30 - noise, noise=noise)]
    figure = plot_sweep(rows, ["noise"], 2)
    assert [axes.get_title() for axes in figure.axes] == [
        "LCORPP > R+P > P in return",
        "LCORPP < R+P < P in cost",
    ]
    for axes in figure.axes:
        assert [line.get_label() for line in axes.lines] == ["P", "R+P", "LCORPP"]
        assert len(axes.patches) == 2
    assert "for all values of the other axes" in figure.get_supxlabel()
