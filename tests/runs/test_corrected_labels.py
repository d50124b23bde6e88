"""Reports that may be wrong: classes and error rates from the answers, with domains of several kinds."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.errors import DataError
from lcorpp.learning import estimate_rates
from lcorpp.runs.corrected_labels import correct_labels
from lcorpp.values import ConfusionMatrix, Dataset, LabelEvidence
from tests.domains.deliveries import VARIABLES, write_learning_domain

CLASSES = ("interested", "not_interested")
TIMES = {"morning": 0.6, "afternoon": 0.3}
"""Time -> share of interested people."""


@pytest.fixture(scope="module")
def intention():
    return load_domain("intention")


def make_evidence(rng, true, error, most=6):
    """Return what is behind a report: 1 to `most` answers to each of two actions, and the reported class.

    The robot believes that fewer answers are wrong than are.
    """
    answers = tuple(
        (action, "pos" if (true == CLASSES[0]) == (rng.random() >= error) else "neg")
        for action in rng.choice(["greet", "move_forward"], size=rng.integers(1, most + 1)).tolist()
    )
    more = sum(1 if observation == "pos" else -1 for _, observation in answers)
    report = CLASSES[int(more < 0 or (more == 0 and rng.random() < 0.5))]
    return answers, report, {name: 0.95 if name == report else 0.05 for name in CLASSES}


def make_reports(n, error, rates=(0.8, 0.7), seed=0, certain=0):
    """Return true classes, a data set of reports, the first `certain` of them by persons, and predictions."""
    rng = np.random.default_rng(seed)
    true, labels, predictions, evidence = [], [], [], []
    for row in range(n):
        time = list(TIMES)[rng.integers(2)]
        k = int(rng.random() >= TIMES[time])
        answers, report, belief = make_evidence(rng, CLASSES[k], error)
        true.append(CLASSES[k])
        labels.append(CLASSES[k] if row < certain else report)
        predictions.append(CLASSES[k if rng.random() < rates[k] else 1 - k])
        evidence.append(None if row < certain else LabelEvidence(belief, {"time": time}, answers))
    return true, Dataset(np.zeros((n, 2, 3)), tuple(labels), evidence=tuple(evidence)), predictions


def count(true, predictions, classes=CLASSES):
    """(n, n) the confusion matrix of the true classes."""
    pairs = list(zip(true, predictions, strict=True))
    return np.array([[float(pairs.count((x, y))) for y in classes] for x in classes])


def normalise(counts):
    return counts / counts.sum(axis=1, keepdims=True)


def test_the_confusion_matrix_is_that_of_the_true_classes(intention):
    true, dataset, predictions = make_reports(4000, error=0.3)
    corrected = correct_labels(intention, "motion", dataset, predictions)
    assert corrected.confusion.classes == CLASSES
    assert corrected.confusion.counts.sum() == pytest.approx(4000)
    expected = normalise(count(true, predictions))
    np.testing.assert_allclose(normalise(corrected.confusion.counts), expected, atol=0.03)
    reported = np.array(dataset.labels)
    against = normalise(count(reported, predictions))
    assert (np.diag(against) < np.diag(expected) - 0.05).all()
    best = [max(own, key=own.get) for own in corrected.distributions]
    right = np.array(best) == true
    assert right.mean() > (reported == true).mean() + 0.03
    confidence = np.mean([max(own.values()) for own in corrected.distributions])
    assert confidence == pytest.approx(right.mean(), abs=0.02)


def test_labels_by_persons_are_certain_and_say_how_good_the_classifier_is(intention):
    true, dataset, predictions = make_reports(600, error=0.3, certain=500)
    corrected = correct_labels(intention, "motion", dataset, predictions)
    assert corrected.distributions[:500] == (None,) * 500
    assert None not in corrected.distributions[500:]
    found, expected = normalise(corrected.confusion.counts), normalise(count(true, predictions))
    np.testing.assert_allclose(found, expected, atol=0.02)
    alone = correct_labels(intention, "motion", dataset.take(range(500)), predictions[:500])
    assert alone.confusion.counts.tolist() == count(true[:500], predictions[:500]).tolist()


def test_certain_labels_count_fully_and_uncertain_ones_less(intention):
    _, dataset, predictions = make_reports(300, error=0.3, certain=300)
    known = correct_labels(intention, "motion", dataset, predictions).confusion
    assert known.effective_cases is None  # all count
    shares = []
    for error in (0.1, 0.2, 0.3, 0.4):
        _, dataset, predictions = make_reports(300, error=error, seed=1)
        matrix = correct_labels(intention, "motion", dataset, predictions).confusion
        shares.append(matrix.effective_cases / matrix.counts.sum(axis=1, keepdims=True))
        widths = [rate.interval.high - rate.interval.low for row in estimate_rates(matrix) for rate in row]
        certain = estimate_rates(ConfusionMatrix(matrix.classes, matrix.counts))
        assert (
            np.array(widths) > [rate.interval.high - rate.interval.low for row in certain for rate in row]
        ).all()
    assert (np.diff([share.mean() for share in shares]) < 0).all()
    assert shares[0].min() > 0.6
    assert shares[2].max() < 0.6


def test_the_weight_of_a_case_counts(intention):
    _, dataset, predictions = make_reports(60, error=0.2)
    weights = np.where(np.arange(60) % 3, 1.0, 2.0)
    twice = np.repeat(np.arange(60), weights.astype(int))
    weighted = correct_labels(intention, "motion", replace(dataset, weights=weights), predictions).confusion
    repeated = correct_labels(
        intention, "motion", dataset.take(twice), [predictions[row] for row in twice]
    ).confusion
    totals = weighted.counts.sum(axis=1)
    np.testing.assert_allclose(totals, repeated.counts.sum(axis=1), atol=1e-4)
    np.testing.assert_allclose(
        normalise(weighted.counts), normalise(repeated.counts), atol=0.03
    )  # by samples


@pytest.mark.slow
@pytest.mark.parametrize("n", [200, 1000])
@pytest.mark.parametrize("error", [0.1, 0.2, 0.3, 0.4])
def test_intervals_cover_the_true_rates(intention, n, error):
    """300 data sets: of 600 intervals 95 % contain the true rate, with three standard errors of .9 points."""
    hits = 0
    for seed in range(300):
        _, dataset, predictions = make_reports(n, error, seed=[seed, n])
        rates = estimate_rates(correct_labels(intention, "motion", dataset, predictions).confusion)
        for row, true in enumerate((0.8, 0.7)):
            interval = rates[row][row].interval
            hits += interval.low <= true <= interval.high
    assert 0.923 < hits / 600 < 0.977


def test_perfect_answers_are_hard_labels(intention):
    true, dataset, predictions = make_reports(1000, error=0)
    assert list(dataset.labels) == true
    corrected = correct_labels(intention, "motion", dataset, predictions)
    sure = np.array([own[label] for own, label in zip(corrected.distributions, true, strict=True)])
    assert (sure > 0.9).all()
    assert (sure == 1).mean() > 0.75  # improbable classes are left out
    np.testing.assert_allclose(corrected.confusion.counts, count(true, predictions), atol=6)


@pytest.mark.parametrize(("unknown", "known"), [(None, 0), ((), 0), (None, 1000)])
def test_without_answers_the_report_is_an_answer(intention, unknown, known):
    """Stores of earlier versions have no answers, or of some cases; a robot may report without a question."""
    true, dataset, predictions = make_reports(1500, error=0.2)
    bare = [
        LabelEvidence(own.belief, own.context, own.answers if row < known else unknown)
        for row, own in enumerate(dataset.evidence)
    ]
    silent = Dataset(dataset.trajectories, dataset.labels, evidence=tuple(bare))
    corrected = correct_labels(intention, "motion", silent, predictions)
    best = [max(own, key=own.get) for own in corrected.distributions]
    assert np.mean(np.array(best) == true) >= np.mean(np.array(dataset.labels) == true) - 0.005
    found, expected = normalise(corrected.confusion.counts), normalise(count(true, predictions))
    np.testing.assert_allclose(found, expected, atol=0.06)


@pytest.mark.slow
def test_a_sense_of_one_of_several_shared_variables(tmp_path):
    """Three variables: the gaze shows the item, the voice the person; each question is about one of them."""
    domain, rng = load_domain(write_learning_domain(tmp_path / "deliveries")), np.random.default_rng(0)
    n, evidence, wanted = 4000, [], []
    for _ in range(n):
        person = {name: values[rng.integers(2)] for name, values in VARIABLES.items()}
        answers = []
        for name in rng.choice(list(VARIABLES), size=rng.integers(3, 12)).tolist():
            own, other = person[name], next(x for x in VARIABLES[name] if x != person[name])
            answers.append((f"ask_{name}", own if rng.random() > 0.3 else other))
        evidence.append(LabelEvidence({}, {"time": "noon"}, tuple(answers)))
        wanted.append(person)
    for sense, variable in (("gaze", "item"), ("voice", "person")):
        classes = domain.find_sense(sense).classes
        true = np.array([person[variable] for person in wanted])
        swap = rng.random(n) < np.where(true == classes[0], 0.15, 0.3)
        predictions = np.where(swap, np.where(true == classes[0], classes[1], classes[0]), true).tolist()
        reports = tuple(classes[row % 2] for row in range(n))  # they count for nothing
        dataset = Dataset(np.zeros((n, 2)), reports, evidence=tuple(evidence))
        confusion = correct_labels(domain, sense, dataset, predictions).confusion
        expected = normalise(count(true.tolist(), predictions, confusion.classes))
        np.testing.assert_allclose(normalise(confusion.counts), expected, atol=0.04)


def test_three_values_and_questions_that_distinguish_some_of_them():
    """In the museum a greeting is answered alike by two of three kinds of visitors."""
    domain, rng = load_domain("museum"), np.random.default_rng(0)
    classes = domain.find_sense("motion").classes
    chances = {  # P(yes)
        "greet": {"tour": 0.7, "directions": 0.7, "nothing": 0.35},
        "offer_tour": {"tour": 0.75, "directions": 0.3, "nothing": 0.3},
        "offer_directions": {"tour": 0.3, "directions": 0.75, "nothing": 0.2},
    }
    true, evidence, predictions = [], [], []
    for _ in range(3000):
        wish = classes[rng.integers(3)]
        answers = tuple(
            (action, "yes" if rng.random() < chances[action][wish] else "no")
            for action in rng.choice(list(chances), size=5).tolist()
        )
        true.append(wish)
        evidence.append(LabelEvidence({}, {}, answers))
        predictions.append(wish if rng.random() < 0.7 else classes[rng.integers(3)])
    dataset = Dataset(np.zeros((3000, 2, 3)), tuple(true), evidence=tuple(evidence))
    corrected = correct_labels(domain, "motion", dataset, predictions)
    confusion = corrected.confusion
    expected = normalise(count(true, predictions, confusion.classes))
    np.testing.assert_allclose(normalise(confusion.counts), expected, atol=0.06)  # three standard errors


@pytest.mark.parametrize("answer", [("greet", "maybe"), ("sing", "pos")])
def test_answers_of_another_model_are_refused(intention, answer):
    evidence = LabelEvidence({"interested": 1.0}, {}, (answer,))
    dataset = Dataset(np.zeros((1, 2, 3)), ("interested",), evidence=(evidence,))
    with pytest.raises(DataError, match=f"the answer '{answer[1]}' to '{answer[0]}' is not of the domain"):
        correct_labels(intention, "motion", dataset, ["interested"])
