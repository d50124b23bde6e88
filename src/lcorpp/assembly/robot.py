"""The robot of a domain, composed of classifiers, knowledge and policy; the commands use it, too."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np

from lcorpp.assembly.case import choose_labels, draw_case
from lcorpp.assembly.options import (
    HARD_LABELS,
    ClassifierOptions,
    EvidenceOptions,
    StoredOptions,
    TrainingOptions,
)
from lcorpp.assembly.progress import ProgressDisplay, no_progress
from lcorpp.assembly.robot_parts import ClassifierPart, RobotParts, find_own_program
from lcorpp.assembly.senses import Senses, SenseSetup, from_channel
from lcorpp.assembly.solving import explain_missing_reports, have_own_rates, solve_domain
from lcorpp.decision import Robot, dt_control
from lcorpp.domains import Domain, load_domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DomainError, check_type
from lcorpp.notebook import html_table
from lcorpp.planning import Policy, Solution, SolverOptions
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.protocols import World
from lcorpp.simulation.simulated_classifier import PrecomputedLabel
from lcorpp.values import JEFFREYS, Array, Episode, Instance, Label, Likelihood, Step
from lcorpp.worlds import ScriptedWorld


@dataclass(frozen=True, eq=False)
class DomainRobot:
    """A robot that was composed from a domain, and what it was composed of.

    senses: sense -> the setup of its classifier.
    parts: what determines its decisions, for a log.
    solution: of the POMDP; None if the policy was given, or the model is generative.

    Examples:
        >>> from lcorpp import load_robot
        >>> robot = load_robot("intention")
        >>> robot.decide({"time": "afternoon"}, label="one", world=["pos", "pos"]).report
        'interested'
    """

    senses: Senses
    parts: RobotParts
    solution: Solution | None = None

    def _repr_html_(self) -> str:
        program, policy = self.parts.program, self.parts.policy
        numbers = f"{len(program.attributes)} attributes, {len(program.statements)} statements"
        rows = [
            *[(f"classifier of {name}", repr(setup).strip("<>")) for name, setup in self.senses.items()],
            ("knowledge", f"{Path(program.file).name}: {numbers}"),
            ("policy", f"for {Path(policy.model).name}: {len(policy)} vectors")
            if policy is not None
            else ("planner", repr(self.parts.make_planner()).strip("<>")),
        ]
        return html_table(("part", "contents"), rows, caption=f"Robot of the domain {self.domain.name}")

    @property
    def domain(self) -> Domain:
        """The domain."""
        return self.parts.domain

    @cached_property
    def robot(self) -> Robot:
        """The full robot of Algorithm 2."""
        classifiers = {name: setup.classifier for name, setup in self.senses.items()}
        return replace(self.parts.robot, classifiers=classifiers)

    def decide(
        self,
        facts: Mapping[str, str],
        *,
        label: Label | None = None,
        labels: Mapping[str, Label] | None = None,
        signals: Mapping[str, Array] | None = None,
        world: World | Sequence[str] | None = None,
        seed: int = 0,
        listener: Callable[[Step], None] = lambda _: None,
    ) -> Episode:
        """Decide about one person: Algorithm 2.

        Args:
            facts: observed attribute -> value.
            label: the output of the classifier of the only sense, instead of a signal: a class, the value of
                its attribute, or a `Likelihood`, if the robot was composed for it.
            labels: sense -> output, of several senses.
            signals: sense -> what it perceived of the person, which its trained classifier receives.
            world: executes the actions; the prepared answers of a person; or None, for a simulated person
                who fits the facts. What the classifiers of such a person output is drawn, too, for senses
                without label and signal.
            seed: of the simulated person.
            listener: called after every step.

        Raises:
            DomainError: a fact, sense or label is unknown, a likelihood comes in place of a label, or a
                signal beside a label or for a noisy channel.
            DecisionError: the robot needs more answers than are prepared.
            NoReportError: the policy never reports.
        """
        check_type(facts, Mapping, "`facts`, attribute -> value,", DomainError)
        known, perceived = choose_labels(self.domain, label, labels or {}), signals or {}
        self._check_evidence(known, perceived)
        self.domain.evidence(facts, known)  # rejects what is unknown
        if world is None:
            case = draw_case(self.domain, self.senses, facts, known, seed=seed)
            known = {name: own for name, own in case.predicted.items() if name not in perceived}
            world, facts = case.world, case.facts
        elif isinstance(world, Sequence):
            world = ScriptedWorld(world)
        given = {name: PrecomputedLabel(own) for name, own in known.items()}
        blanks = dict.fromkeys(known, np.zeros(0))  # a classifier is asked only if there is a signal
        robot = replace(self.robot, classifiers={**self.robot.classifiers, **given})
        with explain_missing_reports(self.solution):
            return dt_control(robot, Instance({**perceived, **blanks}, facts), world, listener=listener)

    def _check_evidence(self, labels: Mapping[str, Label], signals: Mapping[str, Array]) -> None:
        """Reject evidence that the robot would ignore, or that is of another kind than its rules expect.

        Raises:
            DomainError: as of `decide`.
        """
        for name in signals:
            self.domain.find_sense(name)
            if name in labels:
                raise DomainError(f"a label and a signal of {name} are given; expected one of them")
            if self.senses[name].trained is None:
                raise DomainError(
                    f"the classifier of {name} is a noisy channel, which has no signals; expected a label, or"
                    " a robot with a trained classifier, see `classifiers` of load_robot"
                )
        for name, own in labels.items():
            soft = self.parts.classifiers[name].soft
            if isinstance(own, Likelihood) != soft:
                expected = "likelihood" if soft else "label"
                raise DomainError(
                    f"the evidence of {name} is {own!r}; this robot expects a {expected}, see"
                    " `likelihoods` of load_robot"
                )


def set_up_senses(
    domain: Domain,
    senses: Iterable[Sense],
    classifiers: Mapping[str, ClassifierOptions],
    evidence: EvidenceOptions,
    progress: ProgressDisplay = no_progress,
    *,
    seed: int = 0,
    jobs: int = 1,
) -> dict[str, SenseSetup]:
    """Train or load the classifiers of some senses, or make their noisy channels.

    Args:
        classifiers: sense -> how to get its classifier; others are noisy channels.
        evidence: of trained and loaded classifiers. seed, jobs: of the training.

    Returns:
        sense -> its setup, in the order of `senses`.

    Raises:
        DomainError: a sense has no noisy channel, or no signals to train on.
        DataError, FileError: the options or files are wrong.
    """
    setups = {}
    for sense in senses:
        how = classifiers.get(sense.name)
        if how is None:
            setups[sense.name] = from_channel(domain, sense)
            continue
        # loads scikit-learn
        from lcorpp.assembly.classifier_training import load_trained, train_classifier

        if isinstance(how, StoredOptions):
            setups[sense.name] = load_trained(domain, sense, how, evidence, seed=seed)
        else:
            setups[sense.name] = train_classifier(
                domain, sense, how, evidence, seed=seed, jobs=jobs, progress=progress
            )
    return setups


def describe_classifiers(senses: Senses) -> dict[str, ClassifierPart]:
    """Return the classifiers of some senses as parts of a robot, for the log."""
    return {
        name: ClassifierPart.of(setup.source, setup.classifier, confusion=setup.confusion, soft=setup.soft)
        for name, setup in senses.items()
    }


def compose_robot(
    domain: Domain,
    senses: Senses,
    solver: SolverOptions | None = None,
    *,
    policy: Policy | None = None,
    policy_file: Path | None = None,
    given: Mapping[str, bool] | None = None,
    smoothing: Fraction = JEFFREYS,
    cache: Path | None = None,
    progress: ProgressDisplay = no_progress,
) -> DomainRobot:
    """Compose the robot of a domain from its classifiers: knowledge with their rates, and the policy.

    Args:
        senses: of `set_up_senses`.
        solver: None takes that of the domain.
        policy: None solves the POMDP. policy_file: its file, for a log.
        given: sense -> whether its evidence is a likelihood, for senses whose evidence comes from elsewhere.
        smoothing: of the confusion matrices that become rules.
        cache: a folder that keeps policies, None for none.
        progress: shows the solver's progress.

    Raises:
        ModelError, DomainError: as `solve_domain`.

    Examples:
        >>> from lcorpp import load_robot
        >>> from lcorpp.assembly import compose_robot
        >>> from lcorpp.planning import SolverOptions
        >>> robot = load_robot("intention")
        >>> fast = compose_robot(robot.domain, robot.senses, SolverOptions(precision=0.1))
        >>> fast.solution.upper - fast.solution.lower <= 0.1
        True
    """
    classifiers = describe_classifiers(senses)
    for name, soft in (given or {}).items():
        classifiers[name] = replace(classifiers[name], source="given", fingerprint="", soft=soft)
    if policy is not None:
        return DomainRobot(senses, RobotParts(domain, policy, classifiers, smoothing, None, policy_file))
    if domain.planning.search is not None:
        return DomainRobot(senses, RobotParts(domain, None, classifiers, smoothing))
    options = solver or domain.planning.solver
    any_prior, program = have_own_rates(classifiers), find_own_program(domain, classifiers, smoothing)
    with progress("solving the POMDP") as advance:
        solution = solve_domain(
            domain, options, any_prior=any_prior, program=program, cache=cache, advance=advance
        )
    parts = RobotParts(
        domain, solution.policy, classifiers, smoothing, options, has_own_priors=program is not None
    )
    return DomainRobot(senses, parts, solution)


def load_robot(
    domain: Domain | str | Path = "intention",
    *,
    preset: str | None = None,
    classifiers: Mapping[str, ClassifierOptions | str | Path] | None = None,
    evidence: EvidenceOptions = HARD_LABELS,
    likelihoods: Iterable[str] = (),
    solver: SolverOptions | None = None,
    policy: Policy | None = None,
    cache: bool = True,
    progress: ProgressDisplay = no_progress,
    seed: int = 0,
    jobs: int = 1,
) -> DomainRobot:
    """Load a domain and compose its robot, as the commands do.

    Args:
        domain: a domain, its folder, or the name of a shipped one. preset: of a domain that is loaded.
        classifiers: sense -> how to get its classifier: the file of a stored one, the name of a learner that
            is trained now, or options; others are noisy channels with the domain's rates.
        evidence: of trained and loaded classifiers.
        likelihoods: the senses for which `decide` is given a `Likelihood`.
        solver: None takes that of the domain. policy: None solves the POMDP.
        cache: whether solved policies are kept in the user's cache. progress: shows training and solving.
        seed, jobs: of the training.

    Raises:
        DomainError: the domain or a sense is wrong.
        DataError, FileError: a file or an option of a classifier is wrong.
        ModelError: the solver fails.

    Examples:
        >>> from lcorpp import load_robot
        >>> robot = load_robot("intention", preset="paper")
        >>> robot.domain.preset, round(robot.solution.lower, 1)
        ('paper', 66.5)
    """
    check_type(classifiers or {}, Mapping, "`classifiers`, sense -> file, learner or options,", DomainError)
    loaded = domain if isinstance(domain, Domain) else load_domain(domain, preset=preset)
    chosen = {name: _read_options(how) for name, how in (classifiers or {}).items()}
    soft = dict.fromkeys(likelihoods, True)
    for name in (*chosen, *soft):
        loaded.find_sense(name)
    senses = set_up_senses(loaded, loaded.senses, chosen, evidence, progress, seed=seed, jobs=jobs)
    folder = find_cache_folder() if cache else None
    return compose_robot(
        loaded,
        senses,
        solver,
        policy=policy,
        given=soft,
        smoothing=evidence.smoothing,
        cache=folder,
        progress=progress,
    )


def _read_options(how: ClassifierOptions | str | Path) -> ClassifierOptions:
    if isinstance(how, Path) or (isinstance(how, str) and how.endswith(".npz")):
        return StoredOptions(Path(how))
    if isinstance(how, str):
        return None if how == "channel" else TrainingOptions(how)
    return how


def decide(
    domain: Domain | str | Path,
    facts: Mapping[str, str],
    *,
    preset: str | None = None,
    label: Label | None = None,
    labels: Mapping[str, Label] | None = None,
    world: World | Sequence[str] | None = None,
    seed: int = 0,
) -> Episode:
    """Decide about one person: `load_robot` and `DomainRobot.decide`, which describe arguments and errors.

    Examples:
        >>> import lcorpp
        >>> facts = {"time": "afternoon", "location": "library"}
        >>> episode = lcorpp.decide("intention", facts, label="zero", world=["pos", "pos"])
        >>> episode.marginal, episode.report
        (Distribution(interested: 0.5062, not_interested: 0.4938), 'interested')
    """
    loaded = domain if isinstance(domain, Domain) else load_domain(domain, preset=preset)
    known = choose_labels(loaded, label, labels or {})
    soft = [name for name, own in known.items() if isinstance(own, Likelihood)]
    return load_robot(loaded, likelihoods=soft).decide(facts, labels=known, world=world, seed=seed)
