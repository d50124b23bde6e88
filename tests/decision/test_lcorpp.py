"""Algorithm 1 with a learner that returns given confusion matrices."""

import itertools
from collections.abc import Mapping

import numpy as np
import pytest

from lcorpp.decision import Batch, ResumePoint, TrainedSense, lcorpp
from lcorpp.decision.lcorpp import Training
from lcorpp.decision.stopping import choose_epsilon
from lcorpp.errors import DecisionError
from lcorpp.values import ConfusionMatrix, Dataset, Instance
from tests.decision.fakes import (
    VALUES,
    FakeClassifier,
    FakeDomain,
    FakePlanner,
    FakeReasoner,
    FakeWorld,
    make_instance,
)

START = Dataset(np.zeros((2, 1, 2)), ("yes", "no"), ("a", "b"), channels=("x",))


def run(
    counts: list[list[list[float]]],
    *,
    batch_size: int = 3,
    epsilon: float | None = 0.05,
    confidence: float = 0,
) -> tuple[list[Batch], list]:
    """Run with the given confusion counts, one matrix per training; also return the learner's data sets.

    With confidence 0 the estimates of the rates decide, as in the paper.
    """
    matrices, trained, reasoned = iter(counts), [], []

    def train(_sense: str, dataset: Dataset):
        trained.append(dataset)
        return FakeClassifier(), ConfusionMatrix(VALUES, np.array(next(matrices)))

    def make_reasoner(confusions: Mapping[str, ConfusionMatrix]):
        reasoned.append(confusions)
        return FakeReasoner()

    indices = itertools.cycle([0, 1])
    batches = list(
        lcorpp(
            {"eyes": START},
            train=train,
            make_reasoner=make_reasoner,
            planner=FakePlanner(),
            domain=FakeDomain(),
            collect=lambda: (
                make_instance(index := next(indices)),
                FakeWorld(*["nod" if index == 0 else "shake"]),
            ),
            batch_size=batch_size,
            epsilon=epsilon,
            confidence=confidence,
        )
    )
    assert len(reasoned) == len(batches) - 1
    return batches, trained


def test_reported_labels_are_added_until_the_matrix_converges():
    batches, trained = run([[[8, 2], [3, 7]], [[80, 20], [10, 90]], [[80, 20], [10, 90]]])
    assert [batch.number for batch in batches] == [0, 1, 2]
    assert [batch.converged for batch in batches] == [False, False, True]
    assert [len(data) for data in trained] == [2, 5, 8]
    assert trained[1].labels == ("yes", "no", "yes", "no", "yes")
    first, second, third = trained[1].groups[2:]
    assert first == third != second  # equal tracks share a group: a fold must not separate them
    assert [len(batch.episodes) for batch in batches] == [0, 3, 3]


def test_change_is_between_successive_matrices_not_zero_as_the_printed_line_would_make_it():
    first, second = [[8, 2], [3, 7]], [[80, 20], [10, 90]]
    batches, _ = run([first, second, second])
    rates = [ConfusionMatrix(VALUES, np.array(c)).probabilities for c in (first, second)]
    assert batches[0].change.estimate == pytest.approx(np.abs(rates[0] - 0.5).sum())
    assert batches[1].change.estimate == pytest.approx(np.abs(rates[1] - rates[0]).sum())
    assert batches[1].change.estimate > 0.05
    assert batches[2].change.estimate == 0


def test_equal_matrices_of_few_cases_do_not_end_the_loop():
    """Their rates are too uncertain: with 95 % confidence they may have changed by more than epsilon."""
    few, many = [[8, 2], [3, 7]], [[320, 80], [100, 300]]
    batches, _ = run([few, few, many, many], epsilon=0.2, confidence=0.95)
    assert [batch.converged for batch in batches] == [False, False, False, True]
    assert batches[1].change.estimate == 0 < batches[1].change.high
    assert batches[1].changes["eyes"] is batches[1].change


def test_the_default_epsilon_grows_with_the_classes():
    """SSUB adds up all rates. Between these matrices it is a little below .18."""
    first, second = [[800, 200], [200, 800]], [[755, 245], [245, 755]]
    batches, _ = run([first, second], epsilon=None)
    assert [batch.converged for batch in batches] == [False, True]
    assert batches[1].change.estimate == pytest.approx(0.18, abs=0.001)
    assert choose_epsilon(None, 2) == 0.18 < choose_epsilon(None, 3)
    assert choose_epsilon(0.05, 3) == 0.05


