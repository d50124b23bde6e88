from .arrays import (
    Z95 as Z95,
    Array as Array,
    Belief as Belief,
    Flags as Flags,
    Indices as Indices,
    Interval as Interval,
    check_rows as check_rows,
    freeze as freeze,
    share_frozen as share_frozen,
    wrap_angle as wrap_angle,
)
from .confusion import (
    JEFFREYS as JEFFREYS,
    LAPLACE as LAPLACE,
    ConfusionMatrix as ConfusionMatrix,
)
from .dataset import (
    CHANNELS as CHANNELS,
    GAZE_CHANNELS as GAZE_CHANNELS,
    GROUP_SEPARATOR as GROUP_SEPARATOR,
    Dataset as Dataset,
    Kind as Kind,
    LabelEvidence as LabelEvidence,
    track_hash as track_hash,
)
from .distribution import (
    Distribution as Distribution,
    Label as Label,
    Likelihood as Likelihood,
    SharedValue as SharedValue,
    format_value as format_value,
    read_value as read_value,
)
from .episode import Episode as Episode, Instance as Instance, Step as Step
from .evidence_kind import (
    BASELINE_SIGN as BASELINE_SIGN,
    COVERAGE as COVERAGE,
    EVIDENCE as EVIDENCE,
    EvidenceKind as EvidenceKind,
    check_coverage as check_coverage,
)
from .padding import (
    Lengths as Lengths,
    count_window as count_window,
    cut_tracks as cut_tracks,
    find_perceived as find_perceived,
    measure_lengths as measure_lengths,
    stack_signals as stack_signals,
    strip_padding as strip_padding,
)
