"""Bad arguments of the public functions: typed errors with argument, value and expectation."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pytest

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, LcorppError
from lcorpp.learning import (
    Calibration,
    LstmClassifier,
    Motion,
    NewTrack,
    PrefixCalibration,
    QuadraticLogistic,
    Recording,
    Store,
    StreamingClassifier,
    Track,
    TrackSchema,
    build_report,
    check_trainable,
    cross_calibrate,
    cross_validate,
    fit_calibration,
    format_leakage_warning,
    learner,
    load_dataset,
    measure_leakage,
    read_data,
    read_recording,
    save_dataset,
    search_trigger,
    split,
    to_dataset,
    train,
    train_and_validate,
    truncate,
    with_prefix_ensemble,
    write_recording,
)
from lcorpp.values import Dataset
from tests.learning.walkers import walkers

DATA = walkers(20)
TRAINED, VALIDATION = train_and_validate(learner("summaries", interval=DATA.interval), DATA, folds=2)
RECORDING = Recording(
    tuple(
        Track(str(i), np.arange(3.0), {"x": np.arange(3.0) * i, "y": np.ones(3)}, "ab"[i % 2])
        for i in range(4)
    )
)
TIMES = np.arange(3.0)
HALVES = np.full(2, 0.5)
SCHEMA = TrackSchema(("x", "y"), interval=0.033, classes=("a", "b"))
NUMBERS = np.zeros((4, 2))
NAMES = np.array(["a", "b"] * 2)


def store(tmp_path, **fields):
    with Store(tmp_path / "s.tracks", SCHEMA) as opened:
        opened.append(NewTrack(**fields))


# a call, its good arguments, of which each is replaced by each bad value
CALLS = {
    "Dataset": (Dataset, {"trajectories": np.zeros((2, 2, 3)), "labels": ("a", "b"), "groups": ("1", "2"),
                          "source": "", "notes": (), "interval": 0.1, "channels": ("x", "y"),
                          "weights": HALVES}),
    "last": (DATA.last, {"seconds": 1.0}),
    "search_trigger": (search_trigger, {"timeline": VALIDATION}),
    "take": (DATA.take, {"rows": [0, 1]}),
    "append": (DATA.append, {"pairs": [(DATA.trajectories[0], "slow")], "groups": ["1"]}),
    "Track": (Track, {"id": "a", "times": TIMES, "columns": {"x": TIMES, "y": TIMES}, "group": "a"}),
    "Recording": (Recording, {"tracks": RECORDING.tracks, "source": "", "notes": ()}),
    "train": (train, {"estimator": TRAINED.estimator, "dataset": DATA}),
    "cross_validate": (cross_validate, {"estimator": TRAINED.estimator, "dataset": DATA, "folds": 2,
                                        "seed": 0, "jobs": 1}),
    "check_trainable": (check_trainable, {"dataset": DATA, "folds": 2}),
    "split": (split, {"dataset": DATA, "test": 0.3, "seed": 0}),
    "to_dataset": (to_dataset, {"recording": RECORDING, "interval": 1.0, "points": 2, "channels": ("x", "y"),
                                "end": "last"}),
    "truncate": (truncate, {"dataset": DATA, "fraction": 0.5}),
    "fit_calibration": (fit_calibration, {"classes": ("a", "b"), "probabilities": np.full((4, 2), 0.5),
                                          "labels": tuple(NAMES.tolist())}),
    "cross_calibrate": (cross_calibrate, {"validation": VALIDATION}),
    "Calibration": (Calibration, {"classes": ("a", "b"), "slope": 1.0, "offsets": 0 * HALVES,
                                  "lapses": 0 * HALVES, "shares": HALVES}),
    "from_json": (Calibration.from_json, {"numbers": VALIDATION}),
    "PrefixCalibration": (PrefixCalibration, {"min_points": 2, "calibrations": ()}),
    "measure_leakage": (measure_leakage, {"data": DATA, "n_splits": 1, "seed": 0}),
    "format_leakage_warning": (format_leakage_warning, {"data": DATA}),
    "build_report": (build_report, {"validation": VALIDATION}),
    "with_prefix_ensemble": (with_prefix_ensemble, {"fractions": (0.5, 1.0), "pipeline": TRAINED.estimator}),
    "StreamingClassifier": (StreamingClassifier, {"pipeline": TRAINED.estimator, "allowed_lateness": 0.0,
                            "max_gap": 1.0, "max_duration": 60.0, "max_speed": 12.0, "max_silence": 5.0,
                            "min_points": 2, "window": 3}),
    "from_trained": (StreamingClassifier.from_trained, {"trained": TRAINED, "prefix_calibration": None,
                                                        "prefix_sets": None, "trigger": None}),
    "push_many": (StreamingClassifier(TRAINED.estimator).push_many, {"samples": [(0, "a", 1, 2)]}),
    "probabilities": (TRAINED.probabilities, {"trajectories": DATA.trajectories}),
    "Motion": (lambda **options: Motion(**options).fit(DATA.trajectories), {"rate": 3.0, "interval": 0.1,
                                                                            "robot": (0, 0, 0)}),
    "transform": (Motion().fit(DATA.trajectories).transform, {"X": DATA.trajectories}),
    "lstm": (lambda **given: LstmClassifier(epochs=1).fit(**given), {"X": DATA.trajectories,
                                                                     "y": DATA.labels}),
    "logistic": (lambda **given: QuadraticLogistic().fit(**given), {"X": NUMBERS, "y": NAMES}),
    "save_dataset": (save_dataset, {"dataset": DATA, "path": "/nowhere/a.npz"}),
    "load_dataset": (load_dataset, {"path": "/nowhere"}),
    "read_data": (read_data, {"path": "/nowhere", "repair": (), "interval": 0.1, "channels": ("x", "y")}),
    "read_recording": (read_recording, {"path": "/nowhere", "labels": {}, "robot": (0, 0, 0), "gap": 5.0}),
    "write_recording": (write_recording, {"recording": RECORDING, "path": "/nowhere/a.csv"}),
}  # fmt: skip
BAD_VALUES = (object(), 1j, [[1, 2], [3]], {"a": object()}, [None], lambda: None)


@pytest.mark.parametrize("name", CALLS)
def test_every_bad_argument_is_a_typed_error(name):
    call, good = CALLS[name]
    for argument in good:
        for value in BAD_VALUES:
            if argument == "labels" and name == "read_recording" and isinstance(value, list):
                continue
            with pytest.raises(LcorppError):
                call(**{**good, argument: value})


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: DATA.last(float("nan")), "the window is nan s; expected a finite number above 0"),
        (lambda: RECORDING.last(float("nan")), "the last nan seconds are not part of a track; expected"),
        (
            lambda: RECORDING.in_robot_frame(0, np.inf, 0),
            "the robot's pose is 0 inf 0; expected finite numbers",
        ),
        (
            lambda: StreamingClassifier(learner("summaries")),
            "streaming needs a fitted pipeline: This Motion instance is not fitted yet",
        ),
        (
            lambda: StreamingClassifier(learner("minirocket")),
            "streaming needs a fitted pipeline: This Motion instance is not fitted yet",
        ),
        (lambda: cross_validate(TRAINED.estimator, DATA, folds=2.5), "folds is 2.5; expected a whole number"),
        (
            lambda: cross_validate(TRAINED.estimator, DATA, jobs=0),
            "jobs is 0; expected a number of processes",
        ),
        (lambda: cross_validate(TRAINED.estimator, DATA, jobs=True), "jobs is True; expected a whole number"),
        (lambda: cross_validate(TRAINED.estimator, [1]), "dataset is [1]; expected a Dataset"),
        (lambda: Dataset(NUMBERS, (None, "a")), "Dataset: labels[0] is None; expected a text"),
        (lambda: Dataset(NUMBERS, ("a", float("nan"))), "Dataset: labels[1] is nan; expected a text"),
        (
            lambda: Dataset([[1], ["a"]], ("a", "b")),
            "trajectories is [[1], ['a']]; expected an array of numbers",
        ),
        (lambda: DATA.take([100]), "the rows are [100]; expected a sequence of indices below 20"),
        (lambda: LstmClassifier().fit(DATA.trajectories, [None] * 20), "label 0 (counted from 0) is None"),
        (lambda: QuadraticLogistic().fit(NUMBERS, [1.0, np.nan, 1, 2]), "label 1 (counted from 0) is nan"),
        (lambda: split(DATA, test="0.3", seed=0), "split: test is '0.3'; expected a number"),
        (lambda: split(DATA, seed=-1), "the seed must lie between 0 and 4294967295, not -1"),
        (lambda: to_dataset(RECORDING, points=2, channels="xy"), "channels is 'xy'; expected a sequence"),
        (
            lambda: to_dataset(RECORDING, points=2, channels=[]),
            "the channels are empty; expected one of x, y",
        ),
    ],
)
def test_the_message_names_the_argument_its_value_and_what_was_expected(call, words):
    with pytest.raises(DataError, match=re.escape(words)):
        call()


def test_bad_fields_of_a_new_track_are_typed_errors(tmp_path):
    good = {"trajectory": np.zeros((2, 3)), "label": "a", "source": "robot", "belief": None, "context": {}}
    for field in good:
        for value in BAD_VALUES:
            with pytest.raises(LcorppError):
                store(tmp_path, **{**good, field: value})
    with pytest.raises(DataError, match="path is None; expected a text or a Path"):
        Store(None, SCHEMA)


def test_lists_and_numpy_numbers_are_as_good_as_arrays_and_numbers():
    data = Dataset(
        DATA.trajectories.tolist(), list(DATA.labels), np.array(DATA.groups), interval=np.float32(0.5)
    )
    assert np.array_equal(data.trajectories, DATA.trajectories)
    assert len(truncate(DATA, np.float64(0.5))) == 20
    assert cross_validate(TRAINED.estimator, DATA, folds=np.int64(2)).accuracy == VALIDATION.accuracy
    rows = fit_calibration(["a", "b"], [[0.2, 0.8], [0.7, 0.3]], ["b", "a"]).calibrate([[0.5, 0.5]])
    assert rows.shape == (1, 2)


def test_each_element_of_a_sequence_is_checked():
    @check_arguments
    def call(
        names: tuple[str, ...] = (), rates: Sequence[float] = (), shape: tuple[int, int] = (1, 1)
    ) -> None:
        return None

    call(np.array(["a", "b"]), [1, np.float32(2), 3.0], (2, 3))
    for options, words in (
        ({"names": (*"ab" * 50, 7)}, r"names\[100\] is 7; expected a text"),
        ({"rates": [1.0] * 50 + [True]}, r"rates\[50\] is True; expected a number"),
        ({"shape": (2, 3, 4)}, r"shape is \(2, 3, 4\); expected a sequence of 2, each a whole number"),
    ):
        with pytest.raises(DataError, match=f"call: {words}"):
            call(**options)


def test_what_is_imported_for_type_checkers_only_is_not_checked():
    @check_arguments
    def call(one: int, other: Unknown = 3) -> int:  # noqa: F821  # as under TYPE_CHECKING
        return one

    assert call(1, object()) == 1
    with pytest.raises(DataError, match="call: one is '1'; expected a whole number"):
        call("1")
    with pytest.raises(TypeError):
        call(1, 2, 3)
