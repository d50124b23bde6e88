"""The compiled kernels, torch and numpy agree, for every set of instructions that this machine has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError
from lcorpp.learning import LstmClassifier
from lcorpp.learning.lstm import training
from lcorpp.learning.lstm.network import NumpyNetwork, Weights
from lcorpp.learning.lstm.training import TrainingConfig, TrainingSet

from .noise import labels, tracks

kernels = pytest.importorskip("lcorpp.learning.lstm._kernels", reason="the kernels are not built")

from lcorpp.learning.lstm.trainer import CompiledTrainer  # noqa: E402

shapes = st.fixed_dictionaries(
    {
        "channels": st.integers(1, 4),
        "units": st.integers(1, 23),
        "classes": st.integers(2, 4),
        "cases": st.integers(1, 70),
        "points": st.integers(1, 6),
    }
)


def task(
    *, channels: int, units: int, classes: int, cases: int, points: int, batch: int = 32, seed: int = 0
) -> tuple[Weights, TrainingSet, TrainingConfig, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Initial weights, training set, configuration, and the arguments of an epoch: order, mask and rates."""
    rng = np.random.default_rng(seed)
    start = Weights.initialize(channels, units, 1 if classes == 2 else classes, rng)
    given = TrainingSet(
        rng.normal(size=(cases, points, channels)).astype(np.float32),
        rng.integers(points, size=cases) + 1,
        rng.integers(classes, size=cases).astype(np.int32),
        rng.uniform(0.2, 3, size=cases).astype(np.float32),
        classes,
    )
    plan = TrainingConfig(
        units=units, dropout=0.25, epochs=1, batch_size=batch, learning_rate=0.01, schedule="constant"
    )
    order, mask = rng.permutation(cases), rng.random((cases, units)) < 0.75
    return start, given, plan, (order, mask, rng.uniform(0.001, 0.01, size=-(-cases // batch)))


@settings(max_examples=20)
@given(shapes, st.integers(1, 70))
def test_an_epoch_gives_the_weights_of_torch(shape, batch):
    torch_trainer = pytest.importorskip("lcorpp.learning.lstm.torch_trainer", exc_type=DataError)
    start, cases, plan, epoch = task(**shape, batch=batch)
    torch = torch_trainer.TorchTrainer(start, cases, plan, "cpu")
    torch.run_epoch(*epoch)
    expected = torch.weights().arrays()
    for level in kernels.instruction_sets():
        ours = CompiledTrainer(start, cases, plan, instruction_set=level)
        ours.run_epoch(*epoch)
        for name, weight in ours.weights().arrays().items():
            # Adam's first moves are of the size of the rate, whatever that of the gradient: where that is 0
            # but for rounding, any move is right.
            moved = np.abs(weight - expected[name])
            assert np.quantile(moved, 0.9) < 1e-5, (level, name)
            assert moved.max() < 2 * epoch[-1].sum(), (level, name)


@settings(max_examples=40)
@given(shapes)
def test_scores_and_steps_are_those_of_numpy(shape):
    start, cases, *_ = task(**shape)
    twin = NumpyNetwork(**start.arrays())
    for level in kernels.instruction_sets():
        network = kernels.Network(**start.arrays(), instruction_set=level)
        np.testing.assert_allclose(
            network.scores(cases.inputs, cases.lengths),
            twin.scores(cases.inputs, cases.lengths),
            atol=2e-6,
        )
        ours, theirs = (np.full((2, len(cases), start.units), 0.5, dtype=np.float32) for _ in range(2))
        points = np.ascontiguousarray(cases.inputs[:, 0])
        np.testing.assert_allclose(network.step(*ours, points), twin.step(*theirs, points), atol=2e-6)
        np.testing.assert_allclose(ours, theirs, atol=2e-6)


def test_saturated_gates_equal_those_of_numpy():
    """Inputs from -1e30 to 1e30 reach every part of the activations."""
    start, *_ = task(channels=1, units=8, classes=2, cases=1, points=1)
    size = np.concatenate([np.linspace(0, 40, 400), 10.0 ** np.arange(-38, 31)])
    inputs = np.concatenate([-size, size]).astype(np.float32)[:, None, None]
    ones = np.ones(len(inputs), dtype=np.int64)
    expected = NumpyNetwork(**start.arrays()).scores(inputs, ones)
    for level in kernels.instruction_sets():
        found = kernels.Network(**start.arrays(), instruction_set=level).scores(inputs, ones)
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_trainings_by_kernels_and_torch_agree(monkeypatch):
    pytest.importorskip("torch")
    x = tracks(50)
    model = LstmClassifier(units=9, epochs=5, class_weight="balanced", schedule="one-cycle")
    compiled = model.fit(x, labels(x, 3)).predict_proba(x)
    monkeypatch.setattr(training, "load_kernels", lambda: None)
    np.testing.assert_allclose(model.fit(x, labels(x, 3)).predict_proba(x), compiled, atol=1e-5)


def test_long_tracks_with_vanishing_gradients():
    """Gradients below 1e-38 on their way back through 2000 time points are taken for 0, not waited for."""
    start, cases, plan, epoch = task(channels=1, units=5, classes=2, cases=40, points=2000)
    closed = start.arrays() | {"bias": np.where(np.arange(20) // 5 == 1, -3, 0)}
    trainer = CompiledTrainer(Weights(**closed), cases, plan)
    trainer.run_epoch(*epoch)
    assert all(np.isfinite(weight).all() for weight in trainer.weights().arrays().values())


def test_kernels_reject_arrays_that_do_not_match():
    start, cases, plan, (order, mask, rates) = task(channels=2, units=5, classes=2, cases=40, points=3)
    network = kernels.Network(**start.arrays())
    floats = {"dtype": np.float32}
    with pytest.raises(ValueError, match="the tracks have other channels"):
        network.scores(np.zeros((1, 3, 3), **floats), np.array([3]))
    for lengths in ([0], [4]):
        with pytest.raises(ValueError, match="a track has no time point, or more than there are"):
            network.scores(np.zeros((1, 3, 2), **floats), np.array(lengths))
    with pytest.raises(ValueError, match="tracks and lengths do not match"):
        network.scores(np.zeros((1, 3, 2), **floats), np.array([3, 3]))
    with pytest.raises(ValueError, match="state and points do not match"):
        network.step(np.zeros((1, 4), **floats), np.zeros((1, 5), **floats), np.zeros((1, 2), **floats))
    with pytest.raises(TypeError):  # a converted copy would take the changes
        network.step(np.zeros((1, 5)), np.zeros((1, 5)), np.zeros((1, 2), **floats))
    with pytest.raises(ValueError, match="does not support that instruction set"):
        kernels.Network(**start.arrays(), instruction_set="v9")
    with pytest.raises(ValueError, match="weights do not match each other"):
        kernels.Network(**{**start.arrays(), "bias": np.zeros(3, **floats)})
    trainer = CompiledTrainer(start, cases, plan)
    for bad in (
        (order[1:], mask, rates),
        (order, mask[:, 1:], rates),
        (order + 1, mask, rates),
        (order, mask, rates[1:]),
    ):
        with pytest.raises(ValueError, match=r"order, dropout mask and rates|no such case"):
            trainer.run_epoch(*bad)
    with pytest.raises(ValueError, match="no such class"):
        CompiledTrainer(start, replace(cases, targets=cases.targets + 2), plan)
    with pytest.raises(ValueError, match="a track has no time point, or more than there are"):
        CompiledTrainer(start, replace(cases, lengths=cases.lengths + 3), plan)


def test_numbers_after_the_end_of_a_track_have_no_effect():
    start, cases, plan, epoch = task(channels=2, units=7, classes=3, cases=50, points=6)
    after = np.arange(6)[:, None] >= cases.lengths[:, None, None]
    others = replace(cases, inputs=np.where(after, np.float32(5), cases.inputs))
    weights = []
    for training_set in (cases, others):
        trainer = CompiledTrainer(start, training_set, plan)
        trainer.run_epoch(*epoch)
        weights.append(trainer.weights())
    for first, second in zip(*(each.arrays().values() for each in weights), strict=True):
        assert np.array_equal(first, second)
    network = weights[0].network
    expected = network.scores(cases.inputs, cases.lengths)
    assert np.array_equal(network.scores(others.inputs, cases.lengths), expected)
    for case, length in enumerate(cases.lengths):
        alone = np.ascontiguousarray(cases.inputs[case : case + 1, :length])
        np.testing.assert_allclose(
            network.scores(alone, np.array([length])), expected[case : case + 1], atol=1e-6
        )
