from .classifiers.logistic import QuadraticLogistic as QuadraticLogistic
from .classifiers.registry import LEARNERS as LEARNERS, learner as learner
from .classifiers.storage import load_classifier as load_classifier, save_classifier as save_classifier
from .classifiers.trained import (
    SoftClassifier as SoftClassifier,
    TrainedClassifier as TrainedClassifier,
    fast_pipeline as fast_pipeline,
    paper_pipeline as paper_pipeline,
    train as train,
    train_and_validate as train_and_validate,
)
from .data.authors import read_authors as read_authors
from .data.dataset import check_trainable as check_trainable, split as split
from .data.npz import load_dataset as load_dataset, save_dataset as save_dataset
from .data.reading import read_data as read_data, read_recording as read_recording
from .data.tracks import Recording as Recording, Track as Track
from .data.windows import to_dataset as to_dataset
from .data.writing import write_recording as write_recording
from .evaluation.calibration import (
    Calibration as Calibration,
    calibrate as calibrate,
    cross_calibrated as cross_calibrated,
)
from .evaluation.leakage import Leak as Leak, leak_check as leak_check, leak_note as leak_note
from .evaluation.report import Report as Report, report_on as report_on
from .evaluation.report_figure import plot_report as plot_report
from .evaluation.report_files import write_report as write_report
from .evaluation.thresholds import Cut as Cut, Threshold as Threshold, choose_threshold as choose_threshold
from .evaluation.validation import (
    Rate as Rate,
    Validation as Validation,
    cross_validate as cross_validate,
    rates_intervals as rates_intervals,
)
from .features.motion import Motion as Motion, Scaling as Scaling
from .features.resampling import regular as regular
from .features.summaries import Summaries as Summaries
from .lstm import LstmClassifier as LstmClassifier, LstmState as LstmState
from .store import NewTrack as NewTrack, Store as Store, TrackSchema as TrackSchema, read_store as read_store
from .streaming import (
    Answer as Answer,
    ByAge as ByAge,
    Early as Early,
    OverTime as OverTime,
    Streams as Streams,
    at_every_age as at_every_age,
    calibrate_over_time as calibrate_over_time,
    follow as follow,
    out_of_fold_over_time as out_of_fold_over_time,
    prefix as prefix,
)
