"""Training data, simulated or recorded, with the source of the test trajectories."""

from __future__ import annotations

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.assembly.estimators import TrainingData
from lcorpp.assembly.options import TrainingOptions
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DataError
from lcorpp.learning.classifiers.learner_table import default_features
from lcorpp.simulation.people import make_signal_source, simulate_dataset


def make_training_data(
    domain: Domain, sense: Sense, options: TrainingOptions, seed: int, *, leave_one_out: bool = False
) -> TrainingData:
    """Return the training data that the options or the domain describe, recorded or simulated.

    Args:
        leave_one_out: as of `read_training_data`.

    Raises:
        DataError: a number of simulated tracks is given, and the data are recorded; and as
            `read_training_data`.
        DomainError: as `simulate_training_data`.
    """
    path = options.data or sense.data
    if path is None:
        return simulate_training_data(domain, sense, seed, tracks=options.tracks, seconds=options.seconds)
    if options.tracks is not None:
        raise DataError(f"--tracks {options.tracks}: nothing is simulated, as {path} has the recorded data")
    from lcorpp.assembly.recorded_data import read_training_data  # loads the readers of all formats

    return read_training_data(
        domain,
        sense,
        path,
        seed,
        features=options.features or (default_features(options.learner) if options.learner else None),
        reading=options.reading,
        seconds=options.seconds,
        leave_one_out=leave_one_out,
    )


@check_arguments
def simulate_training_data(
    domain: Domain, sense: Sense, seed: int, *, tracks: int | None = None, seconds: float | None = None
) -> TrainingData:
    """Simulate a training set; the trials simulate new trajectories.

    Args:
        seed: of the simulation.
        tracks: the number of tracks; None takes the sense's number.
        seconds: the last seconds of each track that are used; None takes all.

    Raises:
        DomainError: the domain has no `people.py` with a function for the sense.
        DataError: seconds are given, and the signals are features.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.assembly import simulate_training_data
        >>> domain = load_domain("intention")
        >>> simulate_training_data(domain, domain.senses[0], seed=0, tracks=20).dataset.trajectories.shape
        (20, 2, 304)
    """
    source = make_signal_source(domain, sense, seconds)
    rng = np.random.default_rng([seed, 0])
    dataset = simulate_dataset(domain, sense, source, sense.tracks if tracks is None else tracks, rng)
    return TrainingData(dataset, source, sense.epochs)
