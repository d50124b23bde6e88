from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.metrics import roc_auc_score
from sklearn.utils.class_weight import compute_class_weight

from lcorpp.errors import DataError
from lcorpp.learning import LstmClassifier, fast_pipeline, paper_pipeline
from lcorpp.learning.lstm import training
from lcorpp.learning.lstm.trainer import CompiledTrainer
from lcorpp.learning.lstm.training import TrainingConfig, compute_class_weights, compute_learning_rates

from .noise import labels, tracks


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x))


def scores_by_the_equations(model: LstmClassifier, x: np.ndarray) -> np.ndarray:
    """(cases, 1 or K) by the equations of the LSTM, one time point after the other, in float64."""
    w = {name: value.astype(np.float64) for name, value in model.weights_.arrays().items()}
    h = c = np.zeros((len(x), model.units))
    for t in range(x.shape[2]):
        gates = x[:, :, t] @ w["inputs"].T + h @ w["recurrent"].T + w["bias"]
        i, f, g, o = np.split(gates, 4, axis=1)
        c = sigmoid(f) * c + sigmoid(i) * np.tanh(g)
        h = sigmoid(o) * np.tanh(c)
    return h @ w["dense"].T + w["dense_bias"]


@pytest.mark.parametrize("classes", [2, 3])
def test_probabilities_agree_with_the_equations(classes):
    x = tracks(channels=classes)
    model = LstmClassifier(units=6, epochs=3, learning_rate=0.05).fit(x, labels(x, classes))
    scores = scores_by_the_equations(model, x)
    if classes == 2:  # a sigmoid is a softmax of 0 and the score
        scores = np.concatenate([0 * scores, scores], axis=1)
    expected = np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(model.predict_proba(x), expected, atol=1e-6)  # float32 against float64
    assert model.classes_.tolist() == ["a", "b", "c"][:classes]
    assert model.predict(x).tolist() == [model.classes_[k] for k in expected.argmax(axis=1)]


def test_separable_classes_are_learnt():
    x = tracks(80)
    y = np.where(x[:, 0].mean(axis=1) > 0, "up", "down")
    model = LstmClassifier(units=16, epochs=40, learning_rate=0.02).fit(x, y)
    assert np.mean(model.predict(x) == y) > 0.95


def test_one_cycle_learns_in_few_epochs():
    x, new = tracks(200), tracks(200, seed=1)
    y, truth = (np.where(t[:, 0].mean(axis=1) > 0, "up", "down") for t in (x, new))
    fast = fast_pipeline().named_steps["lstm"]
    assert fast.epochs <= 0.1 * paper_pipeline().named_steps["lstm"].epochs
    assert np.mean(fast.fit(x, y).predict(new) == truth) > 0.9


def test_the_one_cycle_rate_rises_once_and_falls_to_zero():
    plan = TrainingConfig(
        units=1, dropout=0, epochs=8, batch_size=10, learning_rate=0.5, schedule="one-cycle"
    )
    rates = compute_learning_rates(plan, 95)
    assert rates.shape == (8, 10)
    turns = np.diff(np.sign(np.diff(rates.ravel())))
    assert np.count_nonzero(turns) == 1
    assert 0 < rates[-1, -1] < 0.001
    assert 0.49 < rates.max() <= 0.5
    assert rates.ravel().argmax() in (19, 20)  # a quarter of 80


def test_the_same_seed_gives_the_same_weights_and_leaves_the_global_state_alone():
    x = tracks()
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    first, second = (LstmClassifier(units=4, epochs=2, random_state=7).fit(x, labels(x)) for _ in range(2))
    other = LstmClassifier(units=4, epochs=2, random_state=8).fit(x, labels(x))
    assert np.array_equal(np.random.get_state()[1], before)  # noqa: NPY002
    assert np.array_equal(first.predict_proba(x), second.predict_proba(x))
    assert not np.array_equal(first.predict_proba(x), other.predict_proba(x))


def test_the_classifier_can_be_cloned_and_pickled():
    x = tracks()
    model = LstmClassifier(units=4, epochs=1, class_weight={"a": 1.0, "b": 2.0}).fit(x, labels(x))
    model.predict(x)
    copy = pickle.loads(pickle.dumps(model))
    assert np.array_equal(copy.predict_proba(x), model.predict_proba(x))
    fresh = clone(model)
    assert fresh.get_params() == model.get_params()
    with pytest.raises(NotFittedError):
        fresh.predict(x)
    with pytest.raises(NotFittedError):
        fresh.begin()


