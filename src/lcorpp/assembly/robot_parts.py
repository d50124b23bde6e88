"""The parts that determine a robot's decisions, and as JSON for a log."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import lcorpp
from lcorpp.assembly.solving import RatesSource, have_own_rates
from lcorpp.decision import Robot
from lcorpp.domains import Domain
from lcorpp.domains.loading import SHIPPED_FOLDER
from lcorpp.errors import DecisionError, LcorppError
from lcorpp.files import read_bytes
from lcorpp.planning import Policy, SolverOptions
from lcorpp.planning.upper_bounds import MixtureBound
from lcorpp.protocols import Planner as PlannerProtocol
from lcorpp.reasoning import Program
from lcorpp.user_code import split_function
from lcorpp.values import JEFFREYS, ConfusionMatrix

if TYPE_CHECKING:
    from lcorpp.decision.strategies import Rates, Strategy

Json = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class ClassifierPart:
    """A classifier as the program knows it.

    source: "channel", a learner, a file, or "given" for a label from elsewhere.
    fingerprint: of the classifier, "" if it has none.
    confusion: the matrix that replaces its rules; None leaves those of the program.
    soft: whether its evidence is a likelihood, so that its label equals the class in the program.

    Examples:
        >>> from lcorpp import load_robot
        >>> load_robot("intention").parts.classifiers["motion"].source
        'channel'
    """

    source: str
    fingerprint: str = ""
    confusion: ConfusionMatrix | None = None
    soft: bool = False

    @classmethod
    def of(
        cls, source: str, classifier: Any, *, confusion: ConfusionMatrix | None = None, soft: bool = False
    ) -> ClassifierPart:
        """Return the part with the fingerprint of its file, or of the classifier itself."""
        fingerprint = find_fingerprint(source)
        if fingerprint is None:
            return cls(source, hash_object(classifier), confusion, soft)
        parts = split_function(source)
        path, end = (Path(source), "") if parts is None else (parts[0], f":{parts[1]}")
        # absolute, as another folder may be the current one later
        return cls(f"{path.resolve()}{end}", fingerprint, confusion, soft)


@dataclass(frozen=True, eq=False)
class RobotParts:
    """The parts that determine a robot's decisions about facts and labels.

    classifiers: sense -> its classifier. smoothing: of their confusion matrices.
    policy: None for a generative model, with which the robot searches at each step.
    solver: the options that made the policy; None for a policy from elsewhere. policy_file: its file, if any.
    has_own_priors: whether the solver knew the priors by these classifiers' rates, see `find_own_program`.

    Examples:
        >>> from lcorpp import load_robot
        >>> parts = load_robot("intention").parts
        >>> parts.description["domain"]["name"], parts.description["policy"]["solver"]["name"]
        ('intention', 'sarsop')
    """

    domain: Domain
    policy: Policy | None
    classifiers: Mapping[str, ClassifierPart] = field(default_factory=dict)
    smoothing: Fraction = JEFFREYS
    solver: SolverOptions | None = None
    policy_file: Path | None = None
    has_own_priors: bool = False

    @cached_property
    def program(self) -> Program:
        """The robot's program with the classifiers' rules."""
        return make_program(self.domain, self.classifiers, self.smoothing)

    @cached_property
    def rates(self) -> Rates:
        """The rates of senses with soft evidence, which the program lacks."""
        parts = self.classifiers.items()
        soft = [name for name, part in parts if part.soft]
        if not soft:
            return {}
        from lcorpp.assembly.soft_rates import compute_soft_rates  # loads `lcorpp.trust`

        confusions = {name: part.confusion for name, part in parts if part.confusion is not None}
        return compute_soft_rates(self.domain, confusions, self.smoothing, soft=soft)

    @property
    def alpha_policy(self) -> Policy:
        """The policy.

        Raises:
            DecisionError: the model is generative.
        """
        if self.policy is None:
            raise DecisionError(f"{self.domain.model.file} is simulated, so that there is no policy for it")
        return self.policy

    @cached_property
    def description(self) -> Json:
        """The parts as JSON, with a fingerprint of each; `logged_parts.read_parts` is the inverse."""
        return {
            "lcorpp": lcorpp.__version__,
            **describe_domain(self.domain),
            "policy": self._describe_policy(),
            "classifiers": {name: _describe_classifier(part) for name, part in self.classifiers.items()},
            "smoothing": str(self.smoothing),
        }

    def _describe_policy(self) -> dict[str, Any]:
        """Return the policy, with what made it; or the work of the search at each step."""
        if self.policy is None:
            assert self.domain.planning.search is not None
            return {"search": asdict(self.domain.planning.search)}
        policy: dict[str, Any] = {"fingerprint": hash_policy(self.policy)}
        if self.solver is not None:
            options, own = asdict(self.solver), asdict(self.domain.planning.solver)
            given = [name for name, value in own.items() if options[name] != value]
            any_prior = isinstance(self.policy.upper_bound, MixtureBound)
            policy |= {"solver": options, "given": given, "any_prior": any_prior}
            policy["own_priors"] = self.has_own_priors
        elif self.policy_file is not None:
            policy["file"] = str(self.policy_file.resolve())
        return policy

    @cached_property
    def robot(self) -> Robot:
        """The full robot, without classifiers."""
        reasoner = self.domain.make_reasoner(self.program)
        return Robot({}, reasoner, self.make_planner(), self.domain)

    def make_planner(self) -> PlannerProtocol:
        """Return the planner that acts by the policy, or searches with a generative model."""
        if self.policy is not None:
            return (self.solver or SolverOptions()).make_planner(self.policy, self.domain.pomdp)
        from lcorpp.planning import GenerativeModel, GenerativePlanner  # tables do without

        assert isinstance(self.domain.model, GenerativeModel)
        return GenerativePlanner(self.domain.model, self.domain.planning.search)


def describe_strategy(strategy: Strategy) -> dict[str, Any]:
    """Return the name of a strategy; of the user's with file, function and fingerprint of the file.

    A budget for asking to learn is there if it is not the default (`with_ask_budget`).
    """
    own = strategy.own
    if strategy.start is not None:
        from lcorpp.assembly.strategies.trust import find_ask_budget  # other strategies need no trust

        if (budget := find_ask_budget(strategy)) is not None:
            return {"name": strategy.name, "ask_budget": budget}
    if own is None:
        return {"name": strategy.name}
    source = f"{own.path.resolve()}:{own.name.removesuffix('.robot')}"
    return {"name": strategy.name, "source": source, "fingerprint": find_fingerprint(source) or ""}


def make_program(
    domain: Domain, classifiers: Mapping[str, RatesSource], smoothing: Fraction = JEFFREYS
) -> Program:
    """Return the domain's program with the error rates of classifiers as rules.

    Args:
        classifiers: sense -> its classifier. smoothing: of their confusion matrices.
    """
    parts = classifiers.items()
    confusions = {name: part.confusion for name, part in parts if part.confusion is not None}
    return domain.program_for(confusions, smoothing, soft=[name for name, part in parts if part.soft])


def find_own_program(
    domain: Domain, classifiers: Mapping[str, RatesSource], smoothing: Fraction
) -> Program | None:
    """Return `make_program` if a classifier has other rates than the domain, and all give labels."""
    is_soft = any(part.soft for part in classifiers.values())
    if is_soft or not have_own_rates(classifiers):
        return None
    return make_program(domain, classifiers, smoothing)


def describe_domain(domain: Domain) -> dict[str, Any]:
    """Return the domain, its knowledge and its model; a comment in the latter two changes no fingerprint.

    A reasoner of the user's own is there with its file, relative to the domain's folder if it lies there.
    """
    shipped = domain.folder.parent == SHIPPED_FOLDER
    own, reasoner = domain.reasoning.own_reasoners, {}
    if own is not None:
        path, folder = Path(own.source).resolve(), domain.folder.resolve()
        source = str(path.relative_to(folder) if path.is_relative_to(folder) else path)
        reasoner = {"reasoner": {"source": source, "fingerprint": find_fingerprint(own.source)}}
    return {
        "domain": {
            "name": domain.name,
            "folder": domain.folder.name if shipped else str(domain.folder.resolve()),
            "preset": domain.preset,
            "fingerprint": hash_bytes(read_bytes(domain.folder / "domain.toml")),
        },
        "knowledge": {"file": domain.program.file, "fingerprint": hash_bytes(str(domain.program).encode())},
        "model": {"file": domain.model.file, "fingerprint": shorten(domain.model.fingerprint)},
        **reasoner,
    }


def _describe_classifier(part: ClassifierPart) -> dict[str, Any]:
    content: dict[str, Any] = {"source": part.source, "fingerprint": part.fingerprint, "soft": part.soft}
    if part.confusion is not None:
        content |= part.confusion.to_json()
    return content


def find_fingerprint(source: str) -> str | None:
    """Return the fingerprint of a classifier's file now; None if the source names no file."""
    parts = split_function(source)
    path = Path(source) if parts is None else parts[0]
    if parts is None and (":" in source or not path.suffix):  # a learner, or MODULE:FUNCTION
        return None
    try:
        return hash_bytes(read_bytes(path))
    except LcorppError:
        return "missing"


def hash_policy(policy: Policy) -> str:
    """Return the fingerprint of the vectors and actions of a policy."""
    digest = hashlib.sha256()
    for part in policy.vector_sets:
        digest.update(part.states.astype("<i8").tobytes() + part.actions.astype("<i8").tobytes())
        digest.update((part.vectors + 0.0).astype("<f8").tobytes())  # -0.0 as 0.0
    return shorten(digest.hexdigest())


def hash_object(value: Any) -> str:
    """Return the fingerprint of an object's content; "" if it cannot be pickled."""
    import joblib

    try:
        return shorten(str(joblib.hash(value)))
    except Exception:  # pickling runs the object's own code
        return ""


def hash_bytes(content: bytes) -> str:
    """Return the fingerprint of a file's content."""
    return shorten(hashlib.sha256(content).hexdigest())


def shorten(digest: str) -> str:
    """Return the part of a hexadecimal digest that a log contains: 64 bits."""
    return digest[:16]
