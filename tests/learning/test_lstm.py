from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from lcorpp.errors import DataError

torch = pytest.importorskip("torch", reason="the LSTM needs torch: pip install 'lcorpp[torch]'")

from lcorpp.learning.lstm import LstmClassifier, _Adam  # noqa: E402


def tracks(cases: int = 40, channels: int = 2, points: int = 8, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(cases, channels, points))


def labels(x: np.ndarray, classes: int = 2) -> np.ndarray:
    return np.array(["a", "b", "c"])[np.arange(len(x)) % classes]


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x))


def scores_by_the_equations(weights: dict[str, np.ndarray], x: np.ndarray) -> np.ndarray:
    """(cases, 1 or K) by the equations of the LSTM, one time point after the other, in float64."""
    w = {name: value.astype(np.float64) for name, value in weights.items()}
    units = w["lstm.weight_hh_l0"].shape[1]
    h = c = np.zeros((len(x), units))
    for t in range(x.shape[2]):
        gates = x[:, :, t] @ w["lstm.weight_ih_l0"].T + h @ w["lstm.weight_hh_l0"].T
        gates += w["lstm.bias_ih_l0"] + w["lstm.bias_hh_l0"]
        i, f, g, o = np.split(gates, 4, axis=1)
        c = sigmoid(f) * c + sigmoid(i) * np.tanh(g)
        h = sigmoid(o) * np.tanh(c)
    return h @ w["dense.weight"].T + w["dense.bias"]


def test_two_classes_agree_with_the_equations():
    x = tracks()
    model = LstmClassifier(units=6, epochs=3, learning_rate=0.05).fit(x, labels(x))
    one = sigmoid(scores_by_the_equations(model.weights_, x)[:, 0])
    expected = np.stack([1 - one, one], axis=1)
    np.testing.assert_allclose(model.predict_proba(x), expected, atol=1e-5)  # float32 against float64
    assert model.predict(x).tolist() == [("a", "b")[int(p > 0.5)] for p in one]


def test_three_classes_agree_with_the_equations():
    x = tracks(channels=3)
    model = LstmClassifier(units=5, epochs=3, learning_rate=0.05).fit(x, labels(x, 3))
    raised = np.exp(scores_by_the_equations(model.weights_, x))
    expected = raised / raised.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(model.predict_proba(x), expected, atol=1e-5)  # float32 against float64
    assert model.classes_.tolist() == ["a", "b", "c"]


def test_adam_agrees_with_torch():
    ours = [torch.linspace(-1, 1, 5).requires_grad_(), torch.ones(2, 2, requires_grad=True)]
    theirs = [p.detach().clone().requires_grad_() for p in ours]
    mine, other = _Adam(ours, 0.03), torch.optim.Adam(theirs, lr=0.03)
    for _ in range(20):
        for parameters in (ours, theirs):
            for p in parameters:
                p.grad = None
            ((parameters[0] ** 4).sum() + (parameters[1] - 3).abs().sum()).backward()
        mine.step()
        other.step()
    for a, b in zip(ours, theirs, strict=True):
        torch.testing.assert_close(a, b)


def test_what_can_be_told_is_learnt():
    x = tracks(80)
    y = np.where(x[:, 0].mean(axis=1) > 0, "up", "down")
    model = LstmClassifier(units=16, epochs=40, learning_rate=0.02).fit(x, y)
    assert np.mean(model.predict(x) == y) > 0.95


def test_the_same_seed_gives_the_same_weights_and_leaves_the_global_state_alone():
    x = tracks()
    before = torch.get_rng_state()
    threads = torch.get_num_threads()
    first, second = (LstmClassifier(units=4, epochs=2, random_state=7).fit(x, labels(x)) for _ in range(2))
    other = LstmClassifier(units=4, epochs=2, random_state=8).fit(x, labels(x))
    assert torch.equal(torch.get_rng_state(), before)
    assert torch.get_num_threads() == threads
    assert np.array_equal(first.predict_proba(x), second.predict_proba(x))
    assert not np.array_equal(first.predict_proba(x), other.predict_proba(x))


def test_it_is_cloned_and_pickled():
    x = tracks()
    model = LstmClassifier(units=4, epochs=1).fit(x, labels(x))
    copy = pickle.loads(pickle.dumps(model))
    assert np.array_equal(copy.predict_proba(x), model.predict_proba(x))
    fresh = clone(model)
    assert fresh.get_params() == model.get_params()
    with pytest.raises(NotFittedError):
        fresh.predict(x)


def test_progress_and_interruption():
    told = []
    x = tracks()
    LstmClassifier(units=2, epochs=3, progress=lambda done, of: told.append((done, of))).fit(x, labels(x))
    assert told == [(1, 3), (2, 3), (3, 3)]

    def interrupt(done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        LstmClassifier(units=2, epochs=3, progress=interrupt).fit(x, labels(x))


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"units": 0}, "units must be at least 1, not 0"),
        ({"epochs": 0}, "epochs must be at least 1"),
        ({"batch_size": -1}, "batch_size must be at least 1"),
        ({"dropout": 1.0}, r"dropout must lie in \[0, 1\), not 1.0"),
        ({"learning_rate": 0}, r"learning_rate must lie in \(0, 1\], not 0"),
        ({"device": "tpu"}, "unknown device 'tpu'; expected cpu or cuda"),
    ],
)
def test_bad_parameters_are_told(parameters, words):
    with pytest.raises(DataError, match=words):
        LstmClassifier(**parameters).fit(tracks(), labels(tracks()))


@pytest.mark.skipif(torch.cuda.is_available(), reason="a GPU is here")
def test_a_missing_gpu_is_told():
    with pytest.raises(DataError, match="'cuda' is not available"):
        LstmClassifier(device="cuda").fit(tracks(), labels(tracks()))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU here")
def test_a_gpu_agrees_with_the_cpu():
    x = tracks()
    first, second = (
        LstmClassifier(units=4, epochs=2, device=device).fit(x, labels(x)).predict_proba(x)
        for device in ("cpu", "cuda")
    )
    np.testing.assert_allclose(first, second, atol=1e-4)  # float32 added in another order


def test_bad_data_is_told():
    x = tracks()
    with pytest.raises(DataError, match="as many labels"):
        LstmClassifier(epochs=1).fit(x, ["a", "b"])
    with pytest.raises(DataError, match="all cases are of class 'a'"):
        LstmClassifier(epochs=1).fit(x, ["a"] * len(x))
    model = LstmClassifier(units=2, epochs=1).fit(x, labels(x))
    with pytest.raises(DataError, match="2 channels, given 3"):
        model.predict(tracks(channels=3))
    with pytest.raises(DataError, match="too large for the LSTM; scale the tracks"):
        LstmClassifier(units=2, epochs=1).fit(1e39 * x, labels(x))


def test_without_torch_the_way_to_install_it_is_told(tmp_path):
    (tmp_path / "torch.py").write_text("raise ModuleNotFoundError('no torch')")
    program = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from lcorpp.errors import DataError\n"
        "import lcorpp.learning\n"
        "for use in (lambda: lcorpp.learning.LstmClassifier, lambda: lcorpp.learning.paper_pipeline()):\n"
        "    try: use()\n"
        "    except DataError as error: assert \"pip install 'lcorpp[torch]'\" in str(error)\n"
        "    else: raise SystemExit('no error')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
