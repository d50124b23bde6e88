"""Uncertain labels as weighted cases of each class."""

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning.label_noise.uncertain_labels import split_by_class
from lcorpp.values import Dataset, LabelEvidence

DATA = Dataset(
    np.arange(12.0).reshape(4, 3),
    ("no", "yes", "no", "yes"),
    tuple("aabc"),
    weights=[1, 1, 1, 2],
    evidence=(None, LabelEvidence({"yes": 1.0}), None, None),
)


def test_a_case_counts_for_each_class_by_its_probability():
    split, origins = split_by_class(DATA, [None, {"yes": 0.7, "no": 0.3}, {"yes": 0, "no": 1}, {"yes": 0.5}])
    assert origins.tolist() == [0, 1, 1, 2, 3]
    assert split.labels == ("no", "no", "yes", "no", "yes")
    np.testing.assert_allclose(split.weights, [1, 0.3, 0.7, 1, 1])
    assert split.groups == ("a", "a", "a", "b", "c")
    assert split.trajectories.tolist() == DATA.trajectories[origins].tolist()
    assert split.evidence[1:3] == (DATA.evidence[1],) * 2


def test_certain_labels_change_nothing():
    split, origins = split_by_class(DATA, [None] * 4)
    assert origins.tolist() == [0, 1, 2, 3]
    assert (split.labels, split.weights.tolist()) == (DATA.labels, DATA.weights.tolist())


def test_as_many_distributions_as_cases():
    with pytest.raises(DataError, match="3 distributions do not fit 4 cases"):
        split_by_class(DATA, [None] * 3)
