"""Properties of the simulated people for a learner, measured as benchmarks/generator.py measures them."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.learning import cross_validate, measure_leakage, paper_pipeline
from lcorpp.simulation.people import SimulatedSignals, simulate_dataset
from lcorpp.simulation.recordings import simulate_recording

ROOT = Path(__file__).parents[3]
REAL = ROOT / ".." / "shared" / "data" / "pedestrians"
real = pytest.mark.skipif(not REAL.is_dir(), reason="no pedestrians here (shared/data/pedestrians)")


@pytest.fixture(scope="module")
def benchmark() -> Iterator[ModuleType]:
    spec = importlib.util.spec_from_file_location("generator_benchmark", ROOT / "benchmarks" / "generator.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


@pytest.mark.slow
def test_no_shortcut_feature_reveals_the_class():
    recording = simulate_recording(
        load_domain("intention"), np.random.default_rng(0), tracks=1200, positives=600
    )
    leaks = measure_leakage(recording, n_splits=2)
    assert {leak.name for leak in leaks} >= {"end position", "duration", "sampling"}
    for leak in leaks:
        assert leak.auc.estimate <= 0.58, leak.name


@real
def test_passers_by_are_like_real_pedestrians(benchmark):
    scenes = benchmark.pedestrians(REAL)
    assert sorted(scenes) == ["eth", "hotel", "students03", "zara01", "zara02"]
    ours = benchmark.measure_motion(benchmark.passers_by(load_domain("intention"), 500, 0), 0.396)
    for real_ones in (scenes, benchmark.walkers(scenes)):
        them = benchmark.measure_motion(benchmark.all_tracks(real_ones), 0.4)
        for name, distance in benchmark.distances(ours, them).items():
            assert distance <= 0.25, name


def test_quantities_of_a_known_walk(benchmark):
    turn = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 3.0]])
    found = benchmark.measure_motion([turn], 0.5)
    assert found["speed"].tolist() == [2, 2, 2, 4]
    assert np.allclose(found["acceleration"], [0, np.hypot(4, 4), 4])
    assert np.allclose(found["turning"], [0, np.pi, 0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_rates_of_the_papers_lstm(benchmark, seed):
    domain = load_domain("intention")
    sense, rng = domain.senses[0], np.random.default_rng([seed, 0])
    motion = SimulatedSignals(domain.simulation.signals["motion"])
    balanced = simulate_dataset(domain, sense, motion, sense.tracks, rng)
    found = {
        name: benchmark.rates(
            cross_validate(
                paper_pipeline(random_state=seed), benchmark.take_points(balanced, points), seed=seed
            )
        )
        for name, points in benchmark.PARTS.items()
    }
    error = 0.03  # two standard errors of a rate of 800 people; the tolerance of the mean of ten seeds is .04
    assert found["whole track"]["TPR"] == pytest.approx(0.76, abs=0.04 + error)
    assert found["whole track"]["TNR"] == pytest.approx(0.71, abs=0.04 + error)
    assert 0.65 - error < found["first quarter"]["AUC"] < 0.75 + error
    assert found["first quarter"]["AUC"] - error < found["first half"]["AUC"] < found["whole track"]["AUC"]


@pytest.mark.slow
def test_the_papers_63_of_2286_with_class_weights(benchmark):
    domain = load_domain("intention")
    validation = cross_validate(
        paper_pipeline(epochs=domain.senses[0].epochs, class_weight="balanced"),
        benchmark.imbalanced(domain, 0),
    )
    found = benchmark.rates(validation)
    assert found["smallest share"] > 0.1  # no fold collapses to one class
    assert found["AUC"] > 0.77 - 0.03 - 0.07  # two standard errors of an AUC of 63 people
