"""Folds with whole groups: those of scikit-learn."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.model_selection import StratifiedGroupKFold

from lcorpp.learning.evaluation.folds import FastStratifiedGroupKFold


@pytest.mark.filterwarnings("ignore:The least populated class")
@pytest.mark.parametrize("seed", range(20))
def test_folds_are_those_of_scikit_learn(seed):
    """Of people with one case and with several, also of several classes."""
    rng = np.random.default_rng(seed)
    cases, folds = int(rng.integers(40, 120)), int(rng.integers(2, 8))
    labels = rng.integers(0, rng.integers(2, 5), cases)
    groups = np.arange(cases) if seed % 3 == 0 else rng.integers(0, cases // 2, cases)
    ours, theirs = (
        [
            test.tolist()
            for _, test in kind(folds, shuffle=True, random_state=seed).split(labels, labels, groups)
        ]
        for kind in (FastStratifiedGroupKFold, StratifiedGroupKFold)
    )
    assert ours == theirs