def test_restore_arrays_restores_the_classifier():
    x = tracks()
    model = LstmClassifier(units=4, epochs=1).fit(x, labels(x))
    arrays = model.to_arrays()
    again = LstmClassifier(units=4).restore_arrays(arrays)
    assert np.array_equal(again.predict_proba(x), model.predict_proba(x))
    for changed, words in [
        ({"bias": np.zeros(3)}, "an LSTM of 4 units needs weights"),
        ({"bias": np.zeros((16, 1))}, "matrices, its biases vectors"),
        ({"dense": np.full((1, 4), np.nan)}, "finite weights"),
        ({"classes": np.array(["a", "b", "c"])}, r"1 outputs do not fit classes of shape \(3,\)"),
        ({"classes": np.array("a")}, "classes of shape"),
    ]:
        with pytest.raises(DataError, match=words):
            LstmClassifier(units=4).restore_arrays({**arrays, **changed})
    with pytest.raises(DataError, match="4 units do not fit an LSTM of 5"):
        LstmClassifier(units=5).restore_arrays(arrays)
    with pytest.raises(DataError, match="has the weights bias, dense"):
        LstmClassifier(units=4).restore_arrays({"classes": arrays["classes"]})


def test_class_weights_equal_those_of_scikit_learn():
    counts = np.array([90, 6, 4])
    y = np.repeat(["a", "b", "c"], counts)
    names = np.unique(y)
    for given in ("balanced", {"a": 1.0, "b": 5.0, "c": 2.5}):
        expected = compute_class_weight(given, classes=names, y=y)
        np.testing.assert_allclose(compute_class_weights(given, names, y, np.ones(100)), expected)


def test_a_case_of_weight_two_counts_as_two_cases():
    """One batch holds everything, so that the loss of doubled cases is that of doubled weights."""
    x = tracks(12)
    y = labels(x)
    options = {"units": 3, "epochs": 5, "dropout": 0.0, "batch_size": 100}
    doubled = np.concatenate([np.arange(12), np.flatnonzero(y == "b")])
    weighted = LstmClassifier(class_weight={"a": 1.0, "b": 2.0}, **options).fit(x, y)
    twice = LstmClassifier(**options).fit(x[doubled], y[doubled])
    # Adam makes the same moves whatever the scale of the loss, up to its epsilon.
    np.testing.assert_allclose(weighted.predict_proba(x), twice.predict_proba(x), atol=1e-4)


def test_balanced_weights_predict_rare_positives():
    """30 among 630 to learn from; the best AUC is .84 (a mean of .5 at 8 points of deviation 1)."""
    rng = np.random.default_rng(3)
    y = np.repeat(["yes", "no"], [60, 1200])
    x = rng.normal(size=(len(y), 2, 8))
    x[y == "yes", 0] += 0.5
    order = rng.permutation(len(y))
    x, y = x[order], y[order]
    half = len(y) // 2
    options = {"epochs": 20, "schedule": "one-cycle", "learning_rate": 0.01}
    plain, balanced = (
        LstmClassifier(class_weight=weight, **options).fit(x[:half], y[:half])
        for weight in (None, "balanced")
    )
    truth = y[half:] == "yes"
    assert np.mean(plain.predict(x[half:])[truth] == "yes") < 0.2  # it collapses to the common class
    called = balanced.predict(x[half:]) == "yes"
    assert called[truth].mean() > 0.4
    assert called[~truth].mean() < 0.4
    assert roc_auc_score(truth, balanced.predict_proba(x[half:])[:, 1]) > 0.7


def test_progress_and_interruption_between_epochs():
    calls = []
    x = tracks()
    LstmClassifier(units=2, epochs=3, progress=lambda *done: calls.append(done)).fit(x, labels(x))
    assert calls == [(1, 3), (2, 3), (3, 3)]

    def interrupt(done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        LstmClassifier(units=2, epochs=3, progress=interrupt).fit(x, labels(x))


def test_interrupt_within_an_epoch(monkeypatch):
    x = tracks(6000, points=100)  # an epoch takes a second or more
    run_epoch, completed = CompiledTrainer.run_epoch, []

    def interrupted(self, *epoch):
        # started within the epoch, so that the signal cannot arrive before it, however busy the machine is
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
        run_epoch(self, *epoch)
        completed.append(True)

    monkeypatch.setattr(CompiledTrainer, "run_epoch", interrupted)
    model = LstmClassifier(units=200, epochs=1)
    with pytest.raises(KeyboardInterrupt):
        model.fit(x, labels(x))
    assert completed == []
    assert not hasattr(model, "weights_")


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"units": 0}, "units must be at least 1, not 0"),
        ({"units": 2.5}, "units must be a whole number, not 2.5"),
        ({"epochs": 0}, "epochs must be at least 1"),
        ({"epochs": True}, "epochs must be a whole number"),
        ({"batch_size": -1}, "batch_size must be at least 1"),
        ({"random_state": -1}, "random_state must be at least 0"),
        ({"random_state": None}, "random_state must be a whole number, not None"),
        ({"dropout": 1.0}, r"dropout must lie in \[0, 1\), not 1.0"),
        ({"dropout": np.nan}, r"dropout must lie in \[0, 1\), not nan"),
        ({"learning_rate": 0}, r"learning_rate must lie in \(0, 1\], not 0"),
        ({"schedule": "two-cycle"}, "unknown schedule 'two-cycle'; expected one of constant, one-cycle"),
        ({"class_weight": "even"}, "class_weight: .*'balanced'.* Got 'even' instead"),
        ({"class_weight": {"a": 1.0, "c": 1.0}}, "class_weight: The classes, .*'b'.*, are not in"),
        ({"class_weight": {"a": 1.0, "b": -1.0}}, "must be positive and finite"),
        ({"device": "tpu"}, "unknown device 'tpu'; expected cpu or cuda"),
    ],
)
def test_parameters_out_of_range_are_errors(parameters, words):
    with pytest.raises(DataError, match=words):
        LstmClassifier(**parameters).fit(tracks(), labels(tracks()))


