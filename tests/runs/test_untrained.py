"""Algorithm 1 before there is anything to learn from: random labels, of which the rules make nothing."""

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.assembly import TrainingOptions
from lcorpp.assembly.options import EvidenceOptions
from lcorpp.assembly.solving import solve_domain
from lcorpp.learning.label_noise.uncertain_labels import split_by_class
from lcorpp.planning import Planner
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.runs import ActiveLearningOptions, run_active_learning, set_up_learning
from lcorpp.runs.untrained import RandomClassifier, is_trainable
from lcorpp.values import Dataset, EvidenceKind, Likelihood
from tests.scoring.test_exact_evaluation import TABLE

CLASSES = ("yes", "no", "maybe")


def test_labels_are_uniform_and_depend_on_seed_and_signal_alone():
    signals = np.random.default_rng(0).normal(size=(3000, 2, 5))
    labels = [RandomClassifier(CLASSES, 1).classify(signal) for signal in signals]
    assert labels == [RandomClassifier(CLASSES, 1).classify(signal) for signal in signals]
    counts = [labels.count(name) for name in CLASSES]
    assert max(counts) - min(counts) < 3 * (3000 * 2 / 3) ** 0.5  # standard deviations of a difference
    others = [RandomClassifier(CLASSES, 2).classify(signal) for signal in signals]
    same = sum(a == b for a, b in zip(labels, others, strict=True))
    assert abs(same - 1000) < 4 * (3000 * 2 / 9) ** 0.5


def test_rules_and_soft_evidence_are_uniform():
    assert RandomClassifier(CLASSES, 0).confusion.probabilities.tolist() == [[1 / 3] * 3] * 3
    likelihood = RandomClassifier(CLASSES, 0, soft=True).classify(np.zeros((2, 5)))
    assert isinstance(likelihood, Likelihood)
    assert len(set(likelihood.weights.tolist())) == 1


@pytest.mark.parametrize(
    ("labels", "groups", "expected"),
    [
        (["a"] * 5 + ["b"] * 5, range(10), True),
        (["a"] * 9 + ["b"] * 4, range(13), False),
        (["a"] * 5 + ["b"] * 5, [0, 1, 2, 3, 4, 5, 5, 6, 7, 8], False),  # b is in four groups
        ([], [], False),
    ],
)
def test_each_class_needs_a_group_for_each_fold(labels, groups, expected):
    data = Dataset(np.zeros((len(labels), 1, 2)), tuple(labels), tuple(map(str, groups)), channels=("x",))
    assert is_trainable(data, ("a", "b"), 5) == expected
    assert not is_trainable(data, ("a", "b", "c"), 5)


def test_soft_labels_count_by_weight():
    tracks = np.random.default_rng(0).normal(size=(20, 1, 2))
    reported = Dataset(tracks, ("a",) * 20, channels=("x",))
    weighted, _ = split_by_class(reported, [{"a": 0.8, "b": 0.2}] * 20)
    assert not is_trainable(weighted, ("a", "b"), 5)  # b has a weight of 4
    assert is_trainable(weighted, ("a", "b"), 4)


@pytest.mark.parametrize(
    "evidence", ["hard", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("soft", "set"))]
)
def test_without_data_lcorpp_decides_like_r_and_p(evidence):
    """One batch of 400 people: within four standard errors of the exact scores of R+P."""
    domain = load_domain("intention", preset="paper")
    options = ActiveLearningOptions(
        {"motion": TrainingOptions(learner="summaries", tracks=0)},
        EvidenceOptions({"motion": EvidenceKind(evidence)}),
        batch_size=400,
    )
    senses = set_up_learning(domain, options)
    assert (len(senses.data["motion"].dataset), senses.data["motion"].dataset.channels) == (0, ("x", "y"))
    planner = Planner(solve_domain(domain, cache=find_cache_folder()))
    start, first = (
        result
        for _, result in zip(range(2), run_active_learning(domain, senses, planner, options), strict=False)
    )
    assert start.summary() == "0 tracks; random labels, as cross-validation needs 5 of each class"
    _, accuracy, cost, cost_sd, _ = TABLE["paper"]["R+P"]
    assert first.scores.accuracy.estimate == pytest.approx(
        accuracy, abs=4 * (accuracy * (1 - accuracy) / 400) ** 0.5
    )
    assert first.scores.cost.estimate == pytest.approx(cost, abs=4 * cost_sd / 400**0.5)
    assert len(first.decisions) == first.batch.datasets["motion"].n_people == 400
    assert first.batch.senses["motion"].is_trained