def test_a_run_without_data_goes_on_until_the_classifier_is_trained():
    """A matrix without counts is uniform, as C_hat is at the start: the change alone would end the run."""
    batches, _ = run([[[0, 0], [0, 0]], [[0, 0], [0, 0]], [[8, 2], [3, 7]], [[8, 2], [3, 7]]])
    assert [batch.converged for batch in batches] == [False, False, False, True]
    assert [batch.change.estimate for batch in batches[:2]] == [0, 0]
    assert [batch.senses["eyes"].is_trained for batch in batches] == [False, False, True, True]


def test_the_evidence_of_a_label_is_what_the_robot_heard_and_believed():
    """The prior is .8, and an answer right with probability .75: .8 * .75 / (.8 * .75 + .2 * .25) = 12/13."""
    _, trained = run([[[8, 2], [3, 7]], [[80, 20], [10, 90]], [[80, 20], [10, 90]]])
    assert trained[1].evidence[:2] == (None, None)
    assert [own.belief["yes"] for own in trained[1].evidence[2:]] == pytest.approx([12 / 13, 1 / 13, 12 / 13])
    answers = [own.answers for own in trained[1].evidence[2:]]
    assert answers == [(("ask", "nod"),), (("ask", "shake"),), (("ask", "nod"),)]
    assert all(dict(own.context) == dict(make_instance(0).context) for own in trained[1].evidence[2:])


def test_a_training_may_correct_its_matrix():
    """The rules get the corrected one, and the other is kept beside it."""
    corrected, reported = (ConfusionMatrix(VALUES, np.eye(2) * 9 + n) for n in (1, 3))
    reasoned = []
    loop = lcorpp(
        {"eyes": START},
        train=lambda *_: Training(FakeClassifier(), corrected, reported),
        make_reasoner=lambda confusions: reasoned.append(confusions) or FakeReasoner(),
        planner=FakePlanner(),
        domain=FakeDomain(),
        collect=lambda: (make_instance(0), FakeWorld("nod")),
        batch_size=1,
        epsilon=0.05,
        confidence=0,
    )
    assert [batch.senses["eyes"].against_reports for batch in loop] == [reported] * 2
    assert reasoned == [{"eyes": corrected}]


def test_a_classifier_as_good_as_chance_does_not_start_the_loop():
    batches, _ = run([[[5, 5], [5, 5]]])
    assert [(batch.number, batch.converged) for batch in batches] == [(0, True)]


def test_the_caller_may_stop_at_any_batch():
    rng = np.random.default_rng(1)
    loop = lcorpp(
        {"eyes": START},
        train=lambda *_: (FakeClassifier(), ConfusionMatrix(VALUES, rng.random((2, 2)) * 9)),
        make_reasoner=lambda _: FakeReasoner(),
        planner=FakePlanner(),
        domain=FakeDomain(),
        collect=lambda: (make_instance(0), FakeWorld("nod")),
        batch_size=1,
        epsilon=0,
    )
    assert [batch.number for batch in itertools.islice(loop, 4)] == [0, 1, 2, 3]


def resume(
    resumed: ResumePoint | None, dataset: Dataset, matrices: list[list[list[float]]], line, epsilon=0.05
):
    """Algorithm 1 from a resume point: batches of four; decisions about the people in `line`."""
    given = iter(matrices)
    return lcorpp(
        {"eyes": dataset},
        train=lambda *_: (FakeClassifier(), ConfusionMatrix(VALUES, np.array(next(given)))),
        make_reasoner=lambda _: FakeReasoner(),
        planner=FakePlanner(),
        domain=FakeDomain(),
        collect=lambda: (make_instance(index := next(line)), FakeWorld("nod" if index == 0 else "shake")),
        batch_size=4,
        epsilon=epsilon,
        confidence=0,
        resume_point=resumed,
    )


MATRICES = [[[8, 2], [3, 7]], [[80, 20], [10, 90]], [[85, 15], [20, 80]]]
LINE = [0, 1, 1, 0, 1, 0, 0, 0]


