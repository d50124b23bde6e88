"""Algorithm 1 with trust and the alarm: interruptions change nothing."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from lcorpp.assembly.options import EvidenceOptions, TrainingOptions
from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.assembly.solving import solve_domain
from lcorpp.assembly.strategies.trust import TRUST
from lcorpp.decision import LCORPP
from lcorpp.decision.lcorpp import Training
from lcorpp.domains import load_domain
from lcorpp.errors import DataError, DecisionError, FileError
from lcorpp.learning.store import read_store
from lcorpp.logs.decision_log import DecisionLog
from lcorpp.logs.replay import ReplayedDecision, replay_log
from lcorpp.planning import Planner
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.runs.run import open_run_store, run_active_learning
from lcorpp.runs.run_store import RunStore
from lcorpp.runs.senses import ActiveLearningOptions, set_up_learning
from lcorpp.runs.training import SenseTrainer
from lcorpp.runs.untrained import RandomClassifier
from lcorpp.values import ConfusionMatrix, EvidenceKind
from tests.decision.fakes import FakePlanner
from tests.domains.deliveries import write_learning_domain

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"
BATCH, BATCHES = 14, 3


@pytest.fixture
def fast_training(monkeypatch):
    """Classifiers with random labels, of which each training states better rates."""

    def train(trainer, name, dataset):
        classes = tuple(sorted(trainer._domain.find_sense(name).classes))
        soft = trainer._options.evidence.kind(name).is_likelihood
        counts = 5 + np.eye(len(classes)) * len(dataset)
        return Training(RandomClassifier(classes, len(dataset), soft), ConfusionMatrix(classes, counts))

    monkeypatch.setattr(SenseTrainer, "train", train)


def run(domain, store, log=None, *, trust=True, watch=False, soft=(), batches=BATCHES):
    """Run or resume Algorithm 1; return its results and the notes of its store."""
    senses = [sense.name for sense in domain.senses]
    options = ActiveLearningOptions(
        {name: TrainingOptions(tracks=0) for name in senses},
        EvidenceOptions({name: EvidenceKind("soft") for name in soft}),
        batch_size=BATCH,
        epsilon=0,
        max_batches=batches,
        strategy=TRUST if trust else LCORPP,
        watch=watch,
    )
    solution = solve_domain(domain, cache=find_cache_folder())
    learning = set_up_learning(domain, options)
    with open_run_store(store, domain, learning, options) as run_store:
        results = run_active_learning(
            domain,
            learning,
            Planner(solution),
            options,
            run_store=run_store,
            log=log,
            parts=RobotParts(domain, solution.policy, solver=domain.planning.solver),
        )
        return list(results), run_store.notes


def read_run(store):
    """Return all that must not depend on interruptions: the decisions, and the state of trust."""
    decisions = [
        (s.label, dict(s.belief or ()), dict(s.context), {**s.extra, "run": None}) for s in read_store(store)
    ]
    content = json.loads((store.with_name(f"{store.name}.checkpoint") / "checkpoint.json").read_text())
    return decisions, content["session"], content["rows"]


@pytest.fixture
def interrupt(monkeypatch):
    """Return a function that sets after, or before, which stored decisions and checkpoints a run ends."""

    def set_up(after, before):
        n_calls = 0

        def end_at_times(original):
            def call(*arguments):
                nonlocal n_calls
                n_calls += 1
                if n_calls in before:
                    raise FileError("No space left on device")
                original(*arguments)
                if n_calls in after:
                    raise KeyboardInterrupt

            return call

        for name in ("append_decision", "save_checkpoint"):
            monkeypatch.setattr(RunStore, name, end_at_times(getattr(RunStore, name)))

    return set_up


@pytest.mark.parametrize(
    ("place", "after", "before"),
    [
        # the checkpoint of the initial training and 14 decisions come first; a run begins with a checkpoint
        ("rooms, soft", (2, 17, 19), (30,)),
        pytest.param("deliveries", (16, 29), (), marks=pytest.mark.slow),
        pytest.param("rooms, watched", (12, 26), (), marks=pytest.mark.slow),
    ],
)
def test_an_interrupted_run_decides_as_one_that_was_not(
    tmp_path, fast_training, few_faults, interrupt, place, after, before
):
    """Interrupted after a decision, within a batch, before and after its training, and by a full disk."""
    domain = load_domain(ROOMS if "rooms" in place else write_learning_domain(tmp_path / "domain"))
    soft = [domain.senses[0].name] if "soft" in place else []
    options = {"watch": "watched" in place, "soft": soft}
    whole, resumed = tmp_path / "whole.tracks", tmp_path / "resumed.tracks"
    log = tmp_path / "log"
    with DecisionLog(log) as opened:
        run(domain, whole, opened, **options)
    replayed = list(replay_log(log, cache=find_cache_folder()))
    assert len(replayed) == BATCH * BATCHES
    assert not [r for r in replayed if not isinstance(r, ReplayedDecision) or r.differences]
    interrupt(after, before)
    for _ in (*after, *before):
        with pytest.raises((KeyboardInterrupt, FileError)):
            run(domain, resumed, **options)
    run(domain, resumed, **options)
    one, two = read_run(whole), read_run(resumed)
    assert one == two
    decisions, state, rows = one
    assert len(decisions) == state["trust"]["people"] == BATCH * BATCHES
    if options["watch"]:
        assert state["alarm"]["n_before"] + state["alarm"]["alarm"]["people"] == BATCH * BATCHES
    weights = [value for name, value in rows[-1].items() if name.startswith("weight_")]
    assert sum(weights) == pytest.approx(1)
    assert len(weights) == len(state["trust"]["sources"])


def test_without_a_checkpoint_trust_learns_from_the_stored_decisions(tmp_path, fast_training, monkeypatch):
    domain, store = load_domain(ROOMS), tmp_path / "s.tracks"
    run(domain, store, batches=2)
    file = tmp_path / "s.tracks.checkpoint" / "checkpoint.json"
    content = json.loads(file.read_text())
    content["session"]["trust"]["learners"][0]["source_weights"] = ["x"]
    file.write_text(json.dumps(content))
    results, notes = run(domain, store, batches=3)
    assert len(results) == 2
    assert "the state of trust is damaged" in notes[-1]
    assert notes[-1].endswith("; trust learns again from all stored decisions")
    assert read_run(store)[1]["trust"]["people"] == 3 * BATCH
    file.unlink()
    run(domain, store, batches=1)
    decisions, state, _ = read_run(store)
    assert len(decisions) == state["trust"]["people"] == 4 * BATCH
    labels = np.array(state["trust"]["learners"][0]["learnt"]["learnt"]["cases"]["labels"])
    weights = np.array(state["trust"]["learners"][0]["learnt"]["learnt"]["cases"]["weights"])
    assert weights[labels[:, 0] >= 0].sum() == BATCH


@pytest.mark.parametrize("trust", [False, True])
def test_a_store_of_a_run_with_trust_is_none_of_a_run_without(tmp_path, fast_training, trust):
    domain, store = load_domain(ROOMS), tmp_path / "s.tracks"
    run(domain, store, trust=trust, batches=1)
    before, now = (TRUST.name, "LCORPP") if trust else ("LCORPP", TRUST.name)
    words = f"{before} decided in the run of this store, and {now} does in this one; expected"
    with pytest.raises(DataError, match=re.escape(words)):
        run(domain, store, trust=not trust)
    run(domain, store, trust=trust, batches=1)


def test_trust_needs_the_planner_of_a_policy(fast_training):
    domain, options = load_domain(ROOMS), ActiveLearningOptions(strategy=TRUST)
    with pytest.raises(DecisionError, match="the planner of a run with trust"):
        next(run_active_learning(domain, set_up_learning(domain, options), FakePlanner(), options))
