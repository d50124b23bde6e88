from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import LstmClassifier
from lcorpp.learning.lstm import training

from .noise import labels, tracks


@pytest.fixture(scope="module")
def torch():
    """PyTorch, which is loaded for seconds, and only by the process that runs these tests."""
    return pytest.importorskip("torch", reason="torch is not installed (lcorpp[torch])")


def test_adam_agrees_with_torch(torch, monkeypatch):
    from lcorpp.learning.lstm.torch_trainer import _Adam

    compiler = SimpleNamespace(disable=lambda function, *_, **__: function, graph_break=lambda: None)
    monkeypatch.setitem(sys.modules, "torch._dynamo", compiler)  # torch.optim loads it for seconds, unused
    monkeypatch.setattr(torch, "_dynamo", compiler, raising=False)
    ours = [torch.linspace(-1, 1, 5).requires_grad_(), torch.ones(2, 2, requires_grad=True)]
    theirs = [p.detach().clone().requires_grad_() for p in ours]
    mine, other = _Adam(ours), torch.optim.Adam(theirs, lr=0.03)
    for _ in range(20):
        for parameters in (ours, theirs):
            for p in parameters:
                p.grad = None
            ((parameters[0] ** 4).sum() + (parameters[1] - 3).abs().sum()).backward()
        mine.step(0.03)
        other.step()
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a.detach(), b.detach(), rtol=1.3e-6, atol=1e-5)


def test_torch_keeps_its_random_state_and_its_threads(torch, monkeypatch):
    monkeypatch.setattr(training, "load_kernels", lambda: None)
    x = tracks()
    before, threads = torch.get_rng_state(), torch.get_num_threads()
    LstmClassifier(units=4, epochs=2).fit(x, labels(x))
    assert torch.equal(torch.get_rng_state(), before)
    assert torch.get_num_threads() == threads


def test_a_missing_gpu_is_an_error(torch):
    if torch.cuda.is_available():
        pytest.skip("a GPU is here")
    with pytest.raises(DataError, match="'cuda' is not available here: torch sees no GPU; expected cpu"):
        LstmClassifier(device="cuda").fit(tracks(), labels(tracks()))


def test_a_gpu_agrees_with_the_cpu(torch):
    if not torch.cuda.is_available():
        pytest.skip("no GPU here")
    x = tracks()
    first, second = (
        LstmClassifier(units=4, epochs=2, device=device).fit(x, labels(x)).predict_proba(x)
        for device in ("cpu", "cuda")
    )
    np.testing.assert_allclose(first, second, atol=1e-4)  # float32 added in another order
