from .classifiers.learner_table import LEARNERS as LEARNERS
from .classifiers.logistic import QuadraticLogistic as QuadraticLogistic
from .classifiers.pipelines import fast_pipeline as fast_pipeline, paper_pipeline as paper_pipeline
from .classifiers.registry import learner as learner
from .classifiers.storage import load_classifier as load_classifier, save_classifier as save_classifier
from .classifiers.trained import (
    SoftClassifier as SoftClassifier,
    TrainedClassifier as TrainedClassifier,
    train as train,
    train_and_validate as train_and_validate,
)
from .data.authors import read_authors as read_authors
from .data.dataset import check_trainable as check_trainable
from .data.fetching import fetch_authors as fetch_authors
from .data.npz import load_dataset as load_dataset, save_dataset as save_dataset
from .data.plots import plot_tracks as plot_tracks
from .data.reading import (
    convert_snapshot as convert_snapshot,
    read_data as read_data,
    read_recording as read_recording,
)
from .data.tracks import (
    Recording as Recording,
    Repair as Repair,
    Track as Track,
    count_repairs as count_repairs,
)
from .data.windows import to_dataset as to_dataset
from .data.writing import write_recording as write_recording
from .evaluation.calibration import (
    Calibration as Calibration,
    cross_calibrate as cross_calibrate,
    fit_calibration as fit_calibration,
)
from .evaluation.folds import split as split
from .evaluation.leakage import (
    ShortcutScore as ShortcutScore,
    format_leakage_warning as format_leakage_warning,
    measure_leakage as measure_leakage,
)
from .evaluation.prediction_sets import (
    PredictionSets as PredictionSets,
    fit_prediction_sets as fit_prediction_sets,
)
from .evaluation.report import (
    ClassReport as ClassReport,
    EvaluationReport as EvaluationReport,
    build_report as build_report,
)
from .evaluation.report_figure import plot_report as plot_report
from .evaluation.report_files import write_report as write_report
from .evaluation.thresholds import (
    DecisionThreshold as DecisionThreshold,
    ThresholdChoice as ThresholdChoice,
    apply_threshold as apply_threshold,
    choose_threshold as choose_threshold,
)
from .evaluation.validation import (
    Rate as Rate,
    Validation as Validation,
    cross_validate as cross_validate,
    estimate_rates as estimate_rates,
)
from .features.motion import ChannelStandardizer as ChannelStandardizer, Motion as Motion
from .features.resampling import resample as resample
from .features.summaries import SummaryFeatures as SummaryFeatures
from .lstm import LstmClassifier as LstmClassifier, LstmState as LstmState
from .store import (
    LabelRecord as LabelRecord,
    NewTrack as NewTrack,
    Snapshot as Snapshot,
    Store as Store,
    StoredTrack as StoredTrack,
    TrackSchema as TrackSchema,
    read_store as read_store,
)
from .streaming.plots import plot_timeline as plot_timeline
from .streaming.predictions import Prediction as Prediction, StreamReport as StreamReport
from .streaming.prefix_ensemble import (
    PrefixEnsemble as PrefixEnsemble,
    with_prefix_ensemble as with_prefix_ensemble,
)
from .streaming.prefix_sets import PrefixSets as PrefixSets, fit_prefix_sets as fit_prefix_sets
from .streaming.prefixes import (
    cross_predict_over_time as cross_predict_over_time,
    predict_over_time as predict_over_time,
    truncate as truncate,
    with_prefixes as with_prefixes,
)
from .streaming.streaming_classifier import StreamingClassifier as StreamingClassifier
from .streaming.timeline import (
    PredictionTimeline as PredictionTimeline,
    PrefixCalibration as PrefixCalibration,
    calibrate_prefixes as calibrate_prefixes,
    cross_calibrate_prefixes as cross_calibrate_prefixes,
)
from .streaming.timeline_table import write_timeline as write_timeline
from .streaming.trigger import EarlyDecision as EarlyDecision, EarlyScore as EarlyScore, Trigger as Trigger
from .streaming.trigger_figure import plot_trigger as plot_trigger
from .streaming.trigger_fitting import (
    TriggerSearch as TriggerSearch,
    fit_trigger as fit_trigger,
    search_trigger as search_trigger,
)
