"""The parts of a robot that a log describes: set up from the files as they are now, and what has changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from lcorpp.assembly.robot_parts import (
    ClassifierPart,
    Json,
    RobotParts,
    describe_domain,
    find_fingerprint,
    find_own_program,
    hash_policy,
    make_program,
)
from lcorpp.assembly.solving import solve_domain
from lcorpp.domains import Domain, load_domain, with_reasoner
from lcorpp.errors import DecisionError
from lcorpp.reasoning import Program
from lcorpp.values import ConfusionMatrix


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
    if domain.planning.search is not None:
        return RobotParts(domain, None, classifiers, smoothing)
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


def _read_classifier(content: Json) -> ClassifierPart:
    confusion = None
    if "counts" in content:
        confusion = ConfusionMatrix.from_json(content)
    return ClassifierPart(content["source"], content["fingerprint"], confusion, content["soft"])


def list_changed_files(domain: Domain, logged: Json) -> list[str]:
    """Return the files of a domain that differ from those of a log."""
    now, model = describe_domain(domain), domain.model.file
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
    if parts.policy is None or logged["policy"]["fingerprint"] == hash_policy(parts.policy):
        return []
    solver = "" if parts.solver is None else f" by {parts.solver.name}"
    return [f"policy: {parts.policy_file or f'of {parts.domain.pomdp.file}{solver}'}"]