@pytest.mark.parametrize("decided", [0, 1, 4])
def test_a_resumed_run_ends_like_an_uninterrupted_one(decided):
    """Interrupted after batch 1 and some decisions of batch 2, at most all four."""
    whole = list(itertools.islice(resume(None, START, MATRICES, iter(LINE)), 3))
    stopped = whole[1]
    omega = whole[2].datasets["eyes"]
    made = omega.take(range(len(stopped.datasets["eyes"]) + decided))
    resumed = ResumePoint(1, stopped.senses, decided)
    again, last = itertools.islice(resume(resumed, made, MATRICES[2:], iter(LINE[4 + decided :])), 2)
    assert (again.number, again.change, again.converged) == (1, stopped.change, False)
    assert again.senses is stopped.senses
    assert (last.number, last.change, len(last.episodes)) == (2, whole[2].change, 4 - decided)
    assert np.array_equal(last.datasets["eyes"].trajectories, omega.trajectories)
    assert (last.datasets["eyes"].labels, last.datasets["eyes"].groups) == (omega.labels, omega.groups)


def test_resuming_a_converged_run_makes_no_decision():
    matrix = ConfusionMatrix(VALUES, np.array(MATRICES[0]))
    senses = {"eyes": TrainedSense(FakeClassifier(), matrix, matrix)}
    batches = list(resume(ResumePoint(5, senses, 0), START, [], iter(())))
    assert [(batch.number, batch.converged, batch.episodes) for batch in batches] == [(5, True, ())]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"batch_size": 0}, "K must be at least 1, not 0"),
        ({"epsilon": -1.0}, "at least 0"),
        ({"epsilon": float("nan")}, "at least 0"),
        ({"confidence": 1.0}, "at least 0 and below 1, not 1.0"),
        ({"confidence": float("nan")}, "at least 0 and below 1, not nan"),
    ],
)
def test_invalid_settings(settings, words):
    with pytest.raises(DecisionError, match=words):
        run([[[1, 1], [1, 1]]], **settings)


def test_several_senses_learn_from_the_same_reports():
    """Each has its data, matrix and change; the loop ends when the largest change is small."""
    good, better = np.array([[8, 2], [3, 7]]), np.array([[80, 20], [10, 90]])
    matrices = {"eyes": iter([good, good, good]), "ears": iter([good, better, better])}
    trained, reasoned = [], []

    def train(sense: str, dataset: Dataset):
        trained.append((sense, len(dataset), dataset.trajectories.ndim))
        return FakeClassifier(), ConfusionMatrix(VALUES, next(matrices[sense]))

    def make_reasoner(confusions: Mapping[str, ConfusionMatrix]):
        reasoned.append({name: matrix.counts.tolist() for name, matrix in confusions.items()})
        return FakeReasoner()

    def collect():
        both = {"eyes": make_instance(0).signals["eyes"], "ears": np.array([0.0, 1.0, 2.0])}
        return Instance(both, {}), FakeWorld("nod")

    class HearingClassifier:
        def classify(self, signal):
            return VALUES[int(signal[0])]

    def train_both(sense: str, dataset: Dataset):
        classifier, confusion = train(sense, dataset)
        return (classifier if sense == "eyes" else HearingClassifier()), confusion

    ears = Dataset(np.zeros((4, 3)), ("yes", "no", "yes", "no"))
    batches = list(
        lcorpp(
            {"eyes": START, "ears": ears},
            train=train_both,
            make_reasoner=make_reasoner,
            planner=FakePlanner(),
            domain=FakeDomain(),
            collect=collect,
            batch_size=2,
            epsilon=0.05,
            confidence=0,
        )
    )
    assert trained == [
        *[("eyes", 2, 3), ("ears", 4, 2), ("eyes", 4, 3), ("ears", 6, 2), ("eyes", 6, 3), ("ears", 8, 2)]
    ]
    assert reasoned == [
        {"eyes": good.tolist(), "ears": good.tolist()},
        {"eyes": good.tolist(), "ears": better.tolist()},
    ]
    assert [batch.converged for batch in batches] == [False, False, True]
    second = batches[1]
    assert (second.changes["eyes"].estimate, second.change) == (0, second.changes["ears"])
    assert second.datasets["ears"].labels[4:] == second.datasets["eyes"].labels[2:] == ("yes", "yes")
    assert dict(second.episodes[0].labels) == {"eyes": "yes", "ears": "yes"}


def test_at_least_one_sense_learns():
    with pytest.raises(DecisionError, match="no sense learns"):
        next(
            lcorpp(
                {},
                train=None,
                make_reasoner=None,
                planner=None,
                domain=None,
                collect=None,
                batch_size=1,
                epsilon=0,
            )
        )
