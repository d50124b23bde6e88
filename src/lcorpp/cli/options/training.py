"""The options of training that several commands share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import typer

from lcorpp.cli.options.common import MAX_TRACKS

TracksOption = Annotated[
    int | None,
    typer.Option(min=20, max=MAX_TRACKS, help="Simulated training tracks; by default the domain's number."),
]
EpochsOption = Annotated[
    int | None, typer.Option(min=1, help="Training epochs; by default a number that suits the data.")
]
FeaturesOption = Annotated[
    str | None,
    typer.Option(
        help="The classifier's features of the motion, separated by commas: x, y, velocity, turn_rate"
        " and more, see docs/guides/learning/features.md; by default those that suit the learner."
    ),
]
RateOption = Annotated[
    float | None,
    typer.Option(
        min=0.001, max=1000, help="Points per second at which the features are computed; 3 by default."
    ),
]
SecondsOption = Annotated[
    float | None,
    typer.Option(
        min=0.001,
        max=3600,
        help="The last seconds of each track that are used; by default those of the domain, ten of recorded"
        " and all of simulated tracks.",
    ),
]

BalanceOption = Annotated[
    str | None,
    typer.Option(
        metavar="classes|none",
        help="What has equal weight in the training: the classes, by default, or the cases, so that rare"
        " classes hardly count.",
    ),
]


@dataclass(frozen=True)
class TrainingGroup:
    """How the classifiers of a domain are trained; each field is an option of its name."""

    epochs: EpochsOption = None
    device: Annotated[
        str, typer.Option(help="The device of the LSTM: cpu or cuda; other learners use the cpu.")
    ] = "cpu"
    features: FeaturesOption = None
    rate: RateOption = None
    seconds: SecondsOption = None
    balance: BalanceOption = None

    def choose(
        self, tracks: int | None, *, threshold: str | None = None, prevalence: float | None = None
    ) -> dict[str, Any]:
        """Return the given fields of `TrainingOptions`; None is the default."""
        features = self.features
        return {
            "tracks": tracks,
            "epochs": self.epochs,
            "threshold": threshold,
            "prevalence": prevalence,
            "device": self.device if self.device != "cpu" else None,
            "features": None if features is None else tuple(name.strip() for name in features.split(",")),
            "rate": self.rate,
            "seconds": self.seconds,
            "balance": self.balance,
        }