def test_malformed_data_are_errors():
    x = tracks()
    with pytest.raises(DataError, match="as many labels"):
        LstmClassifier(epochs=1).fit(x, ["a", "b"])
    with pytest.raises(DataError, match="all cases are of class 'a'"):
        LstmClassifier(epochs=1).fit(x, ["a"] * len(x))
    broken = x.copy()
    broken[3, 1, 2] = np.nan
    with pytest.raises(DataError, match=r"case 3, channel 1, time point 2 \(counted from 0\) is nan"):
        LstmClassifier(epochs=1).fit(broken, labels(x))
    model = LstmClassifier(units=2, epochs=1).fit(x, labels(x))
    with pytest.raises(DataError, match="2 channels, given 3"):
        model.predict(tracks(channels=3))
    with pytest.raises(DataError, match="too large for the LSTM; scale the tracks"):
        LstmClassifier(units=2, epochs=1).fit(1e39 * x, labels(x))


def test_constant_tracks_give_finite_probabilities():
    x = np.zeros((40, 2, 8))
    model = LstmClassifier(units=3, epochs=30, learning_rate=0.05).fit(x, labels(x))
    np.testing.assert_allclose(model.predict_proba(x), 0.5, atol=0.1)  # as many of each class


def test_a_training_that_diverges_is_an_error():
    x = tracks()
    with pytest.raises(DataError, match="the training diverged"):
        LstmClassifier(units=2, epochs=2, class_weight={"a": 1e38, "b": 1e38}).fit(1e10 * x, labels(x))


WITHOUT = """
import sys
if "kernels" in sys.argv:
    sys.modules["lcorpp.learning.lstm._kernels"] = None
if "torch" in sys.argv:
    sys.path.insert(0, sys.argv[1])
import numpy as np
from lcorpp.errors import DataError
from lcorpp.learning import LstmClassifier
x = np.random.default_rng(0).normal(size=(20, 2, 5))
try:
    model = LstmClassifier(units=3, epochs=2).fit(x, ["a", "b"] * 10)
except DataError as error:
    print(error)
else:
    print("torch" in sys.modules, *model.predict_proba(x[:2]).ravel())
"""


def run_without(folder: Path, *parts: str) -> str:
    (folder / "torch.py").write_text("raise ModuleNotFoundError('no torch')")
    command = [sys.executable, "-c", WITHOUT, str(folder), *parts]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


@pytest.mark.slow  # it imports torch in two processes
def test_the_kernels_need_no_torch_and_torch_no_kernels(tmp_path):
    pytest.importorskip("lcorpp.learning.lstm._kernels", reason="the kernels are not built")
    loaded, *compiled = run_without(tmp_path, "torch").split()
    assert loaded == "False"
    pytest.importorskip("torch")
    loaded, *by_torch = run_without(tmp_path, "kernels").split()
    assert loaded == "True"
    np.testing.assert_allclose([float(p) for p in compiled], [float(p) for p in by_torch], atol=1e-6)


def test_without_kernels_and_torch_the_error_names_the_installation(monkeypatch):
    monkeypatch.setattr(training, "load_kernels", lambda: None)
    monkeypatch.setitem(sys.modules, "torch", None)  # its import fails
    monkeypatch.delitem(sys.modules, "lcorpp.learning.lstm.torch_trainer", raising=False)
    x = tracks()
    with pytest.raises(DataError, match=r"pip install 'lcorpp\[torch\]'"):
        LstmClassifier(units=3, epochs=2).fit(x, labels(x))
