"""The options of a simulated robot that `run` and `learn` share, with one meaning in both."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli.options import common as options
from lcorpp.cli.options.recordings import LabelOption, RecordingOptions, parse_written_labels
from lcorpp.cli.options.senses import (
    ClassifiersOption,
    DataOption,
    EvidenceOption,
    LearnersOption,
    choose_classifiers,
    choose_evidence,
    reject_given,
)
from lcorpp.errors import DomainError

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions, EvidenceOptions
    from lcorpp.domains import Domain
    from lcorpp.domains.sections.learning import Sense
    from lcorpp.planning import Policy, SolverOptions


@dataclass(frozen=True)
class RobotOptions:
    """The values of the shared options; see `take_options`."""

    domain: options.DomainArgument = "intention"
    preset: options.PresetOption = None
    world: options.WorldOption = None
    seed: options.SeedOption = 0
    classifier: ClassifiersOption = None
    learner: LearnersOption = None
    evidence: EvidenceOption = None
    data: DataOption = None
    label: LabelOption = None
    recording: RecordingOptions = field(default_factory=RecordingOptions)
    epochs: options.EpochsOption = None
    device: options.DeviceOption = "cpu"
    features: options.FeaturesOption = None
    rate: options.RateOption = None
    seconds: options.SecondsOption = None
    smoothing: options.SmoothingOption = options.Smoothing.jeffreys
    threshold: Annotated[
        str | None,
        typer.Option(
            help="Decision threshold of the positive class: a number, the metric to optimise (accuracy, f1,"
            " youden) or the costs MISS:ALARM; by default the most probable class is predicted."
        ),
    ] = None
    prevalence: Annotated[
        float | None,
        typer.Option(
            min=1e-6,
            max=1 - 1e-6,
            help="Prevalence of the positive class, for thresholds; by default from the knowledge.",
        ),
    ] = None
    policy: Annotated[
        Path | None, typer.Option(help="A policy for the domain's POMDP, instead of solving it.")
    ] = None
    solver: options.SolverOption = None
    precision: options.PrecisionOption = None
    time_limit: options.TimeLimitOption = None
    no_cache: options.NoCacheOption = False
    log: options.LogOption = None
    out: options.OutOption = None
    formats: options.FormatOption = None
    jobs: options.JobsOption = None

    def load_domain(self) -> Domain:
        """Load the domain with its preset and world."""
        from lcorpp.domains import load_domain, with_world

        loaded = load_domain(self.domain, preset=self.preset)
        return loaded if self.world is None else with_world(loaded, self.world)

    def choose_classifiers(
        self, domain: Domain, used: Sequence[Sense], tracks: int | None, trained: Collection[str] = ()
    ) -> dict[str, ClassifierOptions]:
        """Return the options of the classifier of each used sense; see `senses.choose_classifiers`."""
        return choose_classifiers(
            domain,
            used,
            classifiers=self.classifier or [],
            learners=self.learner or [],
            data=self.data or [],
            reading=self.recording.choose_reading(parse_written_labels(self.label)),
            training=options.choose_training(
                tracks=tracks,
                epochs=self.epochs,
                device=self.device,
                features=self.features,
                rate=self.rate,
                seconds=self.seconds,
                threshold=self.threshold,
                prevalence=self.prevalence,
            ),
            trained=trained,
        )

    def choose_evidence(self, domain: Domain, sources: Mapping[str, ClassifierOptions]) -> EvidenceOptions:
        """Return the evidence of the chosen classifiers.

        Raises:
            DomainError: as `senses.choose_evidence`; or --threshold or --smoothing has no effect on it.
        """
        from lcorpp.assembly.options import EvidenceOptions
        from lcorpp.values import JEFFREYS, LAPLACE

        kinds = choose_evidence(domain, sources, self.evidence or [])
        trained = {name for name, source in sources.items() if source is not None}
        only_likelihoods = trained <= set(kinds)
        if trained and only_likelihoods and self.threshold is not None:
            raise DomainError("--threshold determines labels; evidence by likelihoods or sets uses none")
        laplace = self.smoothing is options.Smoothing.laplace
        if laplace and only_likelihoods:
            raise DomainError("--smoothing applies to the labels of a trained classifier only")
        return EvidenceOptions(kinds, LAPLACE if laplace else JEFFREYS)

    def choose_solver(self, domain: Domain) -> SolverOptions:
        """Return the domain's solver with the values of the options."""
        return options.choose_solver(domain.planning.solver, self.solver, self.precision, self.time_limit)

    def find_cache(self) -> Path | None:
        """Return the folder that keeps policies; None for none."""
        from lcorpp.planning.policy_cache import find_cache_folder

        return None if self.no_cache else find_cache_folder()

    def read_policy(self, domain: Domain) -> Policy | None:
        """Read the policy of --policy; None without one.

        Raises:
            DomainError: options of the solver are given, too. FileError, ParseError: the file is wrong.
        """
        if self.policy is None:
            return None
        from lcorpp.cli.model_files import read_policy

        limits = {"precision": self.precision, "time-limit": self.time_limit}
        reject_given("nothing is solved, as --policy gives a policy", solver=self.solver, **limits)
        return read_policy(self.policy, domain.pomdp)
