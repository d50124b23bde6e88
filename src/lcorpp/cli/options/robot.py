"""The options of a simulated robot that `run` and `learn` share, with one meaning in both."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli.options import common as options
from lcorpp.cli.options.recordings import LabelOption, RecordingGroup, parse_written_labels
from lcorpp.cli.options.senses import ClassifierGroup, reject_given
from lcorpp.cli.options.solving import SolverGroup
from lcorpp.cli.options.training import TrainingGroup
from lcorpp.errors import DomainError

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions, EvidenceOptions
    from lcorpp.domains import Domain
    from lcorpp.domains.sections.learning import Sense
    from lcorpp.planning import Policy


@dataclass(frozen=True)
class RobotGroup:
    """The options of a simulated robot; see `take_options`."""

    domain: options.DomainArgument = "intention"
    preset: options.PresetOption = None
    world: options.WorldOption = None
    reasoner: options.ReasonerOption = None
    seed: options.SeedOption = 0
    senses: ClassifierGroup = field(default_factory=ClassifierGroup)
    label: LabelOption = None
    recording: RecordingGroup = field(default_factory=RecordingGroup)
    training: TrainingGroup = field(default_factory=TrainingGroup)
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
    solving: SolverGroup = field(default_factory=SolverGroup)
    log: options.LogOption = None
    out: options.OutOption = None
    formats: options.FormatOption = None
    jobs: options.JobsOption = None

    def load_domain(self) -> Domain:
        """Load the domain with its preset, world and reasoner."""
        return options.load_domain(self.domain, self.preset, self.world, self.reasoner)

    def choose_classifiers(
        self,
        domain: Domain,
        used: Sequence[Sense],
        tracks: int | None,
        trained: Collection[str] = (),
        *,
        by_channel: bool = False,
    ) -> dict[str, ClassifierOptions]:
        """Return the options of the classifier of each used sense; see `senses.choose_classifiers`."""
        return self.senses.choose_classifiers(
            domain,
            used,
            reading=self.recording.choose_reading(parse_written_labels(self.label)),
            training=self.training.choose(tracks, threshold=self.threshold, prevalence=self.prevalence),
            trained=trained,
            by_channel=by_channel,
        )

    def choose_evidence(self, domain: Domain, sources: Mapping[str, ClassifierOptions]) -> EvidenceOptions:
        """Return the evidence of the chosen classifiers.

        Raises:
            DomainError: as `senses.choose_evidence`; or --threshold or --smoothing has no effect on it.
        """
        from lcorpp.assembly.options import EvidenceOptions
        from lcorpp.values import JEFFREYS, LAPLACE

        kinds = self.senses.choose_evidence(domain, sources)
        trained = {name for name, source in sources.items() if source is not None}
        only_likelihoods = trained <= set(kinds)
        if trained and only_likelihoods and self.threshold is not None:
            raise DomainError("--threshold determines labels; evidence by likelihoods or sets uses none")
        laplace = self.smoothing is options.Smoothing.laplace
        if laplace and only_likelihoods:
            raise DomainError("--smoothing applies to the labels of a trained classifier only")
        return EvidenceOptions(kinds, LAPLACE if laplace else JEFFREYS)

    def read_policy(self, domain: Domain) -> Policy | None:
        """Read the policy of --policy; None without one.

        Raises:
            DomainError: options of the solver are given, too. FileError, ParseError: the file is wrong.
        """
        if self.policy is None:
            return None
        from lcorpp.cli.model_files import read_policy

        limits = {"precision": self.solving.precision, "time-limit": self.solving.time_limit}
        limits["step-seconds"] = self.solving.step_seconds
        reject_given("nothing is solved, as --policy gives a policy", solver=self.solving.solver, **limits)
        return read_policy(self.policy, domain.pomdp)
