"""The type stubs of the compiled kernels are those that `make stubs` generates."""

from __future__ import annotations

from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src"


@pytest.mark.parametrize(
    "name",
    [
        "lcorpp.planning._native",
        "lcorpp.reasoning._diagram",
        "lcorpp.reasoning.factors._tables",
        "lcorpp.learning.lstm._kernels",
        "lcorpp.model_learning._episodes",
    ],
)
def test_stubs_are_current(name):
    stubgen, module = pytest.importorskip("nanobind.stubgen"), pytest.importorskip(name)
    generator = stubgen.StubGen(module)
    generator.put(module)
    committed = SOURCE / f"{name.replace('.', '/')}.pyi"
    assert generator.get() == committed.read_text()
