"""The parts that determine a robot's decisions: as JSON for a log, and set up again from it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import lcorpp
from lcorpp.assembly.solving import RatesSource, have_own_rates, solve_domain
from lcorpp.decision import Robot
from lcorpp.domains import Domain, load_domain, with_reasoner
from lcorpp.domains.loading import SHIPPED_FOLDER
from lcorpp.errors import DecisionError, LcorppError
from lcorpp.files import read_bytes
from lcorpp.planning import Policy, SolverOptions
from lcorpp.planning.upper_bounds import MixtureBound
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
    solver: the options that made the policy; None for a policy from elsewhere. policy_file: its file, if any.
    has_own_priors: whether the solver knew the priors by these classifiers' rates, see `find_own_program`.

    Examples:
        >>> from lcorpp import load_robot
        >>> parts = load_robot("intention").parts
        >>> parts.description["domain"]["name"], parts.description["policy"]["solver"]["name"]
        ('intention', 'sarsop')
    """

    domain: Domain
    policy: Policy
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

    @cached_property
    def description(self) -> Json:
        """The parts as JSON, with a fingerprint of each; `read_parts` is the inverse."""
        policy: dict[str, Any] = {"fingerprint": hash_policy(self.policy)}
        if self.solver is not None:
            options, own = asdict(self.solver), asdict(self.domain.planning.solver)
            given = [name for name, value in own.items() if options[name] != value]
            any_prior = isinstance(self.policy.upper_bound, MixtureBound)
            policy |= {"solver": options, "given": given, "any_prior": any_prior}
            policy["own_priors"] = self.has_own_priors
        elif self.policy_file is not None:
            policy["file"] = str(self.policy_file.resolve())
        return {
            "lcorpp": lcorpp.__version__,
            **_describe_domain(self.domain),
            "policy": policy,
            "classifiers": {name: _describe_classifier(part) for name, part in self.classifiers.items()},
            "smoothing": str(self.smoothing),
        }

    @cached_property
    def robot(self) -> Robot:
        """The full robot, without classifiers."""
        reasoner = self.domain.make_reasoner(self.program)
        planner = (self.solver or SolverOptions()).make_planner(self.policy, self.domain.pomdp)
        return Robot({}, reasoner, planner, self.domain)


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


def list_changed_files(domain: Domain, logged: Json) -> list[str]:
    """Return the files of a domain that differ from those of a log."""
    now, model = _describe_domain(domain), domain.pomdp.file
    files = {"domain": domain.folder / "domain.toml", "knowledge": domain.program.file, "model": model}
    if "reasoner" in logged:
        files["reasoner"] = logged["reasoner"]["source"]
    return [
        f"{what}: {file}"
        for what, file in files.items()
        if what not in now or logged[what]["fingerprint"] != now[what]["fingerprint"]
    ]


def list_changed_sources(sources: Mapping[str, Json]) -> list[str]:
    """Return the files of classifiers, learners and own strategies that differ from those of a log.

    Args:
        sources: what a file is -> its description.
    """
    return [
        f"{what}: {own['source']}"
        for what, own in sources.items()
        if "source" in own and find_fingerprint(own["source"]) not in (None, own["fingerprint"])
    ]


def list_changed_policy(parts: RobotParts, logged: Json) -> list[str]:
    """Return the policy, with its file, if it differs from that of a log."""
    if logged["policy"]["fingerprint"] == hash_policy(parts.policy):
        return []
    solver = "" if parts.solver is None else f" by {parts.solver.name}"
    return [f"policy: {parts.policy_file or f'of {parts.domain.pomdp.file}{solver}'}"]


def load_logged_domain(description: Json, folder: Path | None = None) -> Domain:
    """Load the domain of a log, from `folder` if it is not where it was.

    Raises:
        LcorppError: a file is missing or wrong.
        LookupError, TypeError, ValueError: `description` has another form.
    """
    about = description["domain"]
    domain = load_domain(folder or Path(about["folder"]), preset=about["preset"])
    if "reasoner" not in description:
        return domain
    return with_reasoner(domain, str(domain.folder / description["reasoner"]["source"]))


def read_parts(description: Json, domain: Domain, *, cache: Path | None = None) -> RobotParts:
    """Set up the parts that a log describes, from the files as they are now.

    Args:
        cache: a folder that keeps policies, None for none.

    Raises:
        LcorppError: a file is missing or wrong.
        LookupError, TypeError, ValueError: `description` has another form.
    """
    policy = description["policy"]
    classifiers, smoothing = _read_classifiers(description, domain)
    if "solver" not in policy:
        if "file" not in policy:
            raise DecisionError("the policy has no file and no solver, so it cannot be set up again")
        from lcorpp.planning import read_policy  # loads the file formats

        file = Path(policy["file"])
        found = read_policy(file, domain.pomdp)
        return RobotParts(domain, found, classifiers, smoothing, policy_file=file)
    solver = replace(domain.planning.solver, **{name: policy["solver"][name] for name in policy["given"]})
    has_own_priors, any_prior = policy.get("own_priors", False), policy.get("any_prior", False)
    program = find_own_program(domain, classifiers, smoothing) if has_own_priors else None
    solution = solve_domain(domain, solver, any_prior=any_prior, program=program, cache=cache)
    return RobotParts(domain, solution.policy, classifiers, smoothing, solver, has_own_priors=has_own_priors)


def read_program(description: Json, domain: Domain) -> Program:
    """Return the program with the rules of the classifiers that a log describes.

    Raises:
        LcorppError, LookupError, TypeError, ValueError: as `read_parts`.
    """
    return make_program(domain, *_read_classifiers(description, domain))


def _read_classifiers(description: Json, domain: Domain) -> tuple[dict[str, ClassifierPart], Fraction]:
    """Return sense -> classifier, and the smoothing of their confusion matrices."""
    classifiers = {name: _read_classifier(part) for name, part in description["classifiers"].items()}
    for name in classifiers:
        domain.find_sense(name)
    return classifiers, Fraction(description["smoothing"])


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


def _describe_domain(domain: Domain) -> dict[str, Any]:
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
        "model": {"file": domain.pomdp.file, "fingerprint": shorten(domain.pomdp.fingerprint)},
        **reasoner,
    }


def _describe_classifier(part: ClassifierPart) -> dict[str, Any]:
    content: dict[str, Any] = {"source": part.source, "fingerprint": part.fingerprint, "soft": part.soft}
    if part.confusion is not None:
        content |= part.confusion.to_json()
    return content


def _read_classifier(content: Json) -> ClassifierPart:
    confusion = None
    if "counts" in content:
        confusion = ConfusionMatrix.from_json(content)
    return ClassifierPart(content["source"], content["fingerprint"], confusion, content["soft"])


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
