"""The report on a classifier: the same figures in the table, the files and the picture, for any learner."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from matplotlib.figure import Figure

from lcorpp.errors import DataError, FileError
from lcorpp.learning import build_report, cross_validate, learner, plot_report, write_report
from lcorpp.learning.evaluation.report_figure import _mark_thresholds
from lcorpp.learning.evaluation.report_files import COLUMNS, as_markdown
from lcorpp.learning.evaluation.thresholds import ThresholdChoice
from lcorpp.values import Dataset
from tests.learning.walkers import walkers


@pytest.fixture(scope="module")
def two():
    data = walkers(120, points=304)
    rng = np.random.default_rng(0)
    labels = [name if rng.random() < 0.8 else "slow" for name in data.labels]  # not all can be told
    noisy = Dataset(data.trajectories, tuple(labels), data.groups)
    return cross_validate(learner("summaries"), noisy)


@pytest.fixture(scope="module")
def three():
    return cross_validate(learner("summaries"), walkers(90, points=304, classes=3), folds=3)


def test_a_report_has_the_metrics_of_the_validation(two):
    found = build_report(two, positive="fast", learner="summaries", source="walks")
    assert (found.cases, found.people, found.folds) == (120, 40, 5)
    assert found.accuracy.estimate == pytest.approx(two.accuracy)
    (one,) = found.classes
    assert (one.name, one.cases) == ("fast", two.labels.count("fast"))
    assert one.auc.estimate == pytest.approx(two.auc)
    assert one.auc.low < one.auc.estimate < one.auc.high
    assert found.rates == two.rates
    assert [threshold.goal for threshold in one.thresholds] == ["accuracy", "f1", "youden"]
    assert one.thresholds[0].prevalence == pytest.approx(one.cases / 120)
    other = build_report(two, positive="slow").classes[0]
    assert other.auc.estimate == pytest.approx(one.auc.estimate)  # its mirror image
    assert other.raw.brier.estimate == pytest.approx(one.raw.brier.estimate)
    costly = build_report(two, positive="fast", prevalence={"fast": 0.1}, costs=(5, 1)).classes[0]
    assert [(t.goal, t.prevalence) for t in costly.thresholds][-1] == ("cost", 0.1)


def test_notebooks_show_short_texts_and_tables(two, three):
    for validation in (two, three):
        report = build_report(validation, learner="summaries")
        for value in (validation, report, report.classes[0], report.calibration):
            assert len(repr(value).splitlines()) <= 10
            assert len(repr(value)) < 600
        assert "predicted slow" in validation._repr_html_()
        assert "expected calibration error, calibrated" in report._repr_html_()


def test_three_classes_are_reported_one_by_one(three, tmp_path):
    found = build_report(three)
    assert [one.name for one in found.classes] == ["fast", "fastest", "slow"]
    plot_report(found, tmp_path / "three.svg")
    assert (tmp_path / "three.svg").read_text().startswith("<?xml")
    assert "fastest" in as_markdown(found)


def test_the_files_agree(two, tmp_path):
    found = build_report(two, positive="fast", learner="summaries")
    paths = write_report(found, tmp_path / "new")
    assert [path.name for path in paths] == ["report.json", "report.csv", "report.md"]
    content = json.loads(paths[0].read_text())
    with paths[1].open() as file:
        table = list(csv.DictReader(file))
    assert tuple(table[0]) == COLUMNS
    assert len(table) == len(list(found.rows()))
    area = next(row for row in table if row["quantity"] == "AUC")
    assert float(area["value"]) == content["classes"]["fast"]["auc"]["value"] == found.classes[0].auc.estimate
    assert sum(part["cases"] for part in content["classes"]["fast"]["raw"]["reliability"]) == 120
    assert f"| fast | AUC | {found.classes[0].auc.estimate:.3f} |" in paths[2].read_text()
    plot_report(found, tmp_path / "report.png")
    assert (tmp_path / "report.png").read_bytes().startswith(b"\x89PNG")


def test_unknown_classes_and_prevalences_are_errors(two, tmp_path):
    with pytest.raises(DataError, match="no case is of class 'quick'; expected one of fast, slow"):
        build_report(two, positive="quick")
    with pytest.raises(DataError, match="the prevalence of fast is missing"):
        build_report(two, positive="fast", prevalence={"slow": 0.5})
    with pytest.raises(DataError, match="prevalence is 0"):
        build_report(two, positive="fast", prevalence={"fast": 0.0})
    with pytest.raises(FileError, match="not a figure file"):
        plot_report(build_report(two), tmp_path / "report.txt")


def test_labels_of_near_thresholds_do_not_overlap():
    choices = [
        ThresholdChoice(goal, 0.4, 0.5, 0.7, 0.7, tpr, fpr)
        for goal, fpr, tpr in (("f1", 0.31, 0.79), ("accuracy", 0.3, 0.78), ("youden", 0.8, 0.78))
    ]
    axes = Figure().subplots()
    _mark_thresholds(axes, choices)
    below = {text.get_text().partition(":")[0]: text.xyann[1] for text in axes.texts}
    assert below["accuracy"] < below["f1"] - 8
    assert below["youden"] == below["f1"]
