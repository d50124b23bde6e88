"""The LSTM pipelines: the paper's classifier, and a faster one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sklearn.pipeline import Pipeline

from lcorpp.learning.classifiers.learner_table import OWN_FEATURES
from lcorpp.learning.features.motion import ChannelStandardizer, Motion
from lcorpp.learning.features.rate import RATE
from lcorpp.learning.lstm import LstmClassifier


def paper_pipeline(
    *,
    rate: float = RATE,
    interval: float = 0.033,
    inputs: Sequence[str] = ("x", "y"),
    features: Sequence[str] = ("x", "y"),
    class_weight: Any = "balanced",
    **options: Any,
) -> Pipeline:
    """The paper's classifier: three points of motion per second, standardized, into an LSTM of 50 units.

    The defaults are the paper's, except for the class weights, which make no difference on its balanced data;
    `Motion` describes the first four arguments, `LstmClassifier` all others, such as epochs, batch_size and
    random_state. On two thousand simulated tracks 300 epochs overfit; on the authors' 123 they do not.

    Examples:
        >>> from lcorpp.learning import paper_pipeline
        >>> pipeline = paper_pipeline(epochs=100, random_state=1)
        >>> [name for name, step in pipeline.steps], pipeline[-1].units, pipeline[-1].epochs
        (['motion', 'scaling', 'lstm'], 50, 100)
    """
    lstm = LstmClassifier(class_weight=class_weight, **options)
    motion = Motion(rate=rate, interval=interval, features=features, inputs=inputs)
    return Pipeline([("motion", motion), ("scaling", ChannelStandardizer()), ("lstm", lstm)])


def fast_pipeline(
    *,
    epochs: int | None = None,
    min_updates: int = 300,
    dropout: float = 0.5,
    learning_rate: float = 1e-2,
    schedule: str = "one-cycle",
    features: Sequence[str] = OWN_FEATURES,
    **others: Any,
) -> Pipeline:
    """The paper's network in a thirtieth of its time, and without overfitting to some hundred tracks.

    Six passes with a one-cycle learning rate, more if `min_updates` needs them, twice the dropout of the
    paper, and speeds instead of positions. A number of epochs takes the place of `min_updates`. The other
    arguments are those of `paper_pipeline`.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import fast_pipeline, train
        >>> walks = [np.outer([speed, 0], np.arange(30) / 10) for speed in (0.2, 0.3, 0.4, 1.1, 1.2, 1.3)]
        >>> data = Dataset(walks, 3 * ["slow"] + 3 * ["fast"], interval=0.1)
        >>> train(fast_pipeline(interval=0.1, min_updates=50, units=8), data).classify(1.5 * walks[3])
        'fast'
    """
    training: dict[str, Any] = {"dropout": dropout, "learning_rate": learning_rate, "schedule": schedule}
    training |= {"epochs": 6, "min_updates": min_updates} if epochs is None else {"epochs": epochs}
    return paper_pipeline(features=features, **training, **others)
